"""X-ray images between `sensor_msgs/Image` (or CompressedImage) and NumPy arrays."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import MessageError
from msg_adapters.crop import Crop

Pixels = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]

MAX_SIDE_PX = 8192
MAX_UNPACKED_BYTES = 2 * MAX_SIDE_PX**2
_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_PNG_GREY = 0
_GREY_BYTES = {"mono8": 1, "8UC1": 1, "mono16": 2, "16UC1": 2}
# Channels, and how OpenCV makes luminance of them, by the weights of ITU-R BT.601.
_COLOUR = {
    "rgb8": (3, cv2.COLOR_RGB2GRAY),
    "bgr8": (3, cv2.COLOR_BGR2GRAY),
    "rgba8": (4, cv2.COLOR_RGBA2GRAY),
    "bgra8": (4, cv2.COLOR_BGRA2GRAY),
}
# Of the two bytes of a pixel, the one that is its luminance.
_LUMA_BYTE = {"yuv422": 1, "uyvy": 1, "yuv422_yuy2": 0, "yuyv": 0}
_BYTES_PER_PIXEL = {
    **_GREY_BYTES,
    **{encoding: channels for encoding, (channels, _) in _COLOUR.items()},
    **dict.fromkeys(_LUMA_BYTE, 2),
}
TAKEN_AS_LUMINANCE = "pictures are taken as luminance (ITU-R BT.601)"


@dataclass(frozen=True, eq=False)
class GreyImage:
    """An image's grey values.

    Attributes:
        pixels: (H, W) uint8 or uint16 in native byte order, read-only.
        picture: (height, width) of the picture that they are of, or of which they are a part.
        colour: where they are the luminance of a colour picture, what it came as; else empty.
    """

    pixels: Pixels
    picture: tuple[int, int]
    colour: str = ""


def decode_image(message: Any, crop: Crop | None = None) -> Pixels:
    """The grey values of an image, (H, W); see `decode_grey`."""
    return decode_grey(message, crop).pixels


def decode_grey(message: Any, crop: Crop | None = None) -> GreyImage:
    """The grey values of a `sensor_msgs/Image` or `CompressedImage`; of a colour picture, its luminance.

    Args:
        message: an Image of encoding mono8, 8UC1, mono16, 16UC1 (either endianness), rgb8, bgr8, rgba8, bgra8, yuv422
            (also called uyvy) or yuv422_yuy2 (yuyv), rows padded or not; or a CompressedImage, PNG or JPEG.
        crop: the part that is wanted.

    Returns:
        The image; its pixels are a view of the message's data where its bytes already lie that way.

    Raises:
        MessageError: another encoding or format, a size out of bounds, data that do not fit height and step, or a crop
            that reaches beyond the picture.
    """
    if hasattr(message, "encoding"):
        rows, colour = _rows(message), "" if message.encoding in _GREY_BYTES else str(message.encoding)
    else:
        rows, colour = _unpacked(message)
    picture = rows.shape[0], rows.shape[1]
    if crop is not None:
        rows = crop.part(rows)
    if rows.ndim == 3:
        rows = _luminance(rows, colour)
    if not rows.dtype.isnative or not rows.flags.aligned:
        rows = rows.astype(rows.dtype.newbyteorder("="))
    rows.flags.writeable = False
    return GreyImage(rows, picture, colour)


def _rows(message: Any) -> Any:
    """The data of an Image as (H, W) or (H, W, C), without a copy."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    size = _BYTES_PER_PIXEL.get(message.encoding)
    if size is None:
        raise MessageError(f"encoding: expected {', '.join(_BYTES_PER_PIXEL)}, found {message.encoding!r}")
    _check_size(width, height)
    if step < width * size:
        raise MessageError(f"step: a row of {width} {message.encoding} pixels has {width * size} bytes, found {step}")
    data = np.frombuffer(message.data, dtype=np.uint8)
    # Only the padding behind the last row may be missing.
    if not step * (height - 1) + width * size <= data.size <= step * height:
        raise MessageError(f"data: expected {step * height} bytes (step × height), found {data.size}")
    if message.encoding not in _GREY_BYTES:
        return np.ndarray((height, width, size), np.uint8, buffer=data.data, strides=(step, size, 1))
    dtype = np.dtype(np.uint8) if size == 1 else np.dtype(">u2" if message.is_bigendian else "<u2")
    return np.ndarray((height, width), dtype=dtype, buffer=data.data, strides=(step, size))


