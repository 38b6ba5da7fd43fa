"""Where the messages of an MCAP file lie, found without its footer, so that files cut short are read too.

Format: https://mcap.dev/spec. A file is walked record by record; chunks are noted by place and time span and
unpacked only when their turn comes.
"""

from __future__ import annotations

import io
import itertools
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import lz4.frame
import zstandard

from lasso_motion_ros.core.errors import RecordingError

MAGIC = b"\x89MCAP0\r\n"
SCHEMA, CHANNEL, MESSAGE = 0x03, 0x04, 0x05
_FOOTER, _CHUNK, _CHUNK_INDEX = 0x02, 0x06, 0x08
_DATA_END, _LAST_KNOWN, _FIRST_PRIVATE = 0x0F, 0x0F, 0x80
_PREFIX = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK_HEAD = struct.Struct("<QQQI")
_CHUNK_INDEX_HEAD = struct.Struct("<QQQQ")
_FOOTER_BODY = struct.Struct("<QQI")
# A run of messages outside chunks is cut here, so that it is held in memory piece by piece.
_RUN_BYTES = 8 << 20
_PIECE_BYTES = 1 << 18
# What a chunk may unpack to, and how many records may be in it; rosbag2 and the mcap tools write 0.8 to 8 MB, and the
# largest image has 128 MB.
MAX_CHUNK_BYTES = 192 << 20
MAX_CHUNK_RECORDS = 1 << 20


class Schema(NamedTuple):
    """A message definition in the file."""

    name: str
    encoding: str
    text: bytes


class Channel(NamedTuple):
    """A topic in the file."""

    schema_id: int
    topic: str
    encoding: str
    metadata: dict[str, str]


class StoredMessage(NamedTuple):
    """A message as stored: channel of the file, times in nanoseconds, undecoded bytes."""

    channel_id: int
    log_time_ns: int
    publish_time_ns: int
    data: bytes


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
    """What walking through a file found.

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
                _rejoin(stream, size, layout, chunks)
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from error
    return layout


def _walk(stream: BinaryIO, size: int, layout: FileLayout) -> set[int]:
    """Go from record to record as far as it goes; returns the places of the chunks passed."""
    chunks: set[int] = set()
    run: _Run | None = None
    while True:
        place = stream.tell()
        prefix = stream.read(_PREFIX.size)
        if len(prefix) < _PREFIX.size:
            layout.damage = f"it ends at byte {place} without its closing record"
            break
        opcode, length = _PREFIX.unpack(prefix)
        body = place + _PREFIX.size
        if opcode == 0 or _LAST_KNOWN < opcode < _FIRST_PRIVATE:
            layout.damage = f"from byte {place} of {size} on it is not readable"
            break
        complete = body + length <= size
        if opcode != MESSAGE and run is not None:
            layout.segments.append(run.segment())
            run = None
        if opcode == _CHUNK:
            _note_chunk(stream, body, min(body + length, size), complete, layout)
            chunks.add(place)
        elif opcode == MESSAGE and complete and length >= _MESSAGE_HEAD.size:
            log_time = _MESSAGE_HEAD.unpack(stream.read(_MESSAGE_HEAD.size))[2]
            if run is not None and run.size + length > _RUN_BYTES:
                layout.segments.append(run.segment())
                run = None
            run = run or _Run(place, log_time)
            run.add(body + length, log_time)
        elif opcode in (SCHEMA, CHANNEL) and complete and length <= MAX_CHUNK_BYTES:
            content = stream.read(length)
            try:
                if opcode == SCHEMA:
                    layout.schemas.update([parse_schema(content)])
                else:
                    layout.channels.update([parse_channel(content)])
            except ValueError:
                layout.damage = f"from byte {place} of {size} on it is not readable"
                break
        elif opcode == _DATA_END:
            layout.has_summary = True
        if not complete:
            layout.damage = f"it ends at byte {size}, inside a record that goes to byte {body + length}"
            break
        if opcode == _FOOTER:
            stream.seek(body + length)
            if stream.read(len(MAGIC)) != MAGIC:
                layout.damage = f"it ends at byte {size} without its closing bytes"
            break
        stream.seek(body + length)
    if run is not None:
        layout.segments.append(run.segment())
    if layout.damage is not None:
        layout.has_summary = False
    return chunks


def _rejoin(stream: BinaryIO, size: int, layout: FileLayout, passed: set[int]) -> None:
    """Find the chunks behind a damaged place by the index at the file's end, where that is sound."""
    tail = _PREFIX.size + _FOOTER_BODY.size + len(MAGIC)
    stream.seek(max(size - tail, 0))
    end = stream.read(tail)
    if len(end) < tail or not end.endswith(MAGIC) or _PREFIX.unpack_from(end) != (_FOOTER, _FOOTER_BODY.size):
        return
    start, _, crc = _FOOTER_BODY.unpack_from(end, _PREFIX.size)
    if not 0 < start < size - tail <= start + MAX_CHUNK_BYTES:
        return
    stream.seek(start)
    summary = stream.read(size - tail - start)
    if crc and zlib.crc32(end[: _PREFIX.size + _FOOTER_BODY.size - 4], zlib.crc32(summary)) != crc:
        return
    try:
        records = list(_records(summary))
        layout.schemas.update(parse_schema(content) for opcode, content in records if opcode == SCHEMA)
        layout.channels.update(parse_channel(content) for opcode, content in records if opcode == CHANNEL)
    except ValueError:
        return
    for opcode, content in records:
        if opcode != _CHUNK_INDEX or len(content) < _CHUNK_INDEX_HEAD.size:
            continue
        _, _, place, length = _CHUNK_INDEX_HEAD.unpack_from(content)
        if place in passed or place + length > start:
            continue
        stream.seek(place)
        if stream.read(_PREFIX.size) == _PREFIX.pack(_CHUNK, length - _PREFIX.size):
            _note_chunk(stream, place + _PREFIX.size, place + length, True, layout)
            layout.damage = "a part in its middle is not readable"


