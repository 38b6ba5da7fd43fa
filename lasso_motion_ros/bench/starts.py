"""Starts tracker and player over and over, as a user does in two terminals, and counts what came of it.

`python -m lasso_motion_ros.bench.starts [COUNT]`, or `make starts`. Each start is in a domain of its own. Three kinds:
tracker and `lasso-motion play` without any option; tracker and overlay under `use_sim_time`, with `play --clock`; and
the same without anybody on /clock. At the end each process gets SIGINT or SIGTERM, in turn.
"""

from __future__ import annotations

import contextlib
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.share import bundled_recording
from lasso_motion_ros.tools.child_graph import COMMAND
from lasso_motion_ros.tools.demo_surface import write_demo_surface
from lasso_motion_ros.tools.listener import Listener
from lasso_motion_ros.tools.processes import Processes, free_domain, stay_on_this_machine
from msg_adapters.topics import DIAGNOSTICS, MOTION, OVERLAY_SURFACE, STATE, Topic

SIM_TIME = ("--ros-args", "-p", "use_sim_time:=true")


@dataclass(frozen=True)
class StartSetting:
    """How starts are judged.

    Attributes:
        count: starts of each kind.
        delays_s: from the tracker's start to the player's, in turn.
        patience_s: for what is waited for; a busy machine needs most of it to start the nodes.
        stop_s: from the signal to a process's end.
        enough: messages that show that a topic goes on.
    """

    count: int = 20
    delays_s: tuple[float, ...] = (0.0, 1.0, 3.0, 6.0)
    patience_s: float = 60.0
    stop_s: float = 20.0
    enough: int = 3


SETTING = StartSetting()


class _Heard:
    """How many messages came, by topic."""

    def __init__(self) -> None:
        self._counts: dict[str, int] = {}
        self._changed = threading.Condition()

    def __call__(self, topic: Topic, message: Any, published_ns: int) -> None:
        with self._changed:
            self._counts[topic.name] = self._counts.get(topic.name, 0) + 1
            self._changed.notify_all()

    def missing(self, topics: tuple[Topic, ...], enough: int, patience_s: float) -> list[str]:
        """The topics on which not so many messages came in time."""

        def lacking() -> list[str]:
            return [topic.name for topic in topics if self._counts.get(topic.name, 0) < enough]

        with self._changed:
            self._changed.wait_for(lambda: not lacking(), patience_s)
            return lacking()


class _Start:
    """One start: the children, what is heard of them, and how they ended; a context manager."""

    def __init__(self, logs: Path, setting: StartSetting) -> None:
        self._setting = setting
        domain = free_domain()
        self.heard = _Heard()
        self.processes = Processes({"ROS_DOMAIN_ID": str(domain)}, logs)
        self._listener = Listener((DIAGNOSTICS, MOTION, OVERLAY_SURFACE, STATE), self.heard, domain=domain, raw=True)

    def __enter__(self) -> _Start:
        self._listener.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self.processes.stop()
        self._listener.__exit__()

    def expect(self, *topics: Topic) -> list[str]:
        """What did not come, in words."""
        enough, patience_s = self._setting.enough, self._setting.patience_s
        return [f"no {name}" for name in self.heard.missing(topics, enough, patience_s)]

    def left_behind(self, number: signal.Signals, *names: str) -> list[str]:
        """What a signal did not end properly, in words."""
        faults = []
        for name in names:
            self.processes.send(name, number)
        for name in names:
            try:
                status = self.processes.wait(name, self._setting.stop_s)
            except LassoMotionError:
                faults.append(f"{name} did not end on {number.name}")
                with contextlib.suppress(LassoMotionError):
                    self.processes.send(name, signal.SIGKILL)
                    self.processes.wait(name, self._setting.stop_s)
                continue
            if status:
                faults.append(f"{name} ended with status {status} on {number.name}")
        return faults


def started_as_told(start: _Start, number: int, recording: Path, setting: StartSetting) -> list[str]:
    """Tracker, then the player, with no option at all; returns what went wrong."""
    start.processes.start_node("tracker", "lasso_tracker")
    time.sleep(setting.delays_s[number % len(setting.delays_s)])
    start.processes.start("player", COMMAND, ["play", str(recording)])
    faults = start.expect(MOTION)
    start.processes.send("player", signal.SIGINT)
    return faults + start.left_behind(_signal(number), "tracker")


def under_sim_time(start: _Start, number: int, recording: Path, surface: Path, *, clock: bool) -> list[str]:
    """Tracker and overlay under `use_sim_time`, with a player's clock or without; returns what went wrong."""
    start.processes.start_node("tracker", "lasso_tracker", SIM_TIME)
    words = ["-p", f"volume_file:={surface}", "-p", "units:=mm"]
    start.processes.start_node("overlay", "lasso_overlay", [*SIM_TIME, *words])
    if clock:
        start.processes.start("player", COMMAND, ["play", str(recording), "--clock"])
    faults = start.expect(DIAGNOSTICS, OVERLAY_SURFACE, *((MOTION,) if clock else ()))
    if clock:
        start.processes.send("player", signal.SIGINT)
    return faults + start.left_behind(_signal(number), "tracker", "overlay")


def _signal(number: int) -> signal.Signals:
    return signal.SIGTERM if number % 2 else signal.SIGINT


def starts(setting: StartSetting = SETTING, show: Callable[[str], None] = lambda line: None) -> dict[str, list[str]]:
    """Start so often in each way.

    Args:
        setting: how often, and how it is judged.
        show: told a line after each start.

    Returns:
        What went wrong, by kind of start: one line for each start that failed.
    """
    stay_on_this_machine()
    with tempfile.TemporaryDirectory(prefix="lasso_motion_starts_") as directory:
        return _starts(Path(directory), setting, show)


def _starts(directory: Path, setting: StartSetting, show: Callable[[str], None]) -> dict[str, list[str]]:
    """As `starts`, with a directory for what they need."""
    recording, surface = bundled_recording(), directory / "left_atrium.stl"
    write_demo_surface(recording, surface)

    def sim_time(start: _Start, number: int, *, clock: bool) -> list[str]:
        return under_sim_time(start, number, recording, surface, clock=clock)

    kinds: dict[str, Callable[[_Start, int], list[str]]] = {
        "tracker, then play": lambda start, number: started_as_told(start, number, recording, setting),
        "use_sim_time with a clock": partial(sim_time, clock=True),
        "use_sim_time without a clock": partial(sim_time, clock=False),
    }
    failed: dict[str, list[str]] = {kind: [] for kind in kinds}
    for kind, run in kinds.items():
        for number in range(setting.count):
            began = time.monotonic()
            with tempfile.TemporaryDirectory(prefix="lasso_motion_starts_") as logs, _Start(Path(logs), setting) as one:
                faults = run(one, number)
            if faults:
                failed[kind].append(f"start {number + 1}: {', '.join(faults)}")
            show(f"{kind}: start {number + 1}, {time.monotonic() - began:.1f} s, {', '.join(faults) or 'well'}")
    return failed


def main() -> int:
    """Run it and print the outcome; returns the exit status."""
    setting = StartSetting(count=int(sys.argv[1])) if len(sys.argv) > 1 else SETTING
    failed = starts(setting, lambda line: print(line, flush=True))  # noqa: T201 - its output
    for kind, lines in failed.items():
        sys.stdout.write(f"{kind}: {setting.count - len(lines)} of {setting.count}\n")
    return 1 if any(failed.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
