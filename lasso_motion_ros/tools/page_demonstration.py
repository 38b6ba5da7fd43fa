"""The demonstration to look at: tracker, overlay and page live on a recording that is played over and over."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.tools.processes import LOOPBACK, Processes, free_domain, held_signals

START_WAIT_S = 60.0
LOOK_PERIOD_S = 0.1
LOGS = "logs"
READY = "the page is at "


@dataclass(frozen=True)
class PageInput:
    """What is played, and to what.

    Attributes:
        recording: the recording.
        configuration: the tracker's parameter file.
        surface: STL that the overlay draws, world millimetres; None: no overlay.
        seeded: whether the recording has clicks.
        host: address of the page.
        port: TCP port of the page.
        directory: where the processes' logs go.
    """

    recording: Path
    configuration: Path
    surface: Path | None
    seeded: bool
    host: str
    port: int
    directory: Path


def run_page(given: PageInput, say: Callable[[str], None]) -> None:
    """Play a recording over and over, with the page beside it, until SIGINT or SIGTERM.

    Args:
        given: what to play.
        say: takes a line for the user.

    Raises:
        LassoMotionError: a process failed; none is left behind.
    """
    for name, value in LOOPBACK.items():
        os.environ.setdefault(name, value)
    # A domain that the user has chosen is kept, so that other tools see the graph.
    domain = os.environ.get("ROS_DOMAIN_ID") or str(free_domain())
    logs = given.directory / LOGS
    logs.mkdir(parents=True, exist_ok=True)
    with held_signals() as interrupted, Processes({"ROS_DOMAIN_ID": domain}, logs) as processes:
        processes.start(
            "tracker", "lasso_motion_ros.nodes.lasso_tracker", ["--ros-args", "--params-file", str(given.configuration)]
        )
        if given.surface is not None:
            parameters = ["-p", f"volume_file:={given.surface}", "-p", "units:=mm"]
            processes.start("overlay", "lasso_motion_ros.nodes.lasso_overlay", ["--ros-args", *parameters])
        page = ["web", "--host", given.host, "--port", str(given.port)]
        processes.start("page", "lasso_motion_ros.cli.main", page)
        deadline = time.monotonic() + START_WAIT_S
        while READY not in processes.log("page", 50):
            _check(processes)
            if time.monotonic() > deadline:
                raise LassoMotionError(f"the page has not come up within {START_WAIT_S:g} s; see {logs}")
            if interrupted.wait(LOOK_PERIOD_S):
                return
        url = processes.log("page", 50).partition(READY)[2].split()[0]
        listeners = 2 if given.surface is None else 3
        # Clicks that come with the recording come in each round; a user's are to hold, so nothing may begin anew.
        again = "--loop" if given.seeded else "--endless"
        player = ["play", str(given.recording), again, "--wait", str(START_WAIT_S), "--subscribers", str(listeners)]
        processes.start("player", "lasso_motion_ros.cli.main", player)
        say(f"open {url} in a browser (ROS_DOMAIN_ID={domain}, this machine only); Ctrl-C ends it")
        _wait(processes, interrupted)


def _wait(processes: Processes, interrupted: threading.Event) -> None:
    while not interrupted.wait(LOOK_PERIOD_S):
        _check(processes)


def _check(processes: Processes) -> None:
    for name, status in processes.ended().items():
        raise LassoMotionError(f"the {name} ended with status {status}: {processes.log(name, 1)}")
