"""Decodes recorded messages, also of types that only the recording defines."""

from __future__ import annotations

from typing import Any

from mcap.records import Channel, Schema
from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore

from lasso_motion_ros.core.errors import RecordingError
from msg_adapters.input_bytes import READERS
from msg_adapters.recorded_messages import jazzy_types


class CdrDecoder:
    """CDR to message objects; types that ROS 2 Jazzy does not have are learnt from the recording."""

    def __init__(self) -> None:
        self._types: Typestore = jazzy_types()
        self._checked: set[str] = set()

    def decode(self, channel: Channel, schema: Schema, data: bytes) -> Any:
        """The message, or None where its bytes are not one.

        Raises:
            RecordingError: another encoding than CDR, or a type whose definition cannot be read.
        """
        if channel.message_encoding != "cdr":
            raise RecordingError(f"{channel.topic}: expected messages in cdr, found {channel.message_encoding!r}")
        if schema.name not in self._checked:
            self._learn(schema)
            self._checked.add(schema.name)
        try:
            read = READERS.get(schema.name)
            return self._types.deserialize_cdr(data, schema.name) if read is None else read(data)
        except Exception:  # whatever the deserialiser raises: the bytes are not such a message
            return None

    def _learn(self, schema: Schema) -> None:
        if schema.name in self._types.fielddefs:
            return
        try:
            found = get_types_from_msg(schema.data.decode("utf-8"), schema.name)
            self._types.register({name: fields for name, fields in found.items() if name not in self._types.fielddefs})
        except Exception as error:
            raise RecordingError(f"the definition of {schema.name} cannot be read: {error}") from error
