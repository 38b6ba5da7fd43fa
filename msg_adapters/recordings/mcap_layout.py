"""Where the messages of an MCAP file lie, found without its footer, so that files cut short are read too.

A file is walked record by record; chunks are noted by place and time span and unpacked only when their turn comes.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.records import Channel, Schema

from lasso_motion_ros.core.errors import RecordingError
from msg_adapters.recordings.mcap_records import (
    CHANNEL,
    CHUNK,
    CHUNK_INDEX,
    DATA_END,
    FOOTER,
    FOOTER_BYTES,
    MAGIC,
    MESSAGE,
    MESSAGE_HEAD,
    PREFIX,
    SCHEMA,
    WholeReads,
    is_known_opcode,
    parse_channel,
    parse_chunk_index,
    parse_footer,
    parse_schema,
    split_records,
)

# What a chunk, a schema or the summary may hold: rosbag2 and the mcap tools write chunks of 0.8 to 8 MB, the
# largest image has 128 MB.
MAX_CHUNK_BYTES = 192 << 20
# Messages outside chunks are taken in runs of this size, so that memory stays bounded.
_RUN_BYTES = 8 << 20
_CRC_BYTES = 4
_LONGEST_COMPRESSION_NAME = 64


@dataclass(frozen=True)
class Segment:
    """A chunk, or a run of messages outside chunks.

    Attributes:
        offset: place of its records (or of the compressed data) in the file, bytes.
        size: bytes there.
        start_ns: smallest log time in it.
        end_ns: largest log time in it.
        compression: of a chunk; None for a run.
        unpacked_size: bytes after unpacking.
        crc: of the unpacked bytes, 0 if not given.
        complete: whether all of it is in the file.
    """

    offset: int
    size: int
    start_ns: int
    end_ns: int
    compression: str | None
    unpacked_size: int
    crc: int
    complete: bool


@dataclass
class FileLayout:
    """Where everything in a file lies.

    Attributes:
        segments: where messages lie, in file order.
        schemas: schemas seen outside chunks, by id.
        channels: channels seen outside chunks (a complete file repeats them all there), by id.
        damage: what is wrong with the file, or None.
        has_summary: whether the end of the data was reached, so that the summary's channels are known.
    """

    segments: list[Segment] = field(default_factory=list)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    damage: str | None = None
    has_summary: bool = False

    def learn(self, opcode: int, content: bytes) -> None:
        """Take a schema or channel record; any other is passed over.

        Raises:
            ValueError: the record cannot be read.
        """
        if opcode == SCHEMA:
            schema = parse_schema(content)
            self.schemas[schema.id] = schema
        elif opcode == CHANNEL:
            channel = parse_channel(content)
            self.channels[channel.id] = channel


def walk_file(path: Path) -> FileLayout:
    """Walk through a file, record by record, without unpacking anything.

    Raises:
        RecordingError: the file cannot be opened, or is no MCAP file.
    """
    layout = FileLayout()
    try:
        with path.open("rb") as stream:
            size = stream.seek(0, 2)
            stream.seek(0)
            if stream.read(len(MAGIC)) != MAGIC:
                raise RecordingError(f"{path} is not an MCAP recording (its first bytes are another format's)")
            chunks = _walk(stream, size, layout)
            if layout.damage is not None:
                layout.has_summary = False
                _rejoin(stream, size, layout, chunks)
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from error
    return layout


def _walk(stream: BinaryIO, size: int, layout: FileLayout) -> set[int]:
    """Go from record to record as far as it goes; returns the places of the chunks passed."""
    chunks: set[int] = set()
    run = _Run(layout)
    while True:
        place = stream.tell()
        prefix = stream.read(PREFIX.size)
        if len(prefix) < PREFIX.size:
            layout.damage = f"it ends at byte {place} without its closing record"
            break
        opcode, length = PREFIX.unpack(prefix)
        body = place + PREFIX.size
        end = body + length
        complete = end <= size
        if opcode == MESSAGE and complete:
            if length >= MESSAGE_HEAD.size:
                run.add(place, end, MESSAGE_HEAD.unpack(stream.read(MESSAGE_HEAD.size))[2])
            stream.seek(end)
            continue
        run.close()
        if not is_known_opcode(opcode):
            layout.damage = f"from byte {place} of {size} on it is not readable"
            break
        if opcode == CHUNK:
            _note_chunk(stream, body, min(end, size), complete, layout)
            chunks.add(place)
        elif opcode in (SCHEMA, CHANNEL) and complete and length <= MAX_CHUNK_BYTES:
            try:
                layout.learn(opcode, stream.read(length))
            except ValueError:
                layout.damage = f"from byte {place} of {size} on it is not readable"
                break
        elif opcode == DATA_END:
            layout.has_summary = True
        if not complete:
            layout.damage = f"it ends at byte {size}, inside a record that goes to byte {end}"
            break
        stream.seek(end)
        if opcode == FOOTER:
            if stream.read(len(MAGIC)) != MAGIC:
                layout.damage = f"it ends at byte {size} without its closing bytes"
            break
    run.close()
    return chunks


class _Run:
    """Messages outside chunks, one behind the other; what is closed becomes a segment of the layout."""

    def __init__(self, layout: FileLayout) -> None:
        self._layout = layout
        self._offset: int | None = None
        self._end = self._first_ns = self._last_ns = 0

    def add(self, place: int, end: int, log_time: int) -> None:
        """Take the message record that lies from `place` to `end` of the file."""
        if self._offset is None or end - self._offset > _RUN_BYTES:
            self.close()
            self._offset, self._first_ns, self._last_ns = place, log_time, log_time
        self._end = end
        if log_time < self._first_ns:
            self._first_ns = log_time
        elif log_time > self._last_ns:
            self._last_ns = log_time

    def close(self) -> None:
        """End the run: another record follows."""
        if self._offset is not None:
            size = self._end - self._offset
            segment = Segment(self._offset, size, self._first_ns, self._last_ns, None, size, 0, complete=True)
            self._layout.segments.append(segment)
            self._offset = None


def _note_chunk(stream: BinaryIO, body: int, end: int, complete: bool, layout: FileLayout) -> None:
    """Note the chunk from `body` to `end` of the file; the stream stands at its beginning."""
    head = ReadDataStream(WholeReads(stream))
    try:
        start_ns, end_ns, unpacked, crc = head.read8(), head.read8(), head.read8(), head.read4()
        compression = head.read(min(head.read4(), _LONGEST_COMPRESSION_NAME)).decode("utf-8", "replace")
        packed = head.read8()
    except EOFError:
        return
    offset = body + head.count
    size = max(0, min(packed, end - offset))
    layout.segments.append(Segment(offset, size, start_ns, end_ns, compression, unpacked, crc, complete))


def _rejoin(stream: BinaryIO, size: int, layout: FileLayout, passed: set[int]) -> None:
    """Find the chunks behind a damaged place by the index at the file's end, where that is sound."""
    tail = PREFIX.size + FOOTER_BYTES + len(MAGIC)
    stream.seek(max(size - tail, 0))
    end = stream.read(tail)
    if len(end) < tail or not end.endswith(MAGIC) or PREFIX.unpack_from(end) != (FOOTER, FOOTER_BYTES):
        return
    footer = parse_footer(end[PREFIX.size :])
    start = footer.summary_start
    if not 0 < start < size - tail <= start + MAX_CHUNK_BYTES:
        return
    stream.seek(start)
    summary = stream.read(size - tail - start)
    covered = end[: PREFIX.size + FOOTER_BYTES - _CRC_BYTES]
    if footer.summary_crc and zlib.crc32(covered, zlib.crc32(summary)) != footer.summary_crc:
        return
    records = list(split_records(summary))
    try:
        for opcode, content in records:
            layout.learn(opcode, content)
        indexes = [parse_chunk_index(content) for opcode, content in records if opcode == CHUNK_INDEX]
    except ValueError:
        return
    for index in indexes:
        place, length = index.chunk_start_offset, index.chunk_length
        if place in passed or length < PREFIX.size or place + length > start:
            continue
        stream.seek(place)
        if stream.read(PREFIX.size) == PREFIX.pack(CHUNK, length - PREFIX.size):
            _note_chunk(stream, place + PREFIX.size, place + length, True, layout)
            layout.damage = "a part in its middle is not readable"
