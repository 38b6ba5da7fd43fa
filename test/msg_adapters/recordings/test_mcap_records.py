"""MCAP records, as the mcap library writes them: read whole, or refused."""

from __future__ import annotations

import pytest
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, ChunkIndex, Footer, Message, Schema

from msg_adapters.recordings.mcap_records import (
    PREFIX,
    is_known_opcode,
    parse_channel,
    parse_chunk_index,
    parse_footer,
    parse_message,
    parse_schema,
    split_records,
)

SCHEMA = Schema(id=3, data=b"string data", encoding="ros2msg", name="std_msgs/msg/String")
CHANNEL = Channel(id=7, topic="/words", message_encoding="cdr", metadata={"a": "1", "b": "°"}, schema_id=3)
MESSAGE = Message(channel_id=7, log_time=11, data=b"hello", publish_time=10, sequence=5)
INDEX = ChunkIndex(900, 100, "zstd", 700, 12, 60, {7: 1000}, 11, 4000)
FOOTER = Footer(summary_start=400, summary_offset_start=0, summary_crc=99)
PARSERS = [
    (SCHEMA, parse_schema),
    (CHANNEL, parse_channel),
    (MESSAGE, parse_message),
    (INDEX, parse_chunk_index),
    (FOOTER, parse_footer),
]


def written(record):
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


@pytest.mark.parametrize(("record", "parse"), PARSERS)
def test_a_record_comes_back(record, parse):
    assert parse(written(record)[PREFIX.size :]) == record


@pytest.mark.parametrize(("record", "parse"), PARSERS)
def test_a_record_that_is_too_short_is_refused(record, parse):
    content = written(record)[PREFIX.size :]
    # A message's own bytes may have any length, also none.
    shortest = len(content) - len(MESSAGE.data) if record is MESSAGE else len(content)
    for length in range(shortest):
        with pytest.raises(ValueError, match="too short"):
            parse(content[:length])


def test_metadata_that_reach_beyond_their_end_are_refused():
    content = bytearray(written(CHANNEL)[PREFIX.size :])
    end_of_encoding = content.index(b"cdr") + 3
    content[end_of_encoding : end_of_encoding + 4] = (15).to_bytes(4, "little")  # one and a half entries
    with pytest.raises(ValueError, match="metadata"):
        parse_channel(bytes(content))


def test_text_that_is_none_is_refused():
    content = written(SCHEMA)[PREFIX.size :].replace(b"std_msgs", b"std_msg\xff")
    with pytest.raises(ValueError, match="utf-8"):
        parse_schema(content)


def test_records_are_split_as_far_as_they_are_whole():
    data = written(SCHEMA) + written(MESSAGE)
    assert [opcode for opcode, _ in split_records(data)] == [3, 5]
    assert [content for _, content in split_records(data[:-1])] == [written(SCHEMA)[PREFIX.size :]]


def test_opcodes_of_the_format_and_of_applications_are_known():
    assert [code for code in range(256) if not is_known_opcode(code)] == [0, *range(0x10, 0x80)]
