"""The tracker's answers as the bytes that go over the wire (CDR), from the fields of their messages.

To make the messages first and have them serialised takes ten times as long, most of it for the points of the ring.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import MessageError

Fields = Mapping[str, Any]

_LITTLE_ENDIAN = b"\x00\x01\x00\x00"  # the encapsulation's header, from behind which alignment counts
_NOTHING: Fields = {}


def answer_bytes(type_name: str, fields: Fields) -> bytes:
    """What a message of a type is when it is serialised; a field that is not named has its default.

    Args:
        type_name: `package/msg/Name`, of one of the types that the tracker answers with.
        fields: as a `MessageFactory` takes them; of a `Marker` points as an array (N, 3), and no textures, meshes and
            colours of single points.

    Raises:
        MessageError: another type.
    """
    add = _ANSWERS.get(type_name)
    if add is None:
        raise MessageError(f"no answer is a {type_name}")
    written = _Written()
    add(written, fields)
    return bytes(written.data)


class _Written:
    """Values in their order, each aligned to its size (OMG DDSI-RTPS 2.5, 10.2)."""

    def __init__(self) -> None:
        self.data = bytearray(_LITTLE_ENDIAN)

    def add(self, code: str, *values: float) -> None:
        """Numbers of one kind, by the letter that `struct` has for it."""
        if values:
            self._align(struct.calcsize(code))
            self.data += struct.pack(f"<{len(values)}{code}", *values)

    def add_array(self, values: npt.NDArray[np.float64]) -> None:
        """Numbers of eight bytes, of any shape."""
        if values.size:
            self._align(8)
            self.data += values.astype("<f8").tobytes()

    def add_text(self, text: str) -> None:
        """A string."""
        encoded = text.encode("utf-8") + b"\x00"
        self.add("I", len(encoded))
        self.data += encoded

    def _align(self, size: int) -> None:
        self.data += bytes((len(_LITTLE_ENDIAN) - len(self.data)) % size)


def _add_string(written: _Written, fields: Fields) -> None:
    written.add_text(fields["data"])


def _add_header(written: _Written, fields: Fields) -> None:
    written.add("i", fields["stamp"]["sec"])
    written.add("I", fields["stamp"]["nanosec"])
    written.add_text(fields["frame_id"])


def _add_pose(written: _Written, fields: Fields) -> None:
    written.add("d", *_values(fields["position"], "xyz"), *_values(fields["orientation"], "xyzw"))


def _add_pose_stamped(written: _Written, fields: Fields) -> None:
    _add_header(written, fields["header"])
    _add_pose(written, fields["pose"])


def _add_pose_with_covariance_stamped(written: _Written, fields: Fields) -> None:
    _add_header(written, fields["header"])
    _add_pose(written, fields["pose"]["pose"])
    written.add_array(fields["pose"]["covariance"])


def _add_marker(written: _Written, fields: Fields) -> None:
    _add_header(written, fields["header"])
    written.add_text(fields["ns"])
    written.add("i", *(fields.get(name, 0) for name in ("id", "type", "action")))
    _add_pose(written, fields["pose"])
    written.add("d", *_values(fields.get("scale", _NOTHING), "xyz"))
    written.add("f", *_values(fields.get("color", _NOTHING), "rgba"))
    written.add("i", 0, 0)  # lifetime
    written.add("B", 0)  # frame_locked
    points = np.asarray(fields.get("points", ()), dtype=np.float64)
    written.add("I", len(points))
    written.add_array(points)
    _add_appearance(written)


def _add_appearance(written: _Written) -> None:
    """What a marker has behind its points: none of it is used."""
    written.add("I", 0)  # colors
    written.add_text("")  # texture_resource
    written.add("I", 0, 0)  # texture: stamp,
    written.add_text("")  # frame_id,
    written.add_text("")  # format,
    written.add("I", 0)  # data
    written.add("I", 0)  # uv_coordinates
    for _ in ("text", "mesh_resource", "mesh_file.filename"):
        written.add_text("")
    written.add("I", 0)  # mesh_file.data
    written.add("B", 0)  # mesh_use_embedded_materials


def _values(fields: Fields, names: str) -> list[float]:
    return [fields.get(name, 0.0) for name in names]


_ANSWERS: dict[str, Callable[[_Written, Fields], None]] = {
    "std_msgs/msg/String": _add_string,
    "std_msgs/msg/Header": _add_header,
    "geometry_msgs/msg/PoseStamped": _add_pose_stamped,
    "geometry_msgs/msg/PoseWithCovarianceStamped": _add_pose_with_covariance_stamped,
    "visualization_msgs/msg/Marker": _add_marker,
}
