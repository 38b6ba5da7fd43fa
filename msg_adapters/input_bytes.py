"""Images and calibrations from the bytes that came over the wire (CDR), without a copy of the pixels.

A deserialiser copies them, rclpy's twice: for two planes of 1024², 16 bits, that is a tenth of all that a pair costs.
What is read here is the few dozen bytes before them, and a calibration's few hundred, which takes a tenth of the time
that rclpy does.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import MessageError
from msg_adapters.topics import IMAGE_TYPE

Array = npt.NDArray[np.float64]

_ORIGIN = 4  # alignment counts from behind the encapsulation's header (OMG DDSI-RTPS 2.5, 10.2)
_BYTE_ORDERS = {b"\x00\x00": ">", b"\x00\x01": "<"}


@dataclass(eq=False)
class ReadStamp:
    """The fields of a `builtin_interfaces/Time`."""

    sec: int
    nanosec: int


@dataclass(eq=False)
class ReadHeader:
    """The fields of a `std_msgs/Header`."""

    stamp: ReadStamp
    frame_id: str


@dataclass(eq=False)
class ReadImage:
    """The fields of a `sensor_msgs/Image`; `data` is a view of the bytes that it was read from."""

    header: ReadHeader
    height: int
    width: int
    encoding: str
    is_bigendian: int
    step: int
    data: npt.NDArray[np.uint8]


@dataclass(eq=False)
class ReadRegion:
    """The fields of a `sensor_msgs/RegionOfInterest`."""

    x_offset: int
    y_offset: int
    height: int
    width: int
    do_rectify: bool


@dataclass(eq=False)
class ReadCameraInfo:
    """The fields of a `sensor_msgs/CameraInfo`; `k` and `r` have 9 values, `p` 12."""

    header: ReadHeader
    height: int
    width: int
    distortion_model: str
    d: Array
    k: Array
    r: Array
    p: Array
    binning_x: int
    binning_y: int
    roi: ReadRegion


def read_image(message: bytes) -> ReadImage:
    """An Image from its bytes.

    Args:
        message: CDR of either byte order, with its encapsulation's header.

    Raises:
        MessageError: they are no Image, or a part of one.
    """
    read = _Reader(message, "an image")
    header = read.header()
    height, width = read.numbers("I", 2)
    encoding, (is_bigendian,), (step, size) = read.text(), read.numbers("B", 1), read.numbers("I", 2)
    return ReadImage(header, height, width, encoding, is_bigendian, step, read.octets(size))


def read_camera_info(message: bytes) -> ReadCameraInfo:
    """A CameraInfo from its bytes; argument and errors as those of `read_image`."""
    read = _Reader(message, "a calibration")
    header = read.header()
    height, width = read.numbers("I", 2)
    model, (count,) = read.text(), read.numbers("I", 1)
    d, k, r, p = (np.array(read.numbers("d", size)) for size in (count, 9, 9, 12))
    binning_x, binning_y, left, top, part_height, part_width = read.numbers("I", 6)
    roi = ReadRegion(left, top, part_height, part_width, do_rectify=bool(read.numbers("B", 1)[0]))
    return ReadCameraInfo(header, height, width, model, d, k, r, p, binning_x, binning_y, roi)


READERS: dict[str, Callable[[bytes], Any]] = {IMAGE_TYPE: read_image, "sensor_msgs/msg/CameraInfo": read_camera_info}
"""By type of message, what reads it."""


class _Reader:
    """Takes values from a message in their order, each aligned to its size.

    Args:
        message: CDR.
        what: it is to be, in words.

    Raises:
        MessageError: another encoding; the methods raise it where the message ends before its content does.
    """

    def __init__(self, message: bytes, what: str) -> None:
        self._message, self._what, self._place = message, what, _ORIGIN
        order = _BYTE_ORDERS.get(message[:2])
        if order is None:
            raise MessageError(f"{what} in CDR begins with 0000 or 0001, found {message[:2].hex() or 'nothing'}")
        self._order = order

    def numbers(self, code: str, count: int) -> tuple[Any, ...]:
        """Some numbers of one kind, by the letter that `struct` has for it."""
        if count == 0:
            return ()
        size = struct.calcsize(code)
        self._place += (_ORIGIN - self._place) % size
        start = self._go_on(count * size)
        return struct.unpack_from(f"{self._order}{count}{code}", self._message, start)

    def text(self) -> str:
        """A string."""
        (size,) = self.numbers("I", 1)
        start = self._go_on(size)
        return self._message[start : self._place].removesuffix(b"\x00").decode("utf-8", "replace")

    def header(self) -> ReadHeader:
        """A `std_msgs/Header`."""
        (seconds,), (nanoseconds,) = self.numbers("i", 1), self.numbers("I", 1)
        return ReadHeader(ReadStamp(seconds, nanoseconds), self.text())

    def octets(self, size: int) -> npt.NDArray[np.uint8]:
        """The next bytes, (size,), not copied."""
        start = self._go_on(size)
        return np.frombuffer(self._message, np.uint8)[start : self._place]

    def _go_on(self, size: int) -> int:
        """Go on by so many bytes; returns where they begin."""
        start, self._place = self._place, self._place + size
        if self._place > len(self._message):
            raise MessageError(f"{self._what} of {len(self._message)} bytes that is cut short or corrupt")
        return start
