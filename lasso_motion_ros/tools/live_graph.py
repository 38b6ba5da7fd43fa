"""The whole graph, live: player, tracker and overlay as processes of their own, watched and recorded from outside."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import deserialize_message

from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.output_files import make_directory
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.nodes.diagnostics import HALF_PAIRS, PAIRS
from lasso_motion_ros.tools.child_graph import START_WAIT_S, TooLateError, child_graph
from lasso_motion_ros.tools.listener import Listener
from lasso_motion_ros.tools.processes import free_domain, stay_on_this_machine
from msg_adapters.recordings.writer import RecordingWriter
from msg_adapters.topics import DIAGNOSTICS, OUTPUTS, OVERLAY_SURFACE, STATE, Topic, overlay_topic

ANSWER_WAIT_S = 20.0
PICTURE_WAIT_S = 3.0
MOTION_WAIT_S = 0.3
"""How long the overlay waits for an image's own motion: nobody looks on live, so rather late than of another pair."""


@dataclass(frozen=True)
class DemonstrationInput:
    """What is played, and what it is played to.

    Attributes:
        recording: the recording.
        configuration: the tracker's parameter file.
        surface: the STL that the overlay draws, world millimetres.
        whole_pairs: how many pairs, those with an image of both planes, must be answered.
        pictures: how many images of each plane must come back with the overlay drawn in.
        live: where what comes over the wire is recorded.
        logs: where the logs go; made if need be.
    """

    recording: Path
    configuration: Path
    surface: Path
    whole_pairs: int
    pictures: Mapping[Plane, int]
    live: Path
    logs: Path


def run_graph(given: DemonstrationInput, say: Callable[[str], None]) -> None:
    """Play a recording through the live graph in real time.

    Args:
        given: what to play.
        say: takes one line of progress for the user.

    Raises:
        LassoMotionError: a process failed, or did not answer in time; none is left behind.
        KeyboardInterrupt: interrupted; none is left behind then either.
    """
    stay_on_this_machine()
    domain = free_domain()
    make_directory(given.logs)
    # `state`, the one that is latched, comes last: when it is heard, the tracker knows of all the others.
    topics = [
        *(overlay_topic(plane) for plane in PLANES),
        OVERLAY_SURFACE,
        DIAGNOSTICS,
        *(topic for topic in OUTPUTS if topic is not STATE),
        STATE,
    ]
    with RecordingWriter(given.live, compression="none", overwrite=True) as writer:
        wire = _Wire(writer)
        with Listener(topics, wire, domain=domain, raw=True) as listener, child_graph(domain, given.logs) as graph:
            say(f"starting tracker and overlay (ROS_DOMAIN_ID={domain}, this machine only)")
            graph.start_tracker(given.configuration)
            graph.start_overlay(given.surface, {"motion_wait_s": MOTION_WAIT_S})
            graph.wait_until(
                lambda: wire.count(STATE) > 0 and all(listener.publishers(overlay_topic(plane)) for plane in PLANES),
                START_WAIT_S,
                "the nodes have not come up",
            )
            say(f"playing {given.recording.name} in real time")
            # Tracker and overlay listen to the images.
            words = ["--wait", str(START_WAIT_S), "--subscribers", "2"]
            graph.start_command("player", "play", str(given.recording), *words)
            wait = partial(graph.wait_until, may_end=("player",))
            wait(lambda: "player" in graph.ended())
            say("waiting for the last answers")
            wait(
                lambda: wire.unanswered(given) == 0,
                ANSWER_WAIT_S,
                lambda: f"{wire.unanswered(given)} of {given.whole_pairs} pairs were not answered",
            )
            with contextlib.suppress(TooLateError):  # a picture that is missing shows as such in the video
                wait(lambda: wire.has_pictures(given), PICTURE_WAIT_S)
            statuses = graph.stop()
    failed = {name: status for name, status in statuses.items() if status != 0}
    if failed:
        raise LassoMotionError(f"ended badly: {failed}; their output is in {given.logs}")


class _Wire:
    """Records what comes over the wire, byte by byte, and counts it."""

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