class _Run:
    """Messages outside chunks, one behind the other."""

    def __init__(self, offset: int, log_time: int) -> None:
        self.offset, self.size = offset, 0
        self.start, self.end = log_time, log_time

    def add(self, end: int, log_time: int) -> None:
        self.size = end - self.offset
        self.start, self.end = min(self.start, log_time), max(self.end, log_time)

    def segment(self) -> Segment:
        return Segment(self.offset, self.size, self.start, self.end, None, self.size, 0, True)


def _note_chunk(stream: BinaryIO, body: int, end: int, complete: bool, layout: FileLayout) -> None:
    """Note the chunk from `body` to `end` of the file; the stream stands at its beginning."""
    head = stream.read(_CHUNK_HEAD.size)
    name_size = stream.read(4)
    if len(head) < _CHUNK_HEAD.size or len(name_size) < 4:
        return
    start_ns, end_ns, unpacked, crc = _CHUNK_HEAD.unpack(head)
    name = stream.read(min(int.from_bytes(name_size, "little"), 64))
    packed_bytes = stream.read(8)
    if len(packed_bytes) < 8:
        return
    offset = stream.tell()
    packed = max(0, min(int.from_bytes(packed_bytes, "little"), end - offset))
    layout.segments.append(
        Segment(offset, packed, start_ns, end_ns, name.decode("utf-8", "replace"), unpacked, crc, complete)
    )


def read_segment(stream: BinaryIO, segment: Segment) -> tuple[list[tuple[int, bytes]], str | None]:
    """The records of one segment.

    Returns:
        (opcode, content) of each readable record, in stored order, and what is wrong or None. Of a chunk that
        the file's end cuts, the records before the cut are returned; of one whose content is corrupt none,
        since nothing says which of its messages are sound.
    """
    largest = max(segment.size, segment.unpacked_size)
    if largest > MAX_CHUNK_BYTES:
        return [], f"a chunk at byte {segment.offset} claims {largest} bytes, more than is sensible"
    stream.seek(segment.offset)
    data, damage = _unpack(stream.read(segment.size), segment)
    if damage is not None:
        return [], damage
    records = list(itertools.islice(_records(data), MAX_CHUNK_RECORDS + 1))
    if len(records) > MAX_CHUNK_RECORDS:
        return [], f"a chunk at byte {segment.offset} has more than {MAX_CHUNK_RECORDS} records, more than is sensible"
    if segment.complete and sum(_PREFIX.size + len(content) for _, content in records) != len(data):
        return records, f"a chunk at byte {segment.offset} ends inside a record"
    return records, None


