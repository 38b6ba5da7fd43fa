"""Reads recordings: MCAP files, bag directories, split bags; whole ones, and those cut short or corrupt."""

from __future__ import annotations

import heapq
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from mcap.records import Channel, Message, Schema
from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore

from lasso_motion_ros.core.errors import ConfigurationError, RecordingError
from lasso_motion_ros.core.plain_yaml import parse_plain_yaml, read_plain_yaml
from lasso_motion_ros.geometry.frames import PLANES
from msg_adapters.messages import jazzy_types
from msg_adapters.recordings.mcap_layout import FileLayout, Segment, walk_file
from msg_adapters.recordings.mcap_records import (
    CHANNEL,
    MESSAGE,
    SCHEMA,
    parse_channel,
    parse_message,
    parse_schema,
)
from msg_adapters.recordings.mcap_segments import read_segment
from msg_adapters.topics import camera_info_topic, compressed_image_topic, image_topic

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

    Neither footer nor index is needed: of a file cut short, every message that is whole is given, and then
    `damage` says what is wrong. Messages of equal log time keep their stored order.

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
        self._files = [_File(file) for file in _recording_files(self.path)]
        for file in self._files:
            self._note_damage(file, file.layout.damage)
        self._names = self._remapped(dict(remap or {}))
        self._decoder = _Decoder()

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
                raise RecordingError(f"remap {old}:={new}: {self.path} has no topic {_absolute(old)}{_found(recorded)}")
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

    def _note_damage(self, file: _File, text: str | None) -> None:
        if text is not None and self.damage is None:
            self.damage = f"{file.path}: {text}; what could be read was used"

    def _stored(self, wanted: set[str] | None) -> Iterator[tuple[_File, Message]]:
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


