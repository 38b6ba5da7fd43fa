"""`sensor_msgs/Image` from the bytes that came over the wire (CDR), without a copy of its pixels.

A deserialiser copies them, rclpy's twice, which for two planes of 1024², 16 bits, is a tenth of all that a pair costs.
What is read here is the few dozen bytes before them.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import MessageError

_ORIGIN = 4  # alignment counts from behind the encapsulation's header (OMG DDSI-RTPS 2.5, 10.2)
_BYTE_ORDERS = {b"\x00\x00": ">", b"\x00\x01": "<"}


@dataclass(eq=False)
class ImageStamp:
    """The fields of a `builtin_interfaces/Time`."""

    sec: int
    nanosec: int


@dataclass(eq=False)
class ImageHeader:
    """The fields of a `std_msgs/Header`."""

    stamp: ImageStamp
    frame_id: str


@dataclass(eq=False)
class ReadImage:
    """The fields of a `sensor_msgs/Image`; `data` is a view of the bytes that it was read from."""

    header: ImageHeader
    height: int
    width: int
    encoding: str
    is_bigendian: int
    step: int
    data: npt.NDArray[np.uint8]


def read_image(message: bytes) -> ReadImage:
    """An Image from its bytes.

    Args:
        message: CDR of either byte order, with its encapsulation's header.

    Raises:
        MessageError: they are no Image, or a part of one.
    """
    order = _BYTE_ORDERS.get(message[:2])
    if order is None:
        raise MessageError(f"an image in CDR begins with 0000 or 0001, found {message[:2].hex() or 'nothing'}")
    try:
        seconds, nanoseconds = struct.unpack_from(f"{order}iI", message, _ORIGIN)
        frame_id, end = _text(message, _ORIGIN + 8, order)
        place = _aligned(end)
        height, width = struct.unpack_from(f"{order}II", message, place)
        encoding, end = _text(message, place + 8, order)
        is_bigendian, place = message[end], _aligned(end + 1)
        step, size = struct.unpack_from(f"{order}II", message, place)
    except (struct.error, IndexError) as error:
        raise MessageError(f"an image of {len(message)} bytes that is cut short or corrupt") from error
    data = np.frombuffer(message, np.uint8)[place + 8 : place + 8 + size]
    if data.size < size:
        raise MessageError(f"an image that is cut short or corrupt: expected {size} bytes of data, found {data.size}")
    header = ImageHeader(ImageStamp(seconds, nanoseconds), frame_id)
    return ReadImage(header, height, width, encoding, is_bigendian, step, data)


def _text(message: bytes, place: int, order: str) -> tuple[str, int]:
    """The string that begins at a place, and where it ends."""
    (size,) = struct.unpack_from(f"{order}I", message, place)
    end = place + 4 + size
    if end > len(message):
        raise IndexError(end)
    return message[place + 4 : end].removesuffix(b"\x00").decode("utf-8", "replace"), end


def _aligned(place: int) -> int:
    """The next place for a number of four bytes."""
    return place + -(place - _ORIGIN) % 4
