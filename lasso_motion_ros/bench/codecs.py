"""CDR bytes to messages, by the deserialiser of what is measured."""

from __future__ import annotations

import importlib
from typing import Any, Protocol

from msg_adapters.input_bytes import READERS
from msg_adapters.messages import MessageFactory, RosMessages
from msg_adapters.recorded_messages import RecordedMessages, jazzy_types


class Codec(Protocol):
    """Bytes to messages, as the node or the offline command takes them."""

    name: str
    factory: MessageFactory

    def decode(self, data: bytes, type_name: str) -> Any:
        """The message in CDR bytes."""


class RosCodec:
    """What rclpy does for the node, but for images and calibrations."""

    name = "rclpy"

    def __init__(self) -> None:
        from rclpy import serialization

        self._serialization = serialization
        self._classes: dict[str, Any] = {}
        self.factory: MessageFactory = RosMessages()

    def decode(self, data: bytes, type_name: str) -> Any:
        """The message in CDR bytes."""
        if type_name in READERS:
            return READERS[type_name](data)
        if type_name not in self._classes:
            package, _, name = type_name.partition("/msg/")
            self._classes[type_name] = getattr(importlib.import_module(f"{package}.msg"), name)
        return self._serialization.deserialize_message(data, self._classes[type_name])


class RecordedCodec:
    """What the offline command does, where there is no ROS."""

    name = "rosbags"

    def __init__(self) -> None:
        self._types = jazzy_types()
        self.factory: MessageFactory = RecordedMessages(self._types)

    def decode(self, data: bytes, type_name: str) -> Any:
        """The message in CDR bytes."""
        if type_name in READERS:
            return READERS[type_name](data)
        return self._types.deserialize_cdr(data, type_name)


def available_codec() -> Codec:
    """The node's own where ROS 2 is installed, else the offline command's."""
    try:
        return RosCodec()
    except ImportError:
        return RecordedCodec()
