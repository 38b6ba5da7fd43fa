"""Messages from one recording into another as they are: bytes, times, quality of service and type definitions."""

from __future__ import annotations

from msg_adapters.recordings.reader import RawMessage, RecordingReader
from msg_adapters.recordings.writer import RecordingWriter


class RecordingCopier:
    """Writes messages of one recording into another, undecoded.

    Args:
        reader: where they come from.
        writer: where they go; the caller opens and closes it.
    """

    def __init__(self, reader: RecordingReader, writer: RecordingWriter) -> None:
        self._writer = writer
        self._latched, self._best_effort = reader.latched_topics, reader.best_effort_topics
        self._definitions = {topic: reader.definition(topic) for topic in reader.topics}

    def copy(self, message: RawMessage) -> None:
        """Append one message.

        Raises:
            RecordingError: it does not fit what is in the other recording already, or the disk is full.
        """
        self._writer.write_raw(
            message.topic,
            message.type_name,
            message.data,
            message.log_time_ns,
            publish_time_ns=message.publish_time_ns,
            latched=message.topic in self._latched,
            reliable=message.topic not in self._best_effort,
            definition=self._definitions.get(message.topic),
        )
