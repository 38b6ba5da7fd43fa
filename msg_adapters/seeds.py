"""The user's clicks: as `geometry_msgs/PolygonStamped`, and in files beside recordings that lack them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import ConfigurationError, MessageError
from lasso_motion_ros.core.plain_yaml import read_plain_yaml
from lasso_motion_ros.geometry.frames import PLANES, Plane
from msg_adapters.images import MAX_SIDE_PX
from msg_adapters.messages import NANOSECONDS, header_fields, ns_to_stamp

Array = npt.NDArray[np.float64]

MINIMUM_CLICKS = 6
MAXIMUM_CLICKS = 10_000
_SIZE_KEYS = ("width", "height")
_LATEST_S = 2**31 - 1  # what a stamp's seconds hold

SEEDS_HELP = """\
seeds file (YAML): the clicks of both planes in one image pair, in order along the loop, 6 or more a plane
  plane_a:
    stamp: 1760000000.333333333   # of the clicked image, seconds (or {sec: …, nanosec: …}); absent or 0: the first pair
    points: [[512.5, 300.0], [530.1, 310.2], …]   # x right, y down, pixels of the published image
  plane_b:
    points: [[…], …]
"""

CALIBRATION_HELP = """\
calibration file (YAML): one projection a plane, for the whole recording
  plane_a:
    p: [12 numbers, row by row]   # 3×4, world metres to pixels of the image; any scale and sign
    width: 1024                   # of the image, pixels
    height: 1024
  plane_b: {p: […], width: …, height: …}
"""


def encode_polygon(points: npt.ArrayLike, header: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a `geometry_msgs/PolygonStamped` of pixel coordinates (N, 2)."""
    entries = [{"x": float(x), "y": float(y)} for x, y in np.asarray(points, dtype=np.float64)]
    return {"header": header, "polygon": {"points": entries}}


def decode_polygon(message: Any) -> Array:
    """The points of a PolygonStamped, (N, 2) float64 pixels.

    Raises:
        MessageError: a coordinate that is not finite.
    """
    points = np.array([[p.x, p.y] for p in message.polygon.points], dtype=np.float64).reshape(-1, 2)
    if not np.all(np.isfinite(points)):
        raise MessageError("polygon: a coordinate is not finite")
    return points


def decode_seed(message: Any) -> Array:
    """The clicks of a seed message, (N, 2) float64 pixels.

    Raises:
        MessageError: fewer than 6 clicks, too many, or a coordinate that is not finite.
    """
    count = len(message.polygon.points)
    if not MINIMUM_CLICKS <= count <= MAXIMUM_CLICKS:
        raise MessageError(f"polygon: expected {MINIMUM_CLICKS} clicks or more along the loop, found {count}")
    return decode_polygon(message)


def read_seeds_file(path: str | Path) -> dict[str, dict[str, Any]]:
    """The fields of one PolygonStamped per plane (`a`, `b`) from a seeds file (see `SEEDS_HELP`).

    Raises:
        ConfigurationError: unreadable file, a missing plane, or points that are no points.
    """
    seeds: dict[str, dict[str, Any]] = {}
    for plane, body in _planes(path, SEEDS_HELP):
        if isinstance(body, list):  # a bare list of points
            body = {"points": body}
        where = f"{path}: plane_{plane}"
        _check_keys(body, {"points", "stamp"}, where)
        points = _numbers(body.get("points"), f"{where}.points", "a list of [x, y]")
        if points.ndim != 2 or points.shape[1] != 2:
            raise ConfigurationError(f"{where}.points: expected a list of [x, y], found shape {points.shape}")
        if not MINIMUM_CLICKS <= len(points) <= MAXIMUM_CLICKS:
            raise ConfigurationError(f"{where}.points: expected {MINIMUM_CLICKS} points or more, found {len(points)}")
        if np.any(np.abs(points) > MAX_SIDE_PX):
            raise ConfigurationError(f"{where}.points: expected pixels of the image, found {np.abs(points).max():g}")
        seeds[plane] = encode_polygon(points, header_fields(_stamp_ns(body.get("stamp", 0), where)))
    return seeds