def _records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """(opcode, content) of the whole records at the start of `data`."""
    place = 0
    while place + _PREFIX.size <= len(data):
        opcode, length = _PREFIX.unpack_from(data, place)
        place += _PREFIX.size
        if place + length > len(data):
            return
        yield opcode, data[place : place + length]
        place += length


def _unpack(packed: bytes, segment: Segment) -> tuple[bytes, str | None]:
    """A segment's records as bytes (as far as the file has them), and what is wrong or None."""
    if not segment.compression:
        data = packed
    elif segment.compression == "zstd":
        data = _unpack_zstd(packed, segment.unpacked_size)
    elif segment.compression == "lz4":
        data = _unpack_lz4(packed, segment.unpacked_size)
    else:
        return b"", f"a chunk at byte {segment.offset} has the unknown compression {segment.compression!r}"
    sound = len(data) == segment.unpacked_size and (not segment.crc or zlib.crc32(data) == segment.crc)
    if segment.complete and not sound:
        return b"", f"a chunk at byte {segment.offset} is corrupt and was left out"
    return data, None


def _unpack_zstd(packed: bytes, limit: int) -> bytes:
    """As much as can be unpacked of data that may be cut or corrupt, up to one byte more than `limit`."""
    try:
        with zstandard.ZstdDecompressor().stream_reader(packed) as reader:
            return _read_up_to(reader, limit + 1)
    except zstandard.ZstdError:
        return b""


def _unpack_lz4(packed: bytes, limit: int) -> bytes:
    """As `_unpack_zstd`."""
    with lz4.frame.LZ4FrameFile(io.BytesIO(packed)) as reader:
        return _read_up_to(reader, limit + 1)


def _read_up_to(reader: Any, limit: int) -> bytes:
    """Up to `limit` bytes, as far as they can be unpacked: their length or their checksum will tell."""
    unpacked = io.BytesIO()
    try:
        while unpacked.tell() < limit and (piece := reader.read(min(limit - unpacked.tell(), _PIECE_BYTES))):
            unpacked.write(piece)
    except (zstandard.ZstdError, RuntimeError, EOFError):
        pass
    return unpacked.getvalue()


def parse_schema(content: bytes) -> tuple[int, Schema]:
    """(id, schema) of a schema record.

    Raises:
        ValueError: the record is not one.
    """
    cursor = _Cursor(content)
    return cursor.number(2), Schema(cursor.text(), cursor.text(), cursor.block())


def parse_channel(content: bytes) -> tuple[int, Channel]:
    """(id, channel) of a channel record.

    Raises:
        ValueError: the record is not one.
    """
    cursor = _Cursor(content)
    channel_id, schema_id, topic, encoding = cursor.number(2), cursor.number(2), cursor.text(), cursor.text()
    entries = _Cursor(cursor.block())
    metadata = {}
    while entries.place < len(entries.content):
        key = entries.text()
        metadata[key] = entries.text()
    return channel_id, Channel(schema_id, topic, encoding, metadata)


def parse_message(content: bytes) -> StoredMessage:
    """The message of a message record.

    Raises:
        ValueError: the record is not one.
    """
    if len(content) < _MESSAGE_HEAD.size:
        raise ValueError("a message record is too short")
    channel_id, _, log_time, publish_time = _MESSAGE_HEAD.unpack_from(content)
    return StoredMessage(channel_id, log_time, publish_time, content[_MESSAGE_HEAD.size :])


class _Cursor:
    """Reads little-endian numbers and length-prefixed text from a record."""

    def __init__(self, content: bytes) -> None:
        self.content, self.place = content, 0

    def number(self, size: int) -> int:
        return int.from_bytes(self._take(size), "little")

    def block(self) -> bytes:
        return self._take(self.number(4))

    def text(self) -> str:
        return self.block().decode("utf-8")  # UnicodeDecodeError is a ValueError

    def _take(self, size: int) -> bytes:
        taken = self.content[self.place : self.place + size]
        if len(taken) != size:
            raise ValueError("a record is too short for what it says it holds")
        self.place += size
        return taken
