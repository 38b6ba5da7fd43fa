"""Publishes a recording on its topics at its recorded timing, without loss."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import rclpy
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.nodes.qos import qos
from lasso_motion_ros.nodes.ros_start import ros_session
from lasso_motion_ros.tools.awaited_subscribers import AwaitedSubscribers
from lasso_motion_ros.tools.later_stamps import is_stamped, with_later_stamp
from lasso_motion_ros.tools.raw_topics import message_class_of
from lasso_motion_ros.tools.read_ahead import ReadAhead
from msg_adapters.messages import NANOSECONDS, ns_to_stamp
from msg_adapters.recordings.reader import RawMessage, RecordingReader
from msg_adapters.topics import (
    GROUND_TRUTH,
    INPUTS,
    OUTPUTS,
    OVERLAY_SURFACE,
    compressed_image_topic,
    image_topic,
    overlay_topic,
    seed_topic,
    tracking_topic,
)

OUTPUT_NAMES = frozenset(
    topic.recorded_name
    for topic in (
        *OUTPUTS,
        OVERLAY_SURFACE,
        *(make(plane) for make in (tracking_topic, overlay_topic) for plane in PLANES),
    )
)
LATCHED_NAMES = frozenset(topic.recorded_name for topic in (*INPUTS, *OUTPUTS, *GROUND_TRUTH) if topic.latched)
IMAGE_NAMES = frozenset(make(plane).recorded_name for make in (image_topic, compressed_image_topic) for plane in PLANES)
SEED_NAMES = frozenset(seed_topic(plane).recorded_name for plane in PLANES)


@dataclass(frozen=True)
class PlayerTuning:
    """The player's constants.

    Attributes:
        depth: messages that a publisher keeps for a slow subscriber.
        read_ahead: messages read from the file before their time.
        clock_period_s: between two messages on /clock.
        look_period_s: between two looks at who listens.
        silent_wait_s: so long it waits for subscribers without a word.
        acknowledge_wait_s: for all subscribers to acknowledge the last messages.
        seed_wait_s: for the images to be acknowledged before the clicks on them go out.
        round_pause_s: between two rounds of an endless stream: what is filmed has its time to get from its last place
            to its first.
    """

    depth: int = 32
    read_ahead: int = 16
    clock_period_s: float = 0.01
    look_period_s: float = 0.02
    silent_wait_s: float = 1.0
    acknowledge_wait_s: float = 10.0
    seed_wait_s: float = 0.2
    round_pause_s: float = 1.0


TUNING = PlayerTuning()


@dataclass(frozen=True)
class PlayOptions:
    """How to play.

    Attributes:
        rate: times the recorded speed.
        loop: begin again at the end, until interrupted.
        endless: begin again with later stamps, as one stream that goes on, until interrupted.
        start_s: seconds of the recording to leave out; what is latched in them is published nonetheless.
        clock: publish /clock with the recording's time.
        everything: also what a tracker has put out.
        wait_s: wait this long for subscribers; 0 does not wait.
        insist: play nothing where they have not come by then; else it is said, and played all the same.
        subscribers: how many each image topic must have before the first message.
    """

    rate: float = 1.0
    loop: bool = False
    endless: bool = False
    start_s: float = 0.0
    clock: bool = False
    everything: bool = False
    wait_s: float = 0.0
    insist: bool = True
    subscribers: int = 1


@dataclass
class PlaySummary:
    """What was played.

    Attributes:
        published: number of messages by topic.
        seconds: how long it took.
        latest_s: the furthest that a message was behind its time.
        unacknowledged: topics of which a subscriber did not confirm everything.
        unknown: topics left out because their message type is not installed.
        damage: what is wrong with the file, if part of it could not be read.
    """

    published: dict[str, int] = field(default_factory=dict)
    seconds: float = 0.0
    latest_s: float = 0.0
    unacknowledged: list[str] = field(default_factory=list)
    unknown: list[str] = field(default_factory=list)
    damage: str | None = None


def round_period_ns(reader: RecordingReader) -> int:
    """How much later a recording's stamps are in each round of an endless stream, nanoseconds."""
    first_ns, last_ns = reader.time_span_ns
    return last_ns - first_ns + round(TUNING.round_pause_s * NANOSECONDS)


