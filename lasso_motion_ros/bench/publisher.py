"""Child process of the live benchmark: publishes a biplane stream at a steady rate and notes the times.

`python -m lasso_motion_ros.bench.publisher` takes the words of a `PublishedStream`.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
from rclpy.node import Node
from rclpy.serialization import serialize_message

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.nodes.qos import qos
from lasso_motion_ros.nodes.running import ThrottledLog, run_node
from lasso_motion_ros.stream.drawn_ring import breath_mm, ring_image, ring_projection, ring_seed
from lasso_motion_ros.tools.later_stamps import STAMP_OFFSET
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.images import encode_image
from msg_adapters.messages import NANOSECONDS, RosMessages, header_fields, ns_to_stamp, stamp_to_ns
from msg_adapters.seeds import encode_polygon
from msg_adapters.topics import CATHETER, MOTION, Topic, camera_info_topic, image_topic, seed_topic

START_NS = 1_760_000_000 * NANOSECONDS


@dataclass(frozen=True)
class _Tuning:
    """The stream, and how long is waited for what.

    Attributes:
        breath_s: period of the drawn breathing.
        tick_s: between two looks for subscribers and for the first answer.
        answer_tick_s: between two looks for an answer that holds up the stream.
        unanswered_s: how long a pair may hold up the next: a pair whose loop is lost may have no answer.
    """

    breath_s: float = 2.0
    tick_s: float = 0.02
    answer_tick_s: float = 0.002
    unanswered_s: float = 2.0


TUNING = _Tuning()


@dataclass(frozen=True)
class PublishedStream:
    """What is published, and what is waited for: the child's command line, word for word.

    Attributes:
        rate: pairs a second.
        pairs: of the stream.
        side: of the images, pixels.
        image_subscribers: to wait for on each image topic.
        calibration_subscribers: to wait for on each calibration topic. The first calibration must reach the tracker,
            also where another process has found this one before it.
        notes: file for the steady clock (ns) at which each pair's later image was published, by its stamp.
        most_ahead: pairs that may be published and not yet answered; 0: any number, as a detector would.
        late_ms: how much later plane B is exposed, and published.
    """

    rate: float
    pairs: int
    side: int
    image_subscribers: int
    calibration_subscribers: int
    notes: Path
    most_ahead: int = 0
    late_ms: float = 0.0

    @classmethod
    def read(cls, words: Sequence[str]) -> PublishedStream:
        """Take it from a command line.

        Raises:
            ValueError: there are more or fewer words, or one is no number.
        """
        kinds = get_type_hints(cls).values()
        return cls(*(kind(word) for kind, word in zip(kinds, words, strict=True)))

    @property
    def words(self) -> list[str]:
        """The command line that `read` takes."""
        return [str(value) for value in vars(self).values()]


def late_ns(late_ms: float) -> int:
    """By how much the stamps of plane B are later than those of plane A."""
    return round(1e6 * late_ms)


class BenchPublisher(Node):  # type: ignore[misc]
    """Publishes one seeded pair, waits for the tracker's answer to it, then the stream.

    The images of one breath are drawn beforehand and sent again and again with new stamps: drawing is not measured.

    Args:
        stream: what is published.
    """

    def __init__(self, stream: PublishedStream) -> None:
        super().__init__("bench_publisher", enable_rosout=False)
        self.complaints = ThrottledLog(self.get_logger())
        self._stream, self._period_ns = stream, round(NANOSECONDS / stream.rate)
        self._late_ns: dict[Plane, int] = {"a": 0, "b": late_ns(stream.late_ms)}
        self._wanted = {
            **{image_topic(plane).name: stream.image_subscribers for plane in PLANES},
            **{camera_info_topic(plane).name: stream.calibration_subscribers for plane in PLANES},
            **{seed_topic(plane).name: 1 for plane in PLANES},
        }
        self._messages = RosMessages()
        generator = np.random.default_rng(0)
        steps = max(1, round(TUNING.breath_s * stream.rate))
        self._images: dict[Plane, list[bytearray]] = {plane: [] for plane in PLANES}
        self._infos: dict[Plane, bytearray] = {}
        for plane in PLANES:
            for step in range(min(steps, stream.pairs + 1)):
                exposed_s = step / stream.rate + self._late_ns[plane] / NANOSECONDS
                displacement = breath_mm(exposed_s, TUNING.breath_s)
                pixels = ring_image(plane, stream.side, displacement, generator)
                self._images[plane].append(self._serialised(image_topic(plane), encode_image(pixels, header_fields(0))))
            info = encode_camera_info(ring_projection(plane, stream.side), header_fields(0))
            self._infos[plane] = self._serialised(camera_info_topic(plane), info)
        inputs = [make(plane) for plane in PLANES for make in (image_topic, camera_info_topic, seed_topic)]
        self._publishers = {
            topic.name: self.create_publisher(type(self._messages.make(topic.type_name, {})), topic.name, qos(depth=10))
            for topic in inputs
        }
        self._answered = threading.Event()
        motion = type(self._messages.make(MOTION.type_name, {}))
        self.create_subscription(motion, MOTION.name, lambda _: self._answered.set(), qos(depth=10))
        self._answered_ns = START_NS
        if stream.most_ahead > 0:
            catheter = type(self._messages.make(CATHETER.type_name, {}))
            self.create_subscription(catheter, CATHETER.name, self._on_answer, qos(depth=10))
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._publish_all, name="stream", daemon=True)

    def start(self) -> None:
        """Begin to wait for subscribers."""
        self._thread.start()

    def close(self) -> None:
        """End the stream."""
        self._closing.set()
        self._thread.join()

    def _serialised(self, topic: Topic, fields: dict[str, object]) -> bytearray:
        return bytearray(serialize_message(self._messages.make(topic.type_name, fields)))

    def _publish_all(self) -> None:
        while any(self._publishers[name].get_subscription_count() < count for name, count in self._wanted.items()):
            if self._closing.wait(TUNING.tick_s):
                return
        if self._late_ns["b"]:  # that plane B belongs to plane A, the time between pairs tells
            self._publish_pair(-1)
            if self._closing.wait((self._period_ns - self._late_ns["b"]) / NANOSECONDS):
                return
        self._publish_pair(0)
        seed = ring_seed(self._stream.side)
        for plane in PLANES:
            topic = seed_topic(plane)
            fields = encode_polygon(seed.points(plane), header_fields(START_NS + self._late_ns[plane]))
            self._publishers[topic.name].publish(self._messages.make(topic.type_name, fields))
        while not self._answered.is_set():
            if self._closing.wait(TUNING.tick_s):
                return
        published: dict[int, int] = {}
        began = time.monotonic()
        for number in range(1, self._stream.pairs + 1):
            left = began + number * self._period_ns / NANOSECONDS - time.monotonic()
            if self._closing.wait(max(0.0, left)) or not self._may_publish(number):
                return
            published[START_NS + number * self._period_ns] = self._publish_pair(number)
        self._stream.notes.write_text(json.dumps({str(stamp): at for stamp, at in published.items()}), encoding="utf-8")

    def _on_answer(self, message: Any) -> None:
        self._answered_ns = stamp_to_ns(message.header.stamp)

    def _may_publish(self, number: int) -> bool:
        """Wait until enough of the earlier pairs are answered; False if the node closes meanwhile."""
        needed_ns = START_NS + (number - self._stream.most_ahead) * self._period_ns
        given_up_s = time.monotonic() + TUNING.unanswered_s
        while self._stream.most_ahead > 0 and self._answered_ns < needed_ns and time.monotonic() < given_up_s:
            if self._closing.wait(TUNING.answer_tick_s):
                return False
        return True

    def _publish_pair(self, number: int) -> int:
        """Publish a pair; returns the monotonic time, ns, just before its later image goes out."""
        began = 0
        for plane in PLANES:
            if self._late_ns[plane] and self._closing.wait(self._late_ns[plane] / NANOSECONDS):
                break
            stamp = ns_to_stamp(START_NS + number * self._period_ns + self._late_ns[plane])
            head = np.array([stamp["sec"], stamp["nanosec"]], "<u4").tobytes()
            info = self._infos[plane]
            image = self._images[plane][number % len(self._images[plane])]
            for data in (info, image):
                data[STAMP_OFFSET : STAMP_OFFSET + len(head)] = head
            self._publishers[camera_info_topic(plane).name].publish(bytes(info))
            whole = bytes(image)
            began = time.monotonic_ns()
            self._publishers[image_topic(plane).name].publish(whole)
        return began


def main() -> int:
    """Run until stopped; returns the exit status."""
    return run_node(lambda: BenchPublisher(PublishedStream.read(sys.argv[1:])), [])


if __name__ == "__main__":
    sys.exit(main())