def encode_seeds_file(clicks: Mapping[Plane, tuple[int, Array]]) -> str:
    """The text of a seeds file (see `SEEDS_HELP`), which `read_seeds_file` reads.

    Args:
        clicks: of each plane, the clicked image's stamp in ns and the clicks (N, 2) in pixels.
    """
    lines = ["# Clicks in one image pair: lasso-motion track IN.mcap -o OUT.mcap --seeds THIS_FILE"]
    for plane in PLANES:
        stamp_ns, points = clicks[plane]
        stamp = ns_to_stamp(stamp_ns)
        lines += [f"plane_{plane}:", f"  stamp: {{sec: {stamp['sec']}, nanosec: {stamp['nanosec']}}}", "  points:"]
        lines += [f"    - [{x:.2f}, {y:.2f}]" for x, y in points]
    return "\n".join(lines) + "\n"


def read_calibration_file(path: str | Path) -> dict[str, dict[str, Any]]:
    """The fields of one CameraInfo per plane (`a`, `b`) from a calibration file (see `CALIBRATION_HELP`).

    Raises:
        ConfigurationError: unreadable file, a missing plane, or values of another kind.
    """
    calibrations: dict[str, dict[str, Any]] = {}
    for plane, body in _planes(path, CALIBRATION_HELP):
        where = f"{path}: plane_{plane}"
        _check_keys(body, {"p", *_SIZE_KEYS}, where)
        matrix = _numbers(body.get("p"), f"{where}.p", "12 numbers, row by row").reshape(-1)
        if matrix.size != 12:
            raise ConfigurationError(f"{where}.p: expected 12 numbers, row by row, found {matrix.size}")
        for key in _SIZE_KEYS:
            if type(body.get(key)) is not int or not 1 <= body[key] <= MAX_SIDE_PX:
                raise ConfigurationError(f"{where}.{key}: expected a number of pixels, found {body.get(key)!r:.80}")
        calibrations[plane] = {"header": header_fields(0), "p": matrix, **{key: body[key] for key in _SIZE_KEYS}}
    return calibrations


def _planes(path: str | Path, expected: str) -> list[tuple[str, Any]]:
    document = read_plain_yaml(path)
    if not isinstance(document, dict) or set(document) != {"plane_a", "plane_b"}:
        found = ", ".join(map(str, document))[:80] if isinstance(document, dict) else type(document).__name__
        raise ConfigurationError(f"{path}: expected plane_a and plane_b, found {found}")
    return [("a", document["plane_a"]), ("b", document["plane_b"])]


def _check_keys(body: Any, allowed: set[str], where: str) -> None:
    if not isinstance(body, dict):
        raise ConfigurationError(f"{where}: expected {', '.join(sorted(allowed))}, found {body!r:.80}")
    for key in body:
        if key not in allowed:
            raise ConfigurationError(f"{where}: expected {', '.join(sorted(allowed))}, found {key!r:.80}")


def _numbers(value: Any, where: str, expected: str) -> Array:
    try:
        numbers = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ConfigurationError(f"{where}: expected {expected}") from error
    if numbers.size == 0 or not np.all(np.isfinite(numbers)):
        raise ConfigurationError(f"{where}: expected {expected}, all finite")
    return numbers


def _stamp_ns(value: Any, where: str) -> int:
    if isinstance(value, dict) and set(value) == {"sec", "nanosec"}:
        parts = (value["sec"], value["nanosec"])
        if all(type(part) is int for part in parts) and 0 <= parts[0] <= _LATEST_S and 0 <= parts[1] < NANOSECONDS:
            return int(parts[0] * NANOSECONDS + parts[1])
    elif isinstance(value, (int, float)) and not isinstance(value, bool) and 0 <= value <= _LATEST_S:
        return round(value * NANOSECONDS)
    raise ConfigurationError(f"{where}.stamp: expected seconds or {{sec: …, nanosec: …}}, found {value!r:.80}")
