"""Reads recordings: MCAP files, bag directories, split bags; whole ones, and those cut short or corrupt."""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from mcap.records import Message, Schema

from lasso_motion_ros.core.errors import ConfigurationError, RecordingError
from lasso_motion_ros.core.plain_yaml import parse_plain_yaml
from msg_adapters.recordings.bag_files import recording_files
from msg_adapters.recordings.cdr_decoder import CdrDecoder
from msg_adapters.recordings.mcap_file import McapFile
from msg_adapters.recordings.tracking_topics import found_topics

# Unpacked messages held while waiting for their turn in time. Chunks that overlap more than this (writers put
# messages down nearly in order) come out in file order instead of filling the memory.
_BUFFER_BYTES = 256 << 20


@dataclass(frozen=True)
class RawMessage:
    """An undecoded message: CDR bytes, times in nanoseconds, the topic after remapping."""

    topic: str
    type_name: str
    log_time_ns: int
    publish_time_ns: int
    data: bytes


@dataclass(frozen=True)
class RecordedMessage:
    """A decoded message: a dataclass with the message's fields."""

    topic: str
    type_name: str
    log_time_ns: int
    message: Any


class RecordingReader:
    """A recording, streamed in log-time order with bounded memory.

    Needs neither footer nor index: of a file cut short, every complete message is read, and `damage` then says what is
    wrong. Messages of equal log time keep their stored order.

    Args:
        path: an MCAP file, or a bag directory (with its `metadata.yaml`, or without, as a crashed recorder
            leaves it).
        remap: recorded topic → the name it is given here.

    Raises:
        RecordingError: nothing there, not MCAP, nothing readable in it, or a remapping that does not fit.
    """

    def __init__(self, path: str | Path, remap: Mapping[str, str] | None = None) -> None:
        self.path = Path(path)
        self.damage: str | None = None
        self._files = [McapFile(file) for file in recording_files(self.path)]
        for file in self._files:
            self._note_damage(file, file.layout.damage)
        self._names = self._remapped(dict(remap or {}))
        self._decoder = CdrDecoder()

    @property
    def topics(self) -> dict[str, str]:
        """Topic (after remapping) → message type."""
        return {self._name(topic): schema.name for topic, schema in self._recorded_topics().items()}

    @property
    def latched_topics(self) -> frozenset[str]:
        """Topics (after remapping) that were offered with transient-local durability."""
        return self._offered("durability", (1, "transient_local"))

    @property
    def best_effort_topics(self) -> frozenset[str]:
        """Topics (after remapping) that were offered with best-effort reliability."""
        return self._offered("reliability", (2, "best_effort"))

    @property
    def files(self) -> tuple[Path, ...]:
        """The MCAP files it consists of."""
        return tuple(file.path for file in self._files)

    @property
    def time_span_ns(self) -> tuple[int, int]:
        """First and last log time, nanoseconds.

        Raises:
            RecordingError: there is no message.
        """
        segments = [segment for file in self._files for segment in file.layout.segments]
        if not segments:
            raise RecordingError(f"{self.path} has no messages")
        return min(s.start_ns for s in segments), max(s.end_ns for s in segments)

    def raw_messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """All messages, or those on some topics, undecoded, in log-time order; `damage` is complete afterwards."""
        wanted = None if topics is None else set(topics)
        for file, stored in self._stored(wanted):
            channel, schema = file.known[stored.channel_id]
            yield RawMessage(self._name(channel.topic), schema.name, stored.log_time, stored.publish_time, stored.data)

    def messages(self, topics: Collection[str] | None = None) -> Iterator[RecordedMessage]:
        """All messages, or those on some topics, decoded, in log-time order; `damage` is complete afterwards.

        Raises:
            RecordingError: a message that is not CDR, or of a type whose definition cannot be read.
        """
        wanted = None if topics is None else set(topics)
        for file, stored in self._stored(wanted):
            channel, schema = file.known[stored.channel_id]
            try:
                message = self._decoder.decode(channel, schema, stored.data)
            except RecordingError as error:
                raise RecordingError(f"{file.path}: {error}") from error
            if message is None:
                self._note_damage(file, f"a message on {channel.topic} cannot be decoded and was left out")
                continue
            yield RecordedMessage(self._name(channel.topic), schema.name, stored.log_time, message)

    def definition(self, topic: str) -> str:
        """The ros2msg text of a topic's type, as recorded."""
        for recorded, schema in self._recorded_topics().items():
            if self._name(recorded) == topic:
                return str(schema.data, "utf-8", "replace")
        raise RecordingError(f"{self.path} has no topic {topic}")

    def _offered(self, policy: str, values: tuple[int, str]) -> frozenset[str]:
        return frozenset(
            self._name(channel.topic)
            for file in self._files
            for channel, _ in file.known.values()
            if _offers(channel.metadata.get("offered_qos_profiles", ""), policy, values)
        )

    def _recorded_topics(self) -> dict[str, Schema]:
        found: dict[str, Schema] = {}
        for file in self._files:
            for channel, schema in file.known.values():
                if found.setdefault(channel.topic, schema).name != schema.name:
                    raise RecordingError(
                        f"{self.path}: {channel.topic} has two types, {found[channel.topic].name} and {schema.name}"
                    )
        return found

    def _remapped(self, remap: dict[str, str]) -> dict[str, str]:
        recorded = self._recorded_topics()
        names: dict[str, str] = {}
        for old, new in remap.items():
            if _absolute(old) not in recorded:
                raise RecordingError(
                    f"remap {old}:={new}: {self.path} has no topic {_absolute(old)}{found_topics(recorded)}"
                )
            names[_absolute(old)] = _absolute(new)
        # A topic whose name another one takes over steps aside, unless it was itself given a new name.
        taken = set(names.values())
        if len(taken) != len(names):
            raise RecordingError("remap: two topics were given one name")
        for topic in recorded:
            names.setdefault(topic, topic if topic not in taken else f"{topic}_recorded")
        return names

    def _name(self, topic: str) -> str:
        """The name given to a recorded topic (of a spoilt file, one may turn up that was not known at first)."""
        return self._names.get(topic, topic)

    def _note_damage(self, file: McapFile, text: str | None) -> None:
        if text is not None and self.damage is None:
            self.damage = f"{file.path}: {text}; what could be read was used"

    def _stored(self, wanted: set[str] | None) -> Iterator[tuple[McapFile, Message]]:
        """Messages of all files in log-time order; each file's segments are unpacked when their time has come."""
        segments = sorted(
            (
                (segment.start_ns, number, place)
                for number, file in enumerate(self._files)
                for place, segment in enumerate(file.layout.segments)
            ),
            reverse=True,
        )
        waiting: list[tuple[int, int, int, int, Message]] = []
        held = 0
        streams: dict[int, BinaryIO] = {}
        try:
            while segments or waiting:
                if segments and (not waiting or (segments[-1][0] <= waiting[0][0] and held < _BUFFER_BYTES)):
                    _, number, place = segments.pop()
                    file = self._files[number]
                    if number not in streams:
                        streams[number] = file.path.open("rb")
                    messages, damage = file.read(streams[number], file.layout.segments[place])
                    self._note_damage(file, damage)
                    for order, stored in enumerate(messages):
                        if wanted is None or self._name(file.known[stored.channel_id][0].topic) in wanted:
                            heapq.heappush(waiting, (stored.log_time, number, place, order, stored))
                            held += len(stored.data)
                    continue
                _, number, _, _, stored = heapq.heappop(waiting)
                held -= len(stored.data)
                yield self._files[number], stored
        except OSError as error:
            raise RecordingError(f"{self.path} cannot be read: {error.strerror}") from error
        finally:
            for stream in streams.values():
                stream.close()


def _offers(profiles: str, policy: str, values: tuple[int, str]) -> bool:
    """Whether the recorded QoS has a policy's value, as a number (rosbag2 before Jazzy) or by name."""
    try:
        return any(profile[policy] in values for profile in parse_plain_yaml(profiles) or ())
    except (ConfigurationError, KeyError, TypeError):
        return False


def _absolute(topic: str) -> str:
    return topic if topic.startswith("/") else "/" + topic