class _File:
    """One MCAP file: its layout and the channels known so far."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.layout: FileLayout = walk_file(path)
        self._schemas = dict(self.layout.schemas)
        self.known: dict[int, tuple[Channel, Schema]] = {}
        for channel in self.layout.channels.values():
            self._learn(channel)
        if not (self.layout.has_summary and self.known):
            # No summary that repeats the channels: they stand in the chunks.
            with path.open("rb") as stream:
                for segment in self.layout.segments:
                    self.read(stream, segment)

    def read(self, stream: BinaryIO, segment: Segment) -> tuple[list[Message], str | None]:
        """The messages of one segment, in log-time order, and what is wrong with it or None."""
        records, damage = read_segment(stream, segment)
        messages: list[Message] = []
        for opcode, content in records:
            try:
                if opcode == SCHEMA:
                    schema = parse_schema(content)
                    self._schemas[schema.id] = schema
                elif opcode == CHANNEL:
                    self._learn(parse_channel(content))
                elif opcode == MESSAGE:
                    message = parse_message(content)
                    if message.channel_id in self.known:
                        messages.append(message)
                    else:
                        damage = damage or f"messages of the unknown channel {message.channel_id} were left out"
            except ValueError as error:
                damage = damage or f"a chunk at byte {segment.offset}: {error}"
        return messages, damage

    def _learn(self, channel: Channel) -> None:
        schema = self._schemas.get(channel.schema_id)
        if schema is not None:
            # The first to be read holds, so that a spoilt repetition changes nothing.
            self.known.setdefault(channel.id, (channel, schema))


class _Decoder:
    """CDR to message objects; types that ROS 2 Jazzy does not have are learnt from the recording."""

    def __init__(self) -> None:
        self._types: Typestore = jazzy_types()
        self._checked: set[str] = set()

    def decode(self, channel: Channel, schema: Schema, data: bytes) -> Any:
        """The message, or None where its bytes are not one."""
        if channel.message_encoding != "cdr":
            raise RecordingError(f"{channel.topic}: expected messages in cdr, found {channel.message_encoding!r}")
        if schema.name not in self._checked:
            self._learn(schema)
            self._checked.add(schema.name)
        try:
            return self._types.deserialize_cdr(data, schema.name)
        except Exception:  # whatever the deserialiser stumbles over, the bytes are not such a message
            return None

    def _learn(self, schema: Schema) -> None:
        if schema.name in self._types.fielddefs:
            return
        try:
            found = get_types_from_msg(schema.data.decode("utf-8"), schema.name)
            self._types.register({name: fields for name, fields in found.items() if name not in self._types.fielddefs})
        except Exception as error:
            raise RecordingError(f"the definition of {schema.name} cannot be read: {error}") from error


def check_tracking_topics(recording: Path, topics: Mapping[str, str], calibrated: bool = False) -> None:
    """Check that a recording has what tracking needs in both planes: images and calibration.

    Args:
        recording: its path, for the error.
        topics: topic → type, as `RecordingReader.topics`.
        calibrated: the calibration comes from elsewhere.

    Raises:
        RecordingError: names what is missing, what has another type, and what is there instead.
    """
    missing: list[str] = []
    for plane in PLANES:
        image, compressed = image_topic(plane), compressed_image_topic(plane)
        if topics.get(compressed.recorded_name) != compressed.type_name:
            missing += _missing(topics, image.recorded_name, image.type_name)
        if not calibrated:
            info = camera_info_topic(plane)
            missing += _missing(topics, info.recorded_name, info.type_name)
    if missing:
        raise RecordingError(f"{recording} lacks {', '.join(missing)}{_found(topics)}; --remap a:=b renames topics")


def _missing(topics: Mapping[str, str], name: str, type_name: str) -> list[str]:
    found = topics.get(name)
    if found == type_name:
        return []
    return [f"{name} ({type_name})" if found is None else f"{name} as {type_name} (it is {found})"]


def _found(topics: Collection[str]) -> str:
    names = sorted(topics)
    shown = ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
    return f"; it has {shown}" if names else "; it has no topics"


def _offers(profiles: str, policy: str, values: tuple[int, str]) -> bool:
    """Whether the recorded QoS has a policy's value, as a number (rosbag2 before Jazzy) or by name."""
    try:
        return any(profile[policy] in values for profile in parse_plain_yaml(profiles) or ())
    except (ConfigurationError, KeyError, TypeError):
        return False


def _absolute(topic: str) -> str:
    return topic if topic.startswith("/") else "/" + topic


def _recording_files(path: Path) -> list[Path]:
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise RecordingError(f"{path}: there is no such recording")
    listed = _listed_files(path)
    if not listed:
        listed = sorted(path.glob("*.mcap"), key=_natural_order)
    if not listed:
        raise RecordingError(f"{path}: a directory without .mcap files is not a recording")
    for file in listed:
        if not file.is_file():
            raise RecordingError(f"{file} is missing, though metadata.yaml lists it")
    return listed


def _listed_files(directory: Path) -> list[Path]:
    """What `metadata.yaml` lists; nothing where it is missing or not readable (a recorder that crashed)."""
    metadata = directory / "metadata.yaml"
    if not metadata.is_file():
        return []
    try:
        information = read_plain_yaml(metadata)["rosbag2_bagfile_information"]
        storage, names = information["storage_identifier"], [str(name) for name in information["relative_file_paths"]]
        mode = str(information.get("compression_mode") or "").upper()
    except (ConfigurationError, KeyError, TypeError, AttributeError):
        return []
    if storage != "mcap":
        raise RecordingError(f"{directory}: storage {storage!r} is not read; convert it with: ros2 bag convert")
    if mode not in ("", "NONE"):
        raise RecordingError(f"{directory}: rosbag2's own {mode} compression is not read; convert it: ros2 bag convert")
    return [directory / name for name in names]


def _natural_order(path: Path) -> list[tuple[int, str]]:
    """Sorts `bag_10.mcap` behind `bag_9.mcap`."""
    return [(int(part), "") if part.isdigit() else (0, part) for part in re.split(r"(\d+)", path.name)]
