"""One MCAP file, whole or damaged: its channels, and its messages segment by segment."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

from mcap.records import Channel, Message, Schema

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


class McapFile:
    """One MCAP file.

    Args:
        path: the file.

    Attributes:
        layout: where its messages lie.
        known: topic and definition of the channels met so far, by the channel's number.

    Raises:
        RecordingError: it cannot be opened, or is no MCAP file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.layout: FileLayout = walk_file(path)
        self._schemas = dict(self.layout.schemas)
        self.known: dict[int, tuple[Channel, Schema]] = {}
        for channel in self.layout.channels.values():
            self._learn(channel)
        if not (self.layout.has_summary and self.known):
            # Without a summary, the channels stand only in the chunks.
            with path.open("rb") as stream:
                for segment in self.layout.segments:
                    self.read(stream, segment)

    def read(self, stream: BinaryIO, segment: Segment) -> tuple[list[Message], str | None]:
        """The messages of one segment, in stored order, and what is wrong with it or None."""
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
            # The first one read holds, so that a corrupt repetition changes nothing.
            self.known.setdefault(channel.id, (channel, schema))
