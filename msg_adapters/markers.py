"""Curves, point sets and surfaces as `visualization_msgs/Marker`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.transforms import apply
from msg_adapters.poses import decode_pose, encode_pose

Array = npt.NDArray[np.float64]
Rgba = tuple[float, float, float, float]

LINE_STRIP, POINTS, TRIANGLE_LIST = 4, 8, 11
ADD, DELETE = 0, 2
_IDENTITY = np.eye(4)


def _marker(
    kind: int,
    namespace: str,
    points: npt.ArrayLike,
    *,
    size: Mapping[str, float],
    colour: Rgba,
    header: Mapping[str, Any],
) -> dict[str, Any]:
    red, green, blue, alpha = colour
    return {
        "header": header,
        "ns": namespace,
        "id": 0,
        "type": kind,
        "action": ADD,
        "pose": encode_pose(_IDENTITY),
        "scale": size,
        "color": {"r": red, "g": green, "b": blue, "a": alpha},
        "points": np.asarray(points, dtype=np.float64).reshape(-1, 3),
    }


def encode_line_strip(
    points: npt.ArrayLike,
    header: Mapping[str, Any],
    namespace: str,
    colour: Rgba = (1.0, 0.8, 0.1, 1.0),
    width_m: float = 1e-3,
) -> dict[str, Any]:
    """The fields of a LINE_STRIP through points (N, 3), metres; a closed curve repeats its first point."""
    return _marker(LINE_STRIP, namespace, points, size={"x": width_m}, colour=colour, header=header)


def encode_points(
    points: npt.ArrayLike,
    header: Mapping[str, Any],
    namespace: str,
    colour: Rgba = (0.2, 0.7, 1.0, 1.0),
    size_m: float = 2e-3,
) -> dict[str, Any]:
    """The fields of a POINTS marker at points (N, 3), metres."""
    return _marker(POINTS, namespace, points, size={"x": size_m, "y": size_m}, colour=colour, header=header)


def encode_triangles(
    vertices: Array,
    triangles: npt.NDArray[np.integer[Any]],
    header: Mapping[str, Any],
    namespace: str,
    colour: Rgba = (0.9, 0.3, 0.3, 0.5),
) -> dict[str, Any]:
    """The fields of a TRIANGLE_LIST of vertices (V, 3), metres, joined by triangles (T, 3)."""
    corners = np.asarray(vertices)[np.asarray(triangles).reshape(-1)]
    return _marker(TRIANGLE_LIST, namespace, corners, size={"x": 1.0, "y": 1.0, "z": 1.0}, colour=colour, header=header)


def encode_delete(header: Mapping[str, Any], namespace: str) -> dict[str, Any]:
    """The fields of the marker that takes away the one of the same namespace."""
    return {"header": header, "ns": namespace, "id": 0, "action": DELETE, "pose": encode_pose(_IDENTITY)}


def decode_points(message: Any) -> Array:
    """The points of a marker, (N, 3) float64 metres in its header's frame (its own pose is applied)."""
    points = np.array([[p.x, p.y, p.z] for p in message.points], dtype=np.float64).reshape(-1, 3)
    orientation = message.pose.orientation
    if orientation.x == orientation.y == orientation.z == orientation.w == 0.0:
        return points  # a pose left at its default is meant as the identity
    return apply(decode_pose(message.pose), points)