def _luminance(picture: Any, encoding: str) -> Any:
    """The luminance of a picture (H, W, C)."""
    if encoding in _LUMA_BYTE:
        return picture[..., _LUMA_BYTE[encoding]].copy()
    return cv2.cvtColor(picture, _COLOUR[encoding][1])


def _unpacked(message: Any) -> tuple[Any, str]:
    """The picture (H, W) or (H, W, C) of a CompressedImage, and in which order of colours."""
    data = np.frombuffer(message.data, dtype=np.uint8)
    whole = data.tobytes()
    # The size is checked before anything is unpacked.
    is_jpeg = whole.startswith(b"\xff\xd8\xff")
    if is_jpeg:
        width, height, pixel_bytes = _jpeg_size(whole)
    elif whole.startswith(_PNG_SIGNATURE):
        width, height, pixel_bytes = _png_size(whole)
    else:
        raise MessageError(f"format: expected png or jpeg, found {message.format!r}")
    _check_size(width, height)
    if width * height * pixel_bytes > MAX_UNPACKED_BYTES:
        raise MessageError(f"data: {width}×{height} pixels of {pixel_bytes} bytes are too large a picture")
    try:
        # A colour JPEG holds its luminance by itself.
        how = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION if is_jpeg else cv2.IMREAD_UNCHANGED
        pixels = cv2.imdecode(data, how)
    except cv2.error:
        pixels = None
    if pixels is None:
        raise MessageError(f"data: {data.size} bytes that cannot be decoded as {message.format!r}")
    if pixels.dtype not in (np.uint8, np.uint16):
        raise MessageError(f"data: expected 8 or 16 bits a pixel, found {pixels.dtype}")
    _check_size(pixels.shape[1], pixels.shape[0])
    if pixels.ndim == 2:
        return pixels, "colour" if is_jpeg and pixel_bytes > 1 else ""
    return pixels, "bgra8" if pixels.shape[2] == 4 else "bgr8"


def _png_size(data: bytes) -> tuple[int, int, int]:
    """Width, height and bytes a pixel, from a PNG's first chunk, once all its chunks are known to be complete.

    OpenCV allocates what a chunk claims to hold before it checks that it is there.
    """
    place = len(_PNG_SIGNATURE)
    while place + 12 <= len(data) and data[place + 4 : place + 8] != b"IEND":
        place += 12 + int.from_bytes(data[place : place + 4], "big")
    if place + 12 > len(data) or data[12:16] != b"IHDR":
        raise MessageError(f"data: {len(data)} bytes of a PNG that is cut or corrupt")
    channels = 1 if data[25] == _PNG_GREY else 4
    width, height = int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")
    return width, height, channels * (1 if data[24] <= 8 else 2)


def _jpeg_size(data: bytes) -> tuple[int, int, int]:
    """Width, height and components, from the frame header (ITU-T T.81, B.2.2)."""
    place = 2
    while place + 10 <= len(data) and data[place] == 0xFF:
        marker, length = data[place + 1], int.from_bytes(data[place + 2 : place + 4], "big")
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height, width = (int.from_bytes(data[place + at : place + at + 2], "big") for at in (5, 7))
            return width, height, data[place + 9]
        place += 1 if marker == 0xFF else 2 + length  # fill bytes may stand before a marker
    raise MessageError(f"data: {len(data)} bytes of a JPEG without a frame header")


def encode_image(pixels: npt.NDArray[Any], header: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a `sensor_msgs/Image`.

    Args:
        pixels: (H, W) uint8 (mono8) or uint16 (mono16), or (H, W, 3) uint8 (rgb8).
        header: fields of the header.

    Raises:
        MessageError: another shape or type.
    """
    encodings = {(2, "uint8"): "mono8", (2, "uint16"): "mono16", (3, "uint8"): "rgb8"}
    encoding = encodings.get((pixels.ndim, pixels.dtype.name))
    if encoding is None or (pixels.ndim == 3 and pixels.shape[2] != 3):
        raise MessageError(f"no encoding for an image of shape {pixels.shape}, {pixels.dtype}")
    rows = np.ascontiguousarray(pixels)
    return {
        "header": header,
        "height": rows.shape[0],
        "width": rows.shape[1],
        "encoding": encoding,
        "is_bigendian": int(sys.byteorder == "big"),
        "step": rows.strides[0],
        "data": rows.reshape(-1).view(np.uint8).data,
    }


def _check_size(width: int, height: int) -> None:
    if not (1 <= width <= MAX_SIDE_PX and 1 <= height <= MAX_SIDE_PX):
        raise MessageError(f"width, height: expected 1 to {MAX_SIDE_PX} pixels a side, found {width}×{height}")
