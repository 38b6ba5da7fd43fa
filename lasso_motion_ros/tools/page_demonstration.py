"""The demonstration with the page: tracker, overlay and page, live on a recording that plays again and again."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from lasso_motion_ros.core.output_files import make_directory
from lasso_motion_ros.nodes.ros_start import chosen_domain
from lasso_motion_ros.tools.child_graph import LOGS, START_WAIT_S, child_graph
from lasso_motion_ros.tools.processes import free_domain, stay_on_this_machine

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
    stay_on_this_machine()
    # A domain that the user has chosen is kept, so that other tools see the graph.
    domain = chosen_domain() or free_domain()
    logs = given.directory / LOGS
    make_directory(logs)
    with contextlib.suppress(KeyboardInterrupt), child_graph(domain, logs) as graph:
        graph.start_tracker(given.configuration)
        if given.surface is not None:
            graph.start_overlay(given.surface)
        graph.start_command("page", "web", "--host", given.host, "--port", str(given.port))
        graph.wait_until(
            lambda: READY in graph.log("page", 50),
            START_WAIT_S,
            f"the page has not come up within {START_WAIT_S:g} s; see {logs}",
        )
        url = graph.log("page", 50).partition(READY)[2].split()[0]
        listeners = 2 if given.surface is None else 3
        # Clicks that come with the recording come in each round; a user's are to hold, so nothing may begin anew.
        again = "--loop" if given.seeded else "--endless"
        words = [again, "--wait", str(START_WAIT_S), "--subscribers", str(listeners)]
        graph.start_command("player", "play", str(given.recording), *words)
        say(f"open {url} in a browser (ROS_DOMAIN_ID={domain}, this machine only); Ctrl-C ends it")
        graph.wait_until(lambda: False)
