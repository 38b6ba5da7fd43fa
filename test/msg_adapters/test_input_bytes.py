"""Images and calibrations read from their bytes: as a deserialiser reads them, without a copy; what is refused."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.message_inputs import MESSAGES

from lasso_motion_ros.core.errors import MessageError
from msg_adapters.images import decode_image
from msg_adapters.input_bytes import READERS, read_camera_info, read_image
from msg_adapters.recorded_messages import jazzy_types
from msg_adapters.topics import IMAGE_TYPE

CALIBRATION_TYPE = "sensor_msgs/msg/CameraInfo"


def serialised(*, little_endian: bool = True, **fields: Any) -> bytes:
    """An Image as a middleware sends it."""
    stamp = {"sec": 1_760_000_000, "nanosec": 123_456_789}
    standard = {
        "header": {"stamp": stamp, "frame_id": "xray"},
        "height": 2,
        "width": 3,
        "encoding": "mono16",
        "step": 6,
        "data": bytes(range(12)),
    }
    made = MESSAGES.make(IMAGE_TYPE, standard | fields)
    return bytes(jazzy_types().serialize_cdr(made, IMAGE_TYPE, little_endian=little_endian))


def calibration(fields: Mapping[str, Any], *, little_endian: bool = True) -> bytes:
    """Likewise a CameraInfo."""
    made = MESSAGES.make(CALIBRATION_TYPE, fields)
    return bytes(jazzy_types().serialize_cdr(made, CALIBRATION_TYPE, little_endian=little_endian))


@given(
    st.booleans(),
    st.text(st.characters(exclude_characters="\x00", exclude_categories=["Cs"]), max_size=9),
    st.sampled_from(["mono8", "8UC1", "mono16", "rgb8", "yuv422_yuy2", "", "Übel"]),
    st.integers(0, 1),
    st.integers(-(2**31), 2**31 - 1),
    st.binary(max_size=9),
)
def test_all_fields_are_those_of_a_deserialiser(
    little: bool, frame_id: str, encoding: str, big: int, sec: int, data: bytes
) -> None:
    header = {"stamp": {"sec": sec, "nanosec": 7}, "frame_id": frame_id}
    message = serialised(little_endian=little, header=header, encoding=encoding, is_bigendian=big, data=data, step=5)
    read, expected = read_image(message), jazzy_types().deserialize_cdr(message, IMAGE_TYPE)
    assert (read.header.stamp.sec, read.header.stamp.nanosec) == (sec, 7)
    assert read.header.frame_id == expected.header.frame_id
    assert (read.height, read.width, read.encoding) == (expected.height, expected.width, expected.encoding)
    assert (read.is_bigendian, read.step) == (expected.is_bigendian, expected.step)
    assert bytes(read.data) == data


def test_pixels_are_not_copied() -> None:
    message = serialised()
    pixels = decode_image(read_image(message))
    assert pixels.tolist() == [[0x100, 0x302, 0x504], [0x706, 0x908, 0xB0A]]
    assert np.shares_memory(pixels, np.frombuffer(message, np.uint8))


@given(st.booleans(), st.lists(st.floats(allow_nan=False), max_size=5), st.text("abü", max_size=9), st.booleans())
def test_a_calibration_is_that_of_a_deserialiser(little: bool, d: list[float], model: str, rectified: bool) -> None:
    fields = {
        "header": {"stamp": {"sec": 7, "nanosec": 8}, "frame_id": model},
        "height": 2,
        "width": 3,
        "distortion_model": model,
        "d": d,
        "k": np.arange(9.0),
        "r": -np.arange(9.0),
        "p": np.arange(12.0),
        "binning_x": 4,
        "binning_y": 5,
        "roi": {"x_offset": 6, "y_offset": 7, "height": 8, "width": 9, "do_rectify": rectified},
    }
    message = calibration(fields, little_endian=little)
    read, expected = read_camera_info(message), jazzy_types().deserialize_cdr(message, CALIBRATION_TYPE)
    assert vars(read.header.stamp) == {"sec": 7, "nanosec": 8}
    assert read.header.frame_id == read.distortion_model == model
    assert (read.height, read.width, read.binning_x, read.binning_y) == (2, 3, 4, 5)
    assert vars(read.roi) == {name: getattr(expected.roi, name) for name in vars(read.roi)}
    for name in "dkrp":
        np.testing.assert_array_equal(getattr(read, name), getattr(expected, name))
        assert getattr(read, name).dtype == np.float64


@pytest.mark.parametrize("little_endian", [False, True])
@pytest.mark.parametrize("type_name", READERS)
def test_what_is_cut_short_is_refused(type_name: str, little_endian: bool) -> None:
    made = {IMAGE_TYPE: serialised, CALIBRATION_TYPE: partial(calibration, {"d": np.zeros(5)})}
    message = made[type_name](little_endian=little_endian)
    READERS[type_name](message)
    for length in range(len(message)):
        with pytest.raises(MessageError, match=r"^an? \w+ (of \d+ bytes that is cut short|in CDR begins with)"):
            READERS[type_name](message[:length])


def test_another_encapsulation_is_refused() -> None:
    with pytest.raises(MessageError, match="begins with 0000 or 0001, found 0003"):
        read_image(b"\x00\x03" + serialised()[2:])
    with pytest.raises(MessageError, match="found nothing"):
        read_image(b"")


def test_lengths_beyond_the_message_are_refused() -> None:
    message = bytearray(serialised())
    message[12:16] = b"\xff\xff\xff\xff"  # of the frame's name
    with pytest.raises(MessageError, match="an image of 64 bytes that is cut short or corrupt"):
        read_image(bytes(message))
