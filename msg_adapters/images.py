"""X-ray images between `sensor_msgs/Image` (or CompressedImage) and NumPy arrays."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import MessageError

Pixels = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]

MAX_SIDE_PX = 8192
MAX_UNPACKED_BYTES = 2 * MAX_SIDE_PX**2
_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_PNG_GREY = 0
_BYTES_PER_PIXEL = {"mono8": 1, "8UC1": 1, "mono16": 2, "16UC1": 2}


def decode_image(message: Any) -> Pixels:
    """The pixels of a `sensor_msgs/Image` or `CompressedImage`.

    Args:
        message: an Image of encoding mono8, 8UC1, mono16 or 16UC1, either endianness, rows padded or not; or what
            `decode_compressed_image` takes.

    Returns:
        (H, W) uint8 or uint16 in native byte order, read-only; a view of the message's data where its bytes
        already lie that way.

    Raises:
        MessageError: another encoding, a size out of bounds, or data that do not fit height and step.
    """
    if not hasattr(message, "encoding"):
        return decode_compressed_image(message)
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
    order = ">" if message.is_bigendian else "<"
    dtype = np.dtype(np.uint8) if size == 1 else np.dtype(f"{order}u2")
    view: Any = np.ndarray((height, width), dtype=dtype, buffer=data.data, strides=(step, size))
    if not view.dtype.isnative or not view.flags.aligned:
        view = view.astype(view.dtype.newbyteorder("="))
    view.flags.writeable = False
    return view  # type: ignore[no-any-return]


def decode_compressed_image(message: Any) -> Pixels:
    """The pixels of a `sensor_msgs/CompressedImage` (PNG or JPEG).

    Returns:
        (H, W) uint8 or uint16, read-only.

    Raises:
        MessageError: not PNG or JPEG, not decodable, or a colour picture whose channels differ.
    """
    data = np.frombuffer(message.data, dtype=np.uint8)
    whole = data.tobytes()
    # The size is checked before anything is unpacked.
    if whole.startswith(_PNG_SIGNATURE):
        width, height, pixel_bytes = _png_size(whole)
    elif whole.startswith(b"\xff\xd8\xff"):
        width, height, pixel_bytes = _jpeg_size(whole)
    else:
        raise MessageError(f"format: expected png or jpeg, found {message.format!r}")
    _check_size(width, height)
    if width * height * pixel_bytes > MAX_UNPACKED_BYTES:
        raise MessageError(f"data: expected a grey image, found {width}×{height} pixels of {pixel_bytes} bytes")
    try:
        pixels = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    except cv2.error:
        pixels = None
    if pixels is None:
        raise MessageError(f"data: {data.size} bytes that cannot be decoded as {message.format!r}")
    if pixels.ndim == 3:
        if pixels.shape[2] < 3 or np.any(pixels[..., :3] != pixels[..., :1]):
            raise MessageError(f"data: expected a grey image, found {pixels.shape[2]} different channels")
        pixels = np.ascontiguousarray(pixels[..., 0])
    if pixels.dtype not in (np.uint8, np.uint16):
        raise MessageError(f"data: expected 8 or 16 bits a pixel, found {pixels.dtype}")
    _check_size(pixels.shape[1], pixels.shape[0])
    pixels.flags.writeable = False
    return pixels


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
