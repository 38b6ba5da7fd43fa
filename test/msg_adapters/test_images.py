"""Pixels of image messages: encodings, byte orders, padded rows, what is refused."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.message_inputs import MESSAGES

from lasso_motion_ros.core.errors import MessageError
from msg_adapters.crop import Crop
from msg_adapters.images import decode_grey, decode_image, encode_image
from msg_adapters.messages import header_fields


def message(**fields: Any) -> Any:
    """2 rows of 3 pixels."""
    standard = {"height": 2, "width": 3, "encoding": "mono8", "step": 3, "data": bytes(range(6))}
    return MESSAGES.make("sensor_msgs/msg/Image", standard | fields)


@pytest.mark.parametrize("encoding", ["mono8", "8UC1"])
def test_eight_bits(encoding: str) -> None:
    assert decode_image(message(encoding=encoding)).tolist() == [[0, 1, 2], [3, 4, 5]]


@pytest.mark.parametrize("encoding", ["mono16", "16UC1"])
@pytest.mark.parametrize(("big", "data"), [(0, b"\x01\x02\x00\x10\xff\x0f"), (1, b"\x02\x01\x10\x00\x0f\xff")])
def test_sixteen_bits_of_either_byte_order(encoding: str, big: int, data: bytes) -> None:
    pixels = decode_image(message(height=1, step=6, encoding=encoding, is_bigendian=big, data=data))
    assert pixels.tolist() == [[0x201, 0x1000, 0xFFF]]
    assert pixels.dtype == np.uint16
    assert pixels.dtype.isnative


@pytest.mark.parametrize("data", [b"\x00\x01\x02xx\x03\x04\x05xx", b"\x00\x01\x02xx\x03\x04\x05"])
def test_padded_rows_with_or_without_the_last_padding(data: bytes) -> None:
    assert decode_image(message(step=5, data=data)).tolist() == [[0, 1, 2], [3, 4, 5]]


def test_rows_of_odd_length_in_bytes_hold_sixteen_bit_pixels() -> None:
    data = b"\x01\x00\x02\x00\x03\x00x\x04\x00\x05\x00\x06\x00x"
    pixels = decode_image(message(step=7, encoding="mono16", data=data))
    assert pixels.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert pixels.flags.aligned


def test_data_are_not_copied() -> None:
    one = message()
    one.data = np.frombuffer(bytearray(range(6)), np.uint8)
    pixels = decode_image(one)
    assert np.shares_memory(pixels, one.data)
    with pytest.raises(ValueError, match="read-only"):
        pixels[0, 0] = 1


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"encoding": "32FC1"}, "encoding: expected mono8, 8UC1, mono16, 16UC1, rgb8, bgr8, rgba8, bgra8, yuv422"),
        ({"encoding": "rgb8"}, "step: a row of 3 rgb8 pixels has 9 bytes, found 3"),
        ({"height": 0}, "expected 1 to 8192 pixels a side, found 3×0"),
        ({"width": 9000, "step": 9000}, "expected 1 to 8192 pixels a side, found 9000×2"),
        ({"step": 2}, "step: a row of 3 mono8 pixels has 3 bytes, found 2"),
        ({"data": bytes(5)}, "data: expected 6 bytes (step × height), found 5"),
        ({"data": bytes(7)}, "data: expected 6 bytes (step × height), found 7"),
        ({"data": b""}, "found 0"),
    ],
)
def test_what_does_not_fit_is_refused(fields: dict[str, Any], text: str) -> None:
    with pytest.raises(MessageError) as caught:
        decode_image(message(**fields))
    assert text in str(caught.value)


@given(st.integers(1, 9), st.integers(1, 9), st.sampled_from([np.uint8, np.uint16]))
def test_encoding_and_decoding_are_inverse(height: int, width: int, dtype: type) -> None:
    pixels = np.random.default_rng(height * 10 + width).integers(0, np.iinfo(dtype).max, (height, width), dtype=dtype)
    assert np.array_equal(decode_image(MESSAGES.make("sensor_msgs/msg/Image", encode_image(pixels, {}))), pixels)


# A pixel of red, green and blue, and its luminance: 0.299 R + 0.587 G + 0.114 B.
COLOUR, LUMINANCE = (200, 100, 50), 124
PIXEL = {
    "rgb8": (200, 100, 50),
    "bgr8": (50, 100, 200),
    "rgba8": (200, 100, 50, 7),
    "bgra8": (50, 100, 200, 7),
    "yuv422": (90, 124),
    "uyvy": (90, 124),
    "yuv422_yuy2": (124, 90),
    "yuyv": (124, 90),
}


@pytest.mark.parametrize("padding", [0, 3])
@pytest.mark.parametrize("encoding", PIXEL)
def test_of_colour_the_luminance_is_taken(encoding: str, padding: int) -> None:
    row = bytes(PIXEL[encoding]) * 3 + bytes(padding)
    found = decode_grey(message(encoding=encoding, step=len(row), data=row * 2))
    assert found.pixels.tolist() == [[LUMINANCE] * 3] * 2
    assert (found.pixels.dtype, found.colour) == (np.uint8, encoding)
    assert decode_grey(message()).colour == ""


@pytest.mark.parametrize("encoding", ["mono8", "rgb8", "yuv422_yuy2"])
def test_a_crop_is_the_same_pixels(encoding: str) -> None:
    size = len(PIXEL.get(encoding, (0,)))
    data = np.random.default_rng(3).integers(0, 255, (6, 8 * size), dtype=np.uint8)
    one = message(encoding=encoding, height=6, width=8, step=8 * size, data=data.tobytes())
    assert np.array_equal(decode_image(one, Crop(3, 1, 4, 5)), decode_image(one)[1:6, 3:7])
    with pytest.raises(MessageError, match=r"crop: 4×5 pixels at \(5, 1\) reach beyond the picture, which has 8×6"):
        decode_image(one, Crop(5, 1, 4, 5))


@pytest.mark.parametrize("kind", ["png", "jpg"])
def test_compressed_colour_is_luminance_too(kind: str) -> None:
    picture = np.full((16, 16, 3), COLOUR[::-1], np.uint8)
    found = decode_grey(compressed(cv2.imencode(f".{kind}", picture)[1].tobytes(), kind))
    assert np.abs(found.pixels.astype(int) - LUMINANCE).max() <= (0 if kind == "png" else 2)
    assert found.colour


def test_colour_is_written() -> None:
    fields = encode_image(np.zeros((2, 3, 3), np.uint8), {})
    assert (fields["encoding"], fields["step"], len(bytes(fields["data"]))) == ("rgb8", 9, 18)
    with pytest.raises(MessageError):
        encode_image(np.zeros((2, 3)), {})


def compressed(data: bytes, kind: str = "png") -> Any:
    return MESSAGES.make("sensor_msgs/msg/CompressedImage", {"format": kind, "data": data})


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_png_is_exact(dtype: type) -> None:
    pixels = (np.arange(12).reshape(3, 4) * 20).astype(dtype)
    assert np.array_equal(decode_image(compressed(cv2.imencode(".png", pixels)[1].tobytes())), pixels)


def test_jpeg_is_near_and_grey_in_three_channels_is_grey() -> None:
    pixels = np.full((16, 16), 77, np.uint8)
    data = cv2.imencode(".jpg", cv2.merge([pixels] * 3))[1].tobytes()
    assert np.abs(decode_image(compressed(data, "jpeg")).astype(int) - 77).max() <= 2


def test_broken_pictures_are_refused() -> None:
    good = cv2.imencode(".png", np.zeros((8, 8), np.uint8))[1].tobytes()
    huge = good[:16] + (60_000).to_bytes(4, "big") * 2 + good[24:]
    for data, text in [
        (b"GIF89a", "expected png or jpeg"),
        (b"", "expected png or jpeg"),
        (good[:30], "cut or corrupt"),
        (good[:41] + bytes(len(good) - 53) + good[-12:], "cut or corrupt|cannot be decoded"),
        (huge, "found 60000×60000"),
    ]:
        with pytest.raises(MessageError, match=text):
            decode_image(compressed(data))


def test_a_jpeg_that_claims_to_be_huge_is_refused_before_it_is_unpacked() -> None:
    data = bytearray(cv2.imencode(".jpg", np.zeros((16, 16), np.uint8))[1].tobytes())
    frame_header = data.index(b"\xff\xc0")
    data[frame_header + 5 : frame_header + 9] = (60000).to_bytes(2, "big") * 2
    fields = {"header": header_fields(1), "format": "jpeg", "data": bytes(data)}
    message = MESSAGES.make("sensor_msgs/msg/CompressedImage", fields)
    with pytest.raises(MessageError, match="found 60000×60000"):
        decode_image(message)
    message.data = np.frombuffer(bytes(data[:frame_header]), np.uint8)
    with pytest.raises(MessageError, match="without a frame header"):
        decode_image(message)
