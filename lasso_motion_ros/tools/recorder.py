"""Records what comes over the wire, byte by byte; a crash costs half a second at most."""

from __future__ import annotations

import queue
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import rclpy
from rclpy.executors import SingleThreadedExecutor

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.nodes.ros_start import ros_session
from lasso_motion_ros.tools.raw_topics import DISCOVERY_PERIOD_S, HeardMessage, heard_topics
from msg_adapters.recorded_messages import jazzy_types
from msg_adapters.recordings.writer import RecordingWriter

CHUNK_PERIOD_S = 0.5
WAITING_BYTES = 256 << 20
"""What may wait for a slow disk: four seconds of two planes, 1024² mono16 at 15 pairs/s."""


@dataclass
class RecordSummary:
    """What was recorded.

    Attributes:
        counts: messages written, by recorded topic.
        lost: messages that were published and did not come, by recorded topic (of topics with one publisher).
        dropped: messages that came and found no room to wait for the disk, by recorded topic.
        left_out: topics whose message type is not known here, with the type.
        seconds: how long it took.
    """

    counts: dict[str, int] = field(default_factory=dict)
    lost: dict[str, int] = field(default_factory=dict)
    dropped: Counter[str] = field(default_factory=Counter)
    left_out: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0


class _Disk:
    """Writes in its own thread; each chunk holds half a second at most and goes to the operating system at once.

    Args:
        writer: the recording.
    """

    def __init__(self, writer: RecordingWriter) -> None:
        self._writer = writer
        self._waiting: queue.SimpleQueue[tuple[str, HeardMessage] | None] = queue.SimpleQueue()
        self._room = threading.Lock()
        self._waiting_bytes = 0
        self._thread = threading.Thread(target=self._write_all, name="disk")
        self.dropped: Counter[str] = Counter()
        self.failure: RecordingError | None = None
        self.taken = 0
        self._thread.start()

    def put(self, topic: str, heard: HeardMessage) -> None:
        """Hand over a message; it is dropped, and counted, where too much waits already."""
        with self._room:
            if self._waiting_bytes + len(heard.data) > WAITING_BYTES or self.failure is not None:
                self.dropped[topic] += 1
                return
            self._waiting_bytes += len(heard.data)
            self.taken += 1
        self._waiting.put((topic, heard))

    def finish(self) -> None:
        """Write what waits, and end.

        Raises:
            RecordingError: the disk is full.
        """
        self._waiting.put(None)
        self._thread.join()
        if self.failure is not None:
            raise self.failure

    def _write_all(self) -> None:
        due = time.monotonic() + CHUNK_PERIOD_S
        while True:
            try:
                entry = self._waiting.get(timeout=max(0.0, due - time.monotonic()))
                if entry is None:
                    return
                self._write(*entry)
            except queue.Empty:
                pass
            except RecordingError as error:
                self.failure = error
                return
            if time.monotonic() >= due:
                try:
                    self._writer.flush()
                except RecordingError as error:
                    self.failure = error
                    return
                due = time.monotonic() + CHUNK_PERIOD_S

    def _write(self, topic: str, heard: HeardMessage) -> None:
        self._writer.write_raw(
            topic,
            heard.type_name,
            heard.data,
            heard.received_ns,
            publish_time_ns=heard.published_ns,
            latched=heard.latched,
            reliable=heard.reliable,
        )
        with self._room:
            self._waiting_bytes -= len(heard.data)


def record(
    writer: RecordingWriter,
    topics: Mapping[str, str],
    instead: Mapping[str, str],
    interrupted: threading.Event,
    duration_s: float | None = None,
    show: Callable[[int], None] = lambda count: None,
) -> RecordSummary:
    """Record live topics in this process until interrupted.

    Args:
        writer: the recording; it is left open, for the caller to finish.
        topics: full name of a live topic → the name it is recorded under.
        instead: of these, those that are recorded only while nobody publishes on another of them → that one.
        interrupted: set it to end.
        duration_s: end after so many seconds; None: only when interrupted.
        show: told now and then how many messages are recorded.

    Raises:
        RecordingError: the disk is full.
    """
    jazzy_types()  # takes a while the first time, in which nothing would be heard
    with ros_session():
        node = rclpy.create_node("lasso_recorder", enable_rosout=False, start_parameter_services=False)
        disk = _Disk(writer)
        summary = RecordSummary(dropped=disk.dropped)
        raw_topics = heard_topics(
            node,
            [name for name in topics if name not in instead],
            lambda heard: disk.put(topics[heard.topic], heard),
            instead,
        )
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        began = time.monotonic()
        try:
            discovery_due = began
            while not interrupted.is_set() and disk.failure is None:
                now = time.monotonic()
                if duration_s is not None and now - began >= duration_s:
                    break
                if now >= discovery_due:
                    for topic in raw_topics:
                        topic.discover()
                    discovery_due = now + DISCOVERY_PERIOD_S
                executor.spin_once(timeout_sec=DISCOVERY_PERIOD_S)
                show(disk.taken)
        finally:
            summary.seconds = time.monotonic() - began
            executor.shutdown()
            node.destroy_node()
            disk.finish()
        summary.counts = writer.counts
        summary.left_out = {topics[topic.name]: topic.type_name or "" for topic in raw_topics if topic.unknown_type}
        summary.lost = {topics[topic.name]: topic.lost for topic in raw_topics if topic.lost}
        return summary
