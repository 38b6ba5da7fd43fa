"""What stands in a segment of an MCAP file: unpacked within bounds, as far as it is sound."""

from __future__ import annotations

import io
import itertools
import zlib
from typing import Any, BinaryIO

import lz4.frame
import zstandard

from msg_adapters.recordings.mcap_layout import MAX_CHUNK_BYTES, Segment
from msg_adapters.recordings.mcap_records import PREFIX, split_records

MAX_CHUNK_RECORDS = 1 << 20
_PIECE_BYTES = 1 << 18


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
    records = list(itertools.islice(split_records(data), MAX_CHUNK_RECORDS + 1))
    if len(records) > MAX_CHUNK_RECORDS:
        return [], f"a chunk at byte {segment.offset} has more than {MAX_CHUNK_RECORDS} records, more than is sensible"
    if segment.complete and sum(PREFIX.size + len(content) for _, content in records) != len(data):
        return records, f"a chunk at byte {segment.offset} ends inside a record"
    return records, None


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
