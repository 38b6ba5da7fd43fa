"""Messages made from plain fields as dataclasses of the rosbags library: what recordings hold; no ROS needed."""

from __future__ import annotations

import array
from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from lasso_motion_ros.core.errors import MessageError

_Convert = Callable[[Any], Any]


@lru_cache(maxsize=1)
def jazzy_types() -> Typestore:
    """The message definitions of ROS 2 Jazzy, without ROS."""
    return get_typestore(Stores.ROS2_JAZZY)


class RecordedMessages:
    """A `MessageFactory` whose messages recordings are written from and read into."""

    def __init__(self, types: Typestore | None = None) -> None:
        self._types = types if types is not None else jazzy_types()
        self._known: dict[str, tuple[type, dict[str, _Convert]]] = {}

    def make(self, type_name: str, fields: Mapping[str, Any]) -> Any:
        """See `MessageFactory.make`."""
        return self._made(type_name, fields)

    def _made(self, type_name: str, fields: Mapping[str, Any]) -> Any:
        known = self._known.get(type_name)
        if known is None:
            converters = self._converters(type_name)
            known = self._known[type_name] = self._types.types[type_name], converters
        message_type, converters = known
        if not fields.keys() <= converters.keys():
            unknown = next(name for name in fields if name not in converters)
            raise MessageError(f"{type_name} has no field {unknown!r}")
        # Of the definition's fields, in its order: of a hundred points each, names would take half of the time.
        return message_type(*[convert(fields.get(name)) for name, convert in converters.items()])

    def _converters(self, type_name: str) -> dict[str, _Convert]:
        """For each field, what converts a value (or None, for the default) to what the message holds."""
        if type_name not in self._types.fielddefs:
            raise MessageError(f"message type {type_name} is not known")
        return {name: self._converter(definition) for name, definition in self._types.fielddefs[type_name][1]}

    def _converter(self, definition: Any) -> _Convert:
        kind, detail = definition
        if kind == Nodetype.NAME:
            return partial(self._nested, detail)
        if kind == Nodetype.BASE:
            return _base_converter(detail[0])
        item, length = detail
        count = length if kind == Nodetype.ARRAY else 0
        if item[0] == Nodetype.NAME or item[1][0] == "string":
            return partial(self._items, item, self._converter(item), count)
        dtype = np.dtype("uint8" if item[1][0] in ("octet", "byte", "char") else item[1][0])
        return partial(_recorded_array, dtype, count, kind == Nodetype.ARRAY)

    def _items(self, item: Any, convert: _Convert, count: int, values: Any) -> list[Any]:
        if isinstance(values, np.ndarray):
            return [self._types.types[item[1]](*row) for row in values.tolist()]
        return [convert(value) for value in (values if values is not None else [None] * count)]

    def _nested(self, type_name: str, value: Any) -> Any:
        if type(value) is dict or value is None or isinstance(value, Mapping):  # the first is asked at once
            return self._made(type_name, value or {})
        return value


def _recorded_array(dtype: np.dtype[Any], length: int, is_fixed: bool, value: Any) -> Any:
    if value is None:
        return np.zeros(length, dtype=dtype)
    if isinstance(value, (bytes, bytearray, memoryview, array.array)):
        filled = np.frombuffer(value, dtype=dtype)
    else:
        filled = np.ascontiguousarray(value, dtype=dtype).reshape(-1)
    if is_fixed and filled.size != length:
        raise MessageError(f"an array of {length} was expected, found {filled.size} values")
    return filled


def _float(value: Any) -> float:
    return 0.0 if value is None else float(value)


def _base_converter(kind: str) -> _Convert:
    if kind == "string":
        return lambda value: "" if value is None else str(value)
    if kind == "bool":
        return bool
    if kind.startswith("float"):
        return _float
    return lambda value: value[0] if isinstance(value, bytes) else int(value or 0)
