"""The WebSocket's messages: bounded, checked JSON from the page; JSON and pictures to it."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import MessageError
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.web.source import PAGE_VIEWS, PageView

Array = npt.NDArray[np.float64]

MAX_MESSAGE_BYTES = 1 << 18
MAX_POINTS = 4000
CLICKS_FILE = "clicks_file"
COMMANDS = (
    "hold",
    "release",
    "seed",
    "accept",
    "next",
    "reset",
    "set_reference",
    "style",
    "go",
    "draw",
    "save",
    CLICKS_FILE,
)
_LARGEST_COORDINATE = 1e5


@dataclass(frozen=True)
class Window:
    """How grey values are shown, relative to the picture's own window.

    Attributes:
        brightness: −1 to 1, an offset in halves of the window's width.
        contrast: 0.2 to 5, a factor.
    """

    brightness: float = 0.0
    contrast: float = 1.0


@dataclass(frozen=True)
class DisplaySettings:
    """What a page wants to see.

    Attributes:
        view: the film, or the overlay.
        windows: how each plane's grey values are shown.
    """

    view: PageView
    windows: tuple[tuple[Plane, Window], ...] = tuple((plane, Window()) for plane in PLANES)


@dataclass(frozen=True)
class Shown:
    """The page has drawn the last picture and can take another."""


@dataclass(frozen=True)
class Request:
    """A command; its answer carries the same id."""

    id: int
    name: str
    body: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class ClickedOutline:
    """The clicks so far in one plane, (N, 2) pixels, through which the page wants to see the ellipse."""

    plane: Plane
    points: Array


def parse(text: str) -> DisplaySettings | Shown | Request | ClickedOutline:
    """A message from the page.

    Raises:
        MessageError: not JSON, an unknown kind, or a value that is not allowed.
    """
    try:
        # Without this, "NaN" and "Infinity" would pass for numbers.
        message = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise MessageError(f"not JSON: {error}") from error
    if not isinstance(message, dict):
        raise MessageError(f"expected an object, found {type(message).__name__}")
    kind = message.get("type")
    if kind == "shown":
        return Shown()
    if kind == "look":
        view = message.get("view")
        if view not in PAGE_VIEWS:
            raise MessageError(f"view: expected one of {', '.join(PAGE_VIEWS)}, found {view!r}")
        return DisplaySettings(view, tuple((plane, _window(message, plane)) for plane in PLANES))
    if kind == "fit":
        plane = message.get("plane")
        if plane not in PLANES:
            raise MessageError(f"plane: expected one of {', '.join(PLANES)}, found {plane!r}")
        return ClickedOutline(plane, points(message, plane, key="points"))
    if kind in COMMANDS:
        identity = message.get("id")
        if type(identity) is not int:
            raise MessageError(f"id: expected a whole number, found {identity!r}")
        return Request(identity, str(kind), message)
    raise MessageError(f"type: unknown: {kind!r}")


def points(body: Mapping[str, Any], plane: Plane, fewest: int = 0, key: str = "") -> Array:
    """The points of one plane, (N, 2) pixels, in a command's body, under the plane's name or another key.

    Raises:
        MessageError: not a list of pairs of finite numbers, too few or too many.
    """
    found = body.get(key or plane)
    if not isinstance(found, list) or len(found) > MAX_POINTS:
        raise MessageError(f"plane {plane.upper()}: expected a list of at most {MAX_POINTS} points")
    if len(found) < fewest:
        raise MessageError(f"plane {plane.upper()}: expected {fewest} points or more, found {len(found)}")
    for point in found:
        if not (isinstance(point, list) and len(point) == 2 and all(_is_coordinate(value) for value in point)):
            raise MessageError(f"plane {plane.upper()}: expected points [x, y], found {point!r}")
    return np.array(found, dtype=np.float64).reshape(-1, 2)


def text(name: str, body: Mapping[str, Any], choices: tuple[str, ...]) -> str:
    """A word from a fixed set, in a command's body.

    Raises:
        MessageError: any other value.
    """
    value = body.get(name)
    if value not in choices:
        raise MessageError(f"{name}: expected one of {', '.join(choices)}, found {value!r}")
    return str(value)


def encode(kind: str, **fields: Any) -> str:
    """A message to the page. A NaN in it would not be JSON and is refused.

    Raises:
        ValueError: a number that is not finite.
    """
    return json.dumps({"type": kind, **fields}, separators=(",", ":"), allow_nan=False)


@dataclass(frozen=True, eq=False)
class EncodedPlane:
    """One plane's picture as a file in memory, and what lies over it."""

    stamp_ns: int
    width: int
    height: int
    kind: Literal["jpeg", "png"]
    data: bytes
    loop: Array | None
    drawn: bool = False
    """Whether an overlay is drawn in it."""


def encode_picture(number: int, held: bool, view: PageView, planes: Mapping[Plane, EncodedPlane]) -> bytes:
    """A binary message: length of the JSON header (little-endian uint32), header, the planes' files one after another.

    Stamps are strings: nanoseconds since 1970 are beyond what a JavaScript number holds exactly.
    """
    described = {}
    for plane, one in planes.items():
        described[plane] = {
            "stamp": str(one.stamp_ns),
            "width": one.width,
            "height": one.height,
            "kind": one.kind,
            "bytes": len(one.data),
            "drawn": one.drawn,
            "loop": None if one.loop is None else np.round(one.loop, 2).tolist(),
        }
    header = encode("picture", number=number, held=held, view=view, planes=described).encode()
    return b"".join([struct.pack("<I", len(header)), header, *(planes[p].data for p in PLANES if p in planes)])


def _window(message: Mapping[str, Any], plane: Plane) -> Window:
    found = message.get(plane)
    if not isinstance(found, dict):
        raise MessageError(f"{plane}: expected an object, found {type(found).__name__}")
    return Window(_number(found, "brightness", -1.0, 1.0), _number(found, "contrast", 0.2, 5.0))


def _number(message: Mapping[str, Any], name: str, low: float, high: float) -> float:
    value = message.get(name)
    if not _is_finite(value) or not low <= value <= high:  # type: ignore[operator]
        raise MessageError(f"{name}: expected {low:g} to {high:g}, found {value!r}")
    return float(value)  # type: ignore[arg-type]


def _is_finite(value: object) -> bool:
    # An integer may be too large for a float.
    return isinstance(value, float | int) and not isinstance(value, bool) and abs(value) < math.inf


def _is_coordinate(value: object) -> bool:
    return _is_finite(value) and abs(value) <= _LARGEST_COORDINATE  # type: ignore[arg-type]


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number")
