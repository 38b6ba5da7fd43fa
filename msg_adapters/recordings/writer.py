"""Writes MCAP recordings that rosbag2, the mcap tools and Foxglove read."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import Any

import yaml
from mcap.writer import CompressionType, Writer

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.core.output_checks import check_free
from lasso_motion_ros.core.output_files import UnfinishedFile, cannot_write, is_device
from msg_adapters.recorded_messages import RecordedMessages, jazzy_types

LIBRARY = "lasso_motion_ros"
_COMPRESSIONS = {"zstd": CompressionType.ZSTD, "none": CompressionType.NONE}
# Durations of "no limit", as rmw writes them.
_INFINITE = {"sec": 9223372036, "nsec": 854775807}
# Version 8 has QoS policies as numbers, which Humble to Jazzy and later all read.
_METADATA_VERSION = 8


class _WrittenTopic:
    """One topic of the file being written."""

    def __init__(self, channel_id: int, topic: str, type_name: str, qos: str) -> None:
        self.id = channel_id
        self.topic = topic
        self.type_name = type_name
        self.qos = qos
        self.count = 0


class RecordingWriter:
    """An MCAP file being written: profile `ros2`, schemas `ros2msg`, CDR, indexed chunks, rosbag2 metadata.

    The same input gives the same bytes. Use it as a context manager: leaving it finishes the file, so that what
    was written before an error stays readable, unless `whole` is set.

    Args:
        path: the file to write.
        compression: of the chunks, `zstd` or `none`.
        overwrite: whether an existing file is replaced.
        whole: all or nothing: the file is written under another name and moved into place at the end. After an error,
            an earlier file is still there.

    Raises:
        RecordingError: the file exists and may not be overwritten, or cannot be created.
    """

    def __init__(
        self, path: str | Path, compression: str = "zstd", overwrite: bool = False, *, whole: bool = False
    ) -> None:
        self.path = Path(path)
        if compression not in _COMPRESSIONS:
            raise RecordingError(f"compression must be one of {', '.join(_COMPRESSIONS)}, found {compression!r}")
        if self.path.is_dir():
            raise RecordingError(f"{self.path} is a directory: expected the name of a file to write")
        check_free(self.path, overwrite)
        self._unfinished = UnfinishedFile(self.path) if whole else None
        try:
            if self._unfinished is not None:
                self._file = self._unfinished.path.open("wb")
            else:
                self._file = self.path.open("wb" if overwrite or is_device(self.path) else "xb")
        except OSError as error:
            raise cannot_write(self.path, error) from error
        self._writer = Writer(self._file, compression=_COMPRESSIONS[compression])
        self._writer.start(profile="ros2", library=LIBRARY)
        self._messages = RecordedMessages()
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, _WrittenTopic] = {}
        self._first_ns: int | None = None
        self._last_ns = 0
        self._closed = False

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None and self._unfinished is not None:
            self._closed = True
            self._discard(self._unfinished)
        else:
            self.close()

    def write(
        self,
        topic: str,
        type_name: str,
        message: Any,
        log_time_ns: int,
        *,
        publish_time_ns: int | None = None,
        latched: bool = False,
    ) -> None:
        """Append one message.

        Args:
            topic: absolute topic name.
            type_name: `package/msg/Name`.
            message: a message of `RecordedMessages`, or a mapping of its fields.
            log_time_ns: log time, nanoseconds.
            publish_time_ns: publish time; the log time if None.
            latched: the topic's durability is transient local (taken from its first message).

        Raises:
            MessageError: an unknown type or field.
            RecordingError: one topic with two types, or the disk is full.
        """
        if isinstance(message, Mapping):
            message = self._messages.make(type_name, message)
        data = jazzy_types().serialize_cdr(message, type_name)
        self.write_raw(topic, type_name, bytes(data), log_time_ns, publish_time_ns=publish_time_ns, latched=latched)

    def write_raw(
        self,
        topic: str,
        type_name: str,
        data: bytes,
        log_time_ns: int,
        *,
        publish_time_ns: int | None = None,
        latched: bool = False,
        reliable: bool = True,
        definition: str | None = None,
    ) -> None:
        """Append one message that is already CDR.

        Args:
            topic: absolute topic name.
            type_name: `package/msg/Name`.
            data: the message.
            log_time_ns: log time, nanoseconds.
            publish_time_ns: publish time; the log time if None.
            latched: the topic's durability is transient local (taken from its first message).
            reliable: the topic is offered reliably (taken from its first message).
            definition: ros2msg text of the type, where it is not one of Jazzy's.

        Raises:
            RecordingError: an unknown type without its definition, one topic with two types, or the disk is full.
        """
        if log_time_ns < 0:
            raise RecordingError(f"{topic}: a log time before 1970 cannot be recorded: {log_time_ns} ns")
        channel = self._channels.get(topic) or self._add_channel(topic, type_name, latched, reliable, definition)
        if channel.type_name != type_name:
            raise RecordingError(f"{topic} is {channel.type_name} in {self.path}, a {type_name} does not fit")
        published = log_time_ns if publish_time_ns is None else publish_time_ns
        try:
            self._writer.add_message(channel.id, log_time_ns, data, published, channel.count)
        except OSError as error:
            raise cannot_write(self.path, error) from error
        channel.count += 1
        self._first_ns = log_time_ns if self._first_ns is None else min(self._first_ns, log_time_ns)
        self._last_ns = max(self._last_ns, log_time_ns)

    def write_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Append a metadata record, which `mcap list metadata` shows.

        Args:
            name: of the record.
            values: what it holds.

        Raises:
            RecordingError: the disk is full.
        """
        try:
            self._writer.add_metadata(name, dict(values))
        except OSError as error:
            raise cannot_write(self.path, error) from error

    def flush(self) -> None:
        """End the chunk in progress and hand everything to the operating system.

        What was appended before is then read back even if this process is killed; a machine that loses power may
        still lose what the system has not yet put on the disk.

        Raises:
            RecordingError: the disk is full.
        """
        try:
            self._writer.flush()
        except OSError as error:
            raise cannot_write(self.path, error) from error

    @property
    def counts(self) -> dict[str, int]:
        """Messages appended so far, by topic."""
        return {channel.topic: channel.count for channel in self._channels.values()}

    def close(self) -> None:
        """Finish the file: last chunk, metadata, indexes, footer.

        Raises:
            RecordingError: the disk is full.
        """
        if self._closed:
            return
        self._closed = True
        try:
            self._writer.add_metadata("rosbag2", {"serialized_metadata": self._bag_metadata()})
            self._writer.finish()
            self._file.close()
        except OSError as error:
            if self._unfinished is not None:
                self._discard(self._unfinished)
            raise cannot_write(self.path, error) from error
        if self._unfinished is not None:
            self._unfinished.finish()

    def _discard(self, unfinished: UnfinishedFile) -> None:
        with suppress(OSError):  # the file is thrown away: a full disk does not matter any more
            self._file.close()
        unfinished.discard()

    def _add_channel(
        self, topic: str, type_name: str, latched: bool, reliable: bool, definition: str | None
    ) -> _WrittenTopic:
        schema = self._schemas.get(type_name)
        if schema is None:
            text = definition if definition is not None else _definition(type_name)
            schema = self._writer.register_schema(type_name, "ros2msg", text.encode())
            self._schemas[type_name] = schema
        qos = _qos(latched, reliable)
        metadata = {"offered_qos_profiles": qos, "topic_type_hash": _type_hash(type_name)}
        channel = _WrittenTopic(self._writer.register_channel(topic, "cdr", schema, metadata), topic, type_name, qos)
        self._channels[topic] = channel
        return channel

    def _bag_metadata(self) -> str:
        """What rosbag2 writes into its `metadata.yaml`, for this one file."""
        start = self._first_ns or 0
        span = {"nanoseconds": self._last_ns - start}
        count = sum(channel.count for channel in self._channels.values())
        topics = [
            {
                "topic_metadata": {
                    "name": channel.topic,
                    "type": channel.type_name,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": channel.qos,
                    "type_description_hash": _type_hash(channel.type_name),
                },
                "message_count": channel.count,
            }
            for channel in self._channels.values()
        ]
        document = {
            "version": _METADATA_VERSION,
            "storage_identifier": "mcap",
            "relative_file_paths": [self.path.name],
            "duration": span,
            "starting_time": {"nanoseconds_since_epoch": start},
            "message_count": count,
            "topics_with_message_count": topics,
            "compression_format": "",
            "compression_mode": "",
            "files": [
                {
                    "path": self.path.name,
                    "starting_time": {"nanoseconds_since_epoch": start},
                    "duration": dict(span),
                    "message_count": count,
                }
            ],
            "custom_data": None,
            "ros_distro": "jazzy",
        }
        return yaml.safe_dump(document, sort_keys=False, width=1 << 20)


def _definition(type_name: str) -> str:
    types = jazzy_types()
    if type_name not in types.fielddefs:
        raise RecordingError(f"message type {type_name} is not known: it cannot be recorded")
    return types.generate_msgdef(type_name, ros_version=2)[0]


def _type_hash(type_name: str) -> str:
    types = jazzy_types()
    return types.hash_rihs01(type_name) if type_name in types.fielddefs else ""


@cache
def _qos(latched: bool, reliable: bool) -> str:
    """`offered_qos_profiles` of a topic: keep last; rmw's numbers."""
    profile = {
        "history": 1,
        "depth": 1 if latched else 10,
        "reliability": 1 if reliable else 2,
        "durability": 1 if latched else 2,
        "deadline": _INFINITE.copy(),
        "lifespan": _INFINITE.copy(),
        "liveliness": 1,
        "liveliness_lease_duration": _INFINITE.copy(),
        "avoid_ros_namespace_conventions": False,
    }
    return yaml.safe_dump([profile], sort_keys=False)
