"""Records of MCAP files, parsed by the mcap library; incomplete ones are refused.

Format: https://mcap.dev/spec.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Callable, Iterator
from typing import BinaryIO, TypeVar

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Footer, Message, Schema

Record = TypeVar("Record")

MAGIC = b"\x89MCAP0\r\n"
PREFIX = struct.Struct("<BQ")
"""What every record begins with: opcode and length of its content."""
MESSAGE_HEAD = struct.Struct("<HIQQ")
"""What a message record's content begins with: channel, sequence, log and publish time."""
FOOTER_BYTES = 8 + 8 + 4

# As plain numbers: comparing with an enumeration's member takes three times as long, for every record.
SCHEMA, CHANNEL, MESSAGE, CHUNK, CHUNK_INDEX, DATA_END, FOOTER = (
    int(code)
    for code in (
        Opcode.SCHEMA,
        Opcode.CHANNEL,
        Opcode.MESSAGE,
        Opcode.CHUNK,
        Opcode.CHUNK_INDEX,
        Opcode.DATA_END,
        Opcode.FOOTER,
    )
)
_LAST_KNOWN, _FIRST_PRIVATE = int(max(Opcode)), 0x80


class WholeReads:
    """A stream whose reads return all that was asked for, or raise EOFError.

    The library's parsers would take the end of a stream for the end of a text.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream

    def read(self, size: int) -> bytes:
        """`size` bytes.

        Raises:
            EOFError: there are fewer.
        """
        data = self._stream.read(size)
        if len(data) < size:
            raise EOFError
        return data


def is_known_opcode(opcode: int) -> bool:
    """Whether the format has such records, or leaves them to applications."""
    return 0 < opcode <= _LAST_KNOWN or opcode >= _FIRST_PRIVATE


def split_records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """(opcode, content) of the whole records at the start of `data`."""
    place = 0
    while place + PREFIX.size <= len(data):
        opcode, length = PREFIX.unpack_from(data, place)
        place += PREFIX.size
        if place + length > len(data):
            return
        yield opcode, data[place : place + length]
        place += length


def parse_schema(content: bytes) -> Schema:
    """A message definition.

    Raises:
        ValueError: the record is not one.
    """
    return _parsed(Schema.read, content)[0]


def parse_channel(content: bytes) -> Channel:
    """A topic; raises as `parse_schema`."""
    channel, used = _parsed(Channel.read, content)
    # The library reads metadata entries until it is past their stated end, whatever follows there.
    start = 12 + len(channel.topic.encode()) + len(channel.message_encoding.encode())
    if used != start + 4 + int.from_bytes(content[start : start + 4], "little"):
        raise ValueError("a channel's metadata do not end where they say")
    return channel


def parse_chunk_index(content: bytes) -> ChunkIndex:
    """Where a chunk lies; raises as `parse_schema`."""
    return _parsed(ChunkIndex.read, content)[0]


def parse_footer(content: bytes) -> Footer:
    """Where the summary lies; raises as `parse_schema`."""
    return _parsed(Footer.read, content)[0]


def parse_message(content: bytes) -> Message:
    """A message, undecoded, with its times in nanoseconds.

    Not by the library's own parser, which takes seven times as long: a recording may have hundreds of thousands.

    Raises:
        ValueError: the record is not one.
    """
    if len(content) < MESSAGE_HEAD.size:
        raise ValueError("a message record is too short")
    channel_id, sequence, log_time, publish_time = MESSAGE_HEAD.unpack_from(content)
    return Message(channel_id, log_time, content[MESSAGE_HEAD.size :], publish_time, sequence)


def _parsed(read: Callable[[ReadDataStream], Record], content: bytes) -> tuple[Record, int]:
    """What the library's parser finds, and how many bytes it took."""
    stream = ReadDataStream(WholeReads(io.BytesIO(content)))
    try:
        return read(stream), stream.count  # a UnicodeDecodeError is a ValueError
    except EOFError:
        raise ValueError("a record is too short for what it says it holds") from None