class Player:
    """Publishes the messages as they were recorded, byte by byte (but for later stamps): nothing is decoded on the way.

    Args:
        reader: the recording.
        options: how to play it.
        interrupted: set it to end early.
        show: told after each message how many were published.
        say: told who is waited for, and who did not come.
    """

    def __init__(
        self,
        reader: RecordingReader,
        options: PlayOptions,
        interrupted: threading.Event,
        show: Callable[[int], None] = lambda count: None,
        say: Callable[[str], None] = lambda text: None,
    ) -> None:
        self._show, self._say = show, say
        self._reader = reader
        self._options = options
        self._interrupted = interrupted
        self._summary = PlaySummary()
        self._node: Node = rclpy.create_node("lasso_player", enable_rosout=False, start_parameter_services=False)
        self._latched = LATCHED_NAMES | reader.latched_topics
        self._publishers: dict[str, Publisher] = {}
        self._stamped: set[str] = set()
        self._later_ns = 0
        for topic, type_name in reader.topics.items():
            if topic in OUTPUT_NAMES and not options.everything:
                continue
            message_class = message_class_of(type_name)
            if message_class is None:
                self._summary.unknown.append(topic)
                continue
            if is_stamped(message_class):
                self._stamped.add(topic)
            self._publishers[topic] = self._node.create_publisher(
                message_class, topic, qos(depth=TUNING.depth, latched=topic in self._latched)
            )
        if not self._publishers:
            raise RecordingError(f"{reader.path}: no topic to play")
        self._clock = self._node.create_publisher(Clock, "/clock", qos(depth=1)) if options.clock else None

    def wait_for_subscribers(self) -> None:
        """Wait until the image topics have the subscribers asked for, and every other input as well has one.

        A subscriber that is discovered after a message has gone out never hears it, and a recording's clicks go out
        with its first images. Time on /clock stands still meanwhile, at the first message.

        Raises:
            RecordingError: they have not come in time, and the options insist on them.
        """
        began, wait_s = time.monotonic(), self._options.wait_s
        told = False
        start_ns = self._reader.time_span_ns[0] + round(self._options.start_s * NANOSECONDS) if self._clock else 0
        awaited = AwaitedSubscribers(self._node, self._publishers, self._latched, self._options.subscribers)
        while missing := awaited.missing():
            waited_s = time.monotonic() - began
            if waited_s > wait_s:
                fault = f"no subscriber on {', '.join(missing)} within {wait_s:g} s"
                if self._options.insist:
                    raise RecordingError(fault)
                self._say(f"{fault}: played without")
                return
            if waited_s > TUNING.silent_wait_s and not told:
                self._say(f"waiting for subscribers on {', '.join(missing)}, {wait_s:g} s at most")
                told = True
            if self._clock is not None:
                self._clock.publish(_clock_message(start_ns))
            if self._interrupted.wait(TUNING.look_period_s):
                return
        if told:
            self._say("they are there: playing")

    def play(self) -> PlaySummary:
        """Play to the end, or until interrupted, and wait until every subscriber has acknowledged everything."""
        began = time.monotonic()
        while True:
            self._play_once()
            if not (self._options.loop or self._options.endless) or self._interrupted.is_set():
                break
            if self._options.endless:
                self._later_ns += round_period_ns(self._reader) - round(self._options.start_s * NANOSECONDS)
                self._interrupted.wait(TUNING.round_pause_s / self._options.rate)
        self._summary.seconds = time.monotonic() - began
        self._summary.damage = self._reader.damage
        if not self._interrupted.is_set():
            for topic, publisher in self._publishers.items():
                if not publisher.wait_for_all_acked(Duration(seconds=TUNING.acknowledge_wait_s)):
                    self._summary.unacknowledged.append(topic)
        return self._summary

    def close(self) -> None:
        """Take the publishers down."""
        self._node.destroy_node()

    def _play_once(self) -> None:
        began: float | None = None
        start_ns: int | None = None
        with ReadAhead(self._reader.raw_messages(list(self._publishers)), TUNING.read_ahead) as messages:
            for message in messages:
                if self._interrupted.is_set():
                    return
                if start_ns is None:
                    start_ns = message.log_time_ns + round(self._options.start_s * NANOSECONDS)
                if message.log_time_ns < start_ns:
                    if message.topic in self._latched:
                        self._publish(message)
                    continue
                # Time begins here: what lies before has been skipped as fast as it could be read.
                began = time.monotonic() if began is None else began
                due = began + (message.log_time_ns - start_ns) / NANOSECONDS / self._options.rate
                self._wait_until(due, message.log_time_ns + self._later_ns)
                if self._interrupted.is_set():
                    return
                self._publish(message)
                self._summary.latest_s = max(self._summary.latest_s, time.monotonic() - due)
                self._show(sum(self._summary.published.values()))
        if start_ns is None:
            raise RecordingError(f"{self._reader.path}: no message to play")
        if began is None:
            raise RecordingError(
                f"{self._reader.path}: nothing is left to play {self._options.start_s:g} s after its first message"
            )

    def _wait_until(self, due: float, recorded_ns: int) -> None:
        while not self._interrupted.is_set():
            left = due - time.monotonic()
            if self._clock is not None:
                now_ns = recorded_ns - round(max(left, 0.0) * self._options.rate * NANOSECONDS)
                self._clock.publish(_clock_message(now_ns))
                left = min(left, TUNING.clock_period_s)
            if left <= 0.0 or self._interrupted.wait(left):
                return
            if self._clock is None:
                return

    def _publish(self, message: RawMessage) -> None:
        if message.topic in SEED_NAMES:
            # Clicks are small and would overtake their image; at the start of another round they would then be taken
            # for clicks on the last round's, which has the same stamp.
            for image in IMAGE_NAMES & self._publishers.keys():
                self._publishers[image].wait_for_all_acked(Duration(seconds=TUNING.seed_wait_s))
        later = self._later_ns and message.topic in self._stamped
        data = with_later_stamp(message.data, self._later_ns) if later else message.data
        self._publishers[message.topic].publish(data)
        self._summary.published[message.topic] = self._summary.published.get(message.topic, 0) + 1


def play(
    reader: RecordingReader,
    options: PlayOptions,
    interrupted: threading.Event,
    show: Callable[[int], None] = lambda count: None,
    say: Callable[[str], None] = lambda text: None,
) -> PlaySummary:
    """Play a recording in this process.

    Args:
        reader: the recording.
        options: how.
        interrupted: set it to end early.
        show: told after each message how many were published.
        say: told why images may be lost, who is waited for, and who did not come.

    Raises:
        RecordingError: nothing in it to play, or no subscriber in time where one is insisted on.
    """
    with ros_session() as warning:
        if warning:
            say(warning)
        player = Player(reader, options, interrupted, show, say)
        try:
            if options.wait_s > 0.0:
                player.wait_for_subscribers()
            return player.play()
        finally:
            player.close()


def _clock_message(now_ns: int) -> Clock:
    message = Clock()
    stamp = ns_to_stamp(now_ns)
    message.clock.sec, message.clock.nanosec = stamp["sec"], stamp["nanosec"]
    return message
