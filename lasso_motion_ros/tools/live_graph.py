"""The whole graph, live: player, tracker and overlay as processes of their own, watched and recorded from outside."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import deserialize_message

from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.nodes.diagnostics import HALF_PAIRS, PAIRS
from lasso_motion_ros.tools.listener import Listener
from lasso_motion_ros.tools.processes import LOOPBACK, Processes, free_domain, held_signals
from msg_adapters.recordings.writer import RecordingWriter
from msg_adapters.topics import DIAGNOSTICS, OUTPUTS, OVERLAY_SURFACE, STATE, Topic, overlay_topic

START_WAIT_S = 60.0
ANSWER_WAIT_S = 20.0
PICTURE_WAIT_S = 3.0
MOTION_WAIT_S = 0.3
"""How long the overlay waits for an image's own motion: nobody looks on live, so rather late than of another pair."""
LOOK_PERIOD_S = 0.05
LOGS = "logs"
LIVE_RECORDING = "live.mcap"


@dataclass(frozen=True)
class DemonstrationInput:
    """What is played, and what it is played to.

    Attributes:
        recording: the recording.
        configuration: the tracker's parameter file.
        surface: the STL that the overlay draws, world millimetres.
        whole_pairs: how many pairs, those with an image of both planes, must be answered.
        pictures: how many images of each plane must come back with the overlay drawn in.
        directory: where the live recording and the logs go.
    """

    recording: Path
    configuration: Path
    surface: Path
    whole_pairs: int
    pictures: Mapping[Plane, int]
    directory: Path


class _TooLateError(LassoMotionError):
    """What was waited for has not happened in time."""


def run_graph(given: DemonstrationInput, say: Callable[[str], None]) -> Path:
    """Play a recording through the live graph in real time.

    Args:
        given: what to play.
        say: takes one line of progress for the user.

    Returns:
        The recording of what came over the wire.

    Raises:
        LassoMotionError: a process failed, or did not answer in time; none is left behind.
        KeyboardInterrupt: interrupted; none is left behind then either.
    """
    for name, value in LOOPBACK.items():
        os.environ.setdefault(name, value)
    domain = free_domain()
    logs = given.directory / LOGS
    logs.mkdir(parents=True, exist_ok=True)
    output = given.directory / LIVE_RECORDING
    # `state`, the one that is latched, comes last: when it is heard, the tracker knows of all the others.
    topics = [
        *(overlay_topic(plane) for plane in PLANES),
        OVERLAY_SURFACE,
        DIAGNOSTICS,
        *(topic for topic in OUTPUTS if topic is not STATE),
        STATE,
    ]
    with RecordingWriter(output, compression="none", overwrite=True) as writer:
        wire = _Wire(writer)
        with (
            Listener(topics, wire, domain=domain, raw=True) as listener,
            held_signals() as interrupted,
            Processes({"ROS_DOMAIN_ID": str(domain)}, logs) as processes,
        ):
            wait = partial(_wait, processes, interrupted)
            say(f"starting tracker and overlay (ROS_DOMAIN_ID={domain}, this machine only)")
            processes.start("tracker", "lasso_motion_ros.nodes.lasso_tracker", _tracker_arguments(given))
            processes.start("overlay", "lasso_motion_ros.nodes.lasso_overlay", _overlay_arguments(given))
            wait(
                lambda: wire.count(STATE) > 0 and all(listener.publishers(overlay_topic(plane)) for plane in PLANES),
                START_WAIT_S,
                "the nodes have not come up",
            )
            say(f"playing {given.recording.name} in real time")
            processes.start("player", "lasso_motion_ros.cli.main", _player_arguments(given))
            wait(lambda: "player" in processes.ended(), None)
            say("waiting for the last answers")
            wait(
                lambda: wire.unanswered(given) == 0,
                ANSWER_WAIT_S,
                lambda: f"{wire.unanswered(given)} of {given.whole_pairs} pairs were not answered",
            )
            with contextlib.suppress(_TooLateError):  # a picture that is missing shows as such in the video
                wait(lambda: wire.has_pictures(given), PICTURE_WAIT_S)
            statuses = processes.stop()
    failed = {name: status for name, status in statuses.items() if status != 0}
    if failed:
        raise LassoMotionError(f"ended badly: {failed}; their output is in {logs}")
    return output


def _tracker_arguments(given: DemonstrationInput) -> list[str]:
    return ["--ros-args", "--params-file", str(given.configuration)]


def _overlay_arguments(given: DemonstrationInput) -> list[str]:
    values = {"volume_file": str(given.surface), "units": "mm", "motion_wait_s": MOTION_WAIT_S}
    return ["--ros-args", *(word for name, value in values.items() for word in ("-p", f"{name}:={value}"))]


def _player_arguments(given: DemonstrationInput) -> list[str]:
    # Tracker and overlay listen to the images.
    return ["play", str(given.recording), "--wait", str(START_WAIT_S), "--subscribers", "2"]


def _wait(
    processes: Processes,
    interrupted: threading.Event,
    what: Callable[[], bool],
    patience_s: float | None,
    otherwise: Callable[[], str] | str = "",
) -> None:
    """Wait until it holds; a child that fails meanwhile, a signal, or time that runs out ends the demonstration."""
    deadline = None if patience_s is None else time.monotonic() + patience_s
    while not what():
        for name, status in processes.ended().items():
            if name != "player" or status != 0:
                raise LassoMotionError(f"the {name} ended with status {status}: {processes.log(name, 1)}")
        if deadline is not None and time.monotonic() > deadline:
            raise _TooLateError(otherwise if isinstance(otherwise, str) else otherwise())
        if interrupted.wait(LOOK_PERIOD_S):
            raise KeyboardInterrupt


class _Wire:
    """What came over the wire: written down as it was, and counted."""

    def __init__(self, writer: RecordingWriter) -> None:
        self._writer = writer
        self._counts: dict[str, int] = {}
        self._answered = 0

    def __call__(self, topic: Topic, message: Any, published_ns: int) -> None:
        self._writer.write_raw(
            topic.recorded_name, topic.type_name, bytes(message), published_ns, latched=topic.latched
        )
        self._counts[topic.name] = self._counts.get(topic.name, 0) + 1
        if topic is DIAGNOSTICS:
            # A pair without a pose is answered by a state, which has no stamp: the tracker's own count tells.
            self._take_diagnostics(deserialize_message(message, DiagnosticArray))

    def count(self, topic: Topic) -> int:
        return self._counts.get(topic.name, 0)

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {entry.key: entry.value for entry in status.values}
            if PAIRS in values:
                self._answered = int(values[PAIRS]) - int(values[HALF_PAIRS])

    def unanswered(self, given: DemonstrationInput) -> int:
        return max(0, given.whole_pairs - self._answered)

    def has_pictures(self, given: DemonstrationInput) -> bool:
        return all(self.count(overlay_topic(plane)) >= count for plane, count in given.pictures.items())
