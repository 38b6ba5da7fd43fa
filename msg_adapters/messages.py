"""Messages made from plain fields, as real ROS classes; without ROS: `recorded_messages`."""

from __future__ import annotations

import array
import importlib
import re
from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from typing import Any, Protocol

import numpy as np

from lasso_motion_ros.core.errors import MessageError

_Convert = Callable[[Any], Any]

NANOSECONDS = 1_000_000_000
_ARRAY_CODES = {
    "uint8": "B",
    "octet": "B",
    "int8": "b",
    "uint16": "H",
    "int16": "h",
    "uint32": "I",
    "int32": "i",
    "uint64": "Q",
    "int64": "q",
    "float": "f",
    "double": "d",
}
_SEQUENCE = re.compile(r"sequence<(?P<item>[^,>]+)(?:, \d+)?>$")
_FIXED = re.compile(r"(?P<item>[^\[]+)\[\d+\]$")


class MessageFactory(Protocol):
    """Makes messages; they have the type's fields, whichever factory makes them."""

    def make(self, type_name: str, fields: Mapping[str, Any]) -> Any:
        """A message of `type_name` (`package/msg/Name`).

        Args:
            type_name: the message type.
            fields: values by field name; nested messages as mappings, arrays as sequences, bytes or NumPy
                arrays, of nested messages too: their rows hold the fields in order. A field that is not named keeps
                its default.

        Raises:
            MessageError: an unknown type or field.
        """


def stamp_to_ns(stamp: Any) -> int:
    """Nanoseconds of a `builtin_interfaces/Time`-like object."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def ns_to_stamp(stamp_ns: int) -> dict[str, int]:
    """The fields of a `builtin_interfaces/Time`."""
    seconds, nanoseconds = divmod(int(stamp_ns), NANOSECONDS)
    return {"sec": seconds, "nanosec": nanoseconds}


def header_fields(stamp_ns: int, frame_id: str = "") -> dict[str, Any]:
    """The fields of a `std_msgs/Header`."""
    return {"stamp": ns_to_stamp(stamp_ns), "frame_id": frame_id}


class RosMessages:
    """Real ROS message classes; needs a ROS installation when first used."""

    def make(self, type_name: str, fields: Mapping[str, Any]) -> Any:
        """See `MessageFactory.make`; also raises MessageError where the package is not installed."""
        message = _ros_class(type_name)()
        _fill_ros(message, fields, _converters(message.__class__))
        return message


@lru_cache(maxsize=256)
def _ros_class(type_name: str) -> Any:
    package, _, name = type_name.replace("/msg/", "/").partition("/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError) as error:
        raise MessageError(f"message type {type_name} is not installed ({error})") from error


def _fill_ros(message: Any, fields: Mapping[str, Any], converters: Mapping[str, _Convert | None]) -> None:
    for name, value in fields.items():
        if name not in converters:
            raise MessageError(f"{type(message).__name__} has no field {name!r}")
        convert = converters[name]
        if convert is not None:
            setattr(message, name, convert(value))
        elif isinstance(value, Mapping):
            part = getattr(message, name)
            _fill_ros(part, value, _converters(part.__class__))
        else:
            setattr(message, name, value)


@lru_cache(maxsize=256)
def _converters(message_class: Any) -> dict[str, _Convert | None]:
    """For each field, what converts a value; None for a nested message. Cached: a curve has hundreds of points."""
    return {name: _converter(kind) for name, kind in message_class.get_fields_and_field_types().items()}


def _converter(kind: str) -> _Convert | None:
    sequence, fixed = _SEQUENCE.match(kind), _FIXED.match(kind)
    if sequence is None and fixed is None:
        if kind in ("float", "double"):
            return float
        if "/" in kind:
            return None
        return _octet if kind == "octet" else _plain
    item = (sequence or fixed)["item"]  # type: ignore[index]
    if "/" in item:
        return partial(_ros_items, item)
    if item not in _ARRAY_CODES or item == "octet":
        return list
    return partial(_array, _ARRAY_CODES[item]) if fixed is None else partial(_fixed_array, _ARRAY_CODES[item])


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _octet(value: Any) -> Any:
    return bytes([value]) if isinstance(value, int) else _plain(value)


def _fixed_array(code: str, value: Any) -> Any:
    return np.asarray(value, dtype=np.dtype(code)).reshape(-1)


def _array(code: str, value: Any) -> Any:
    # Assigning an ndarray or a list to a sequence field is checked element by element (a second for a 2 MB
    # image); an array.array is taken as it is.
    filled = array.array(code)
    if isinstance(value, (bytes, bytearray, memoryview)):
        filled.frombytes(value)
    else:
        filled.frombytes(np.ascontiguousarray(value, dtype=np.dtype(code)).tobytes())
    return filled


def _ros_items(type_name: str, values: Any) -> list[Any]:
    message_class, items = _ros_class(type_name), []
    converters = _converters(message_class)
    if isinstance(values, np.ndarray):
        return [message_class(**dict(zip(converters, row, strict=True))) for row in values.tolist()]
    for value in values:
        if type(value) is dict or isinstance(value, Mapping):  # the first is asked at once, a hundred times a curve
            message = message_class()
            _fill_ros(message, value, converters)
            items.append(message)
        else:
            items.append(value)
    return items
