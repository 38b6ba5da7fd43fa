"""Stamps in serialised messages: moved in either byte order, and nothing else is."""

import struct

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from geometry_msgs.msg import PolygonStamped
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header, String

from lasso_motion_ros.tools.later_stamps import is_stamped, with_later_stamp


def test_which_messages_begin_with_a_stamp() -> None:
    assert all(map(is_stamped, (Image, CameraInfo, PolygonStamped, Header)))
    assert not is_stamped(String)


def test_by_hand() -> None:
    info = CameraInfo(width=7, distortion_model="plumb_bob")
    info.header.frame_id = "detector_a"
    info.header.stamp.sec, info.header.stamp.nanosec = 10, 900_000_000
    later = deserialize_message(with_later_stamp(serialize_message(info), 2_300_000_000), CameraInfo)
    assert (later.header.stamp.sec, later.header.stamp.nanosec) == (13, 200_000_000)
    later.header.stamp = info.header.stamp
    assert later == info


def test_no_stamp_stays_none_and_the_other_byte_order_is_read() -> None:
    data = serialize_message(Header(frame_id="x"))
    assert with_later_stamp(data, 5) == data
    big = b"\0\0\0\0" + struct.pack(">iI", 1, 5) + b"rest"
    assert with_later_stamp(big, 1_000_000_000) == b"\0\0\0\0" + struct.pack(">iI", 2, 5) + b"rest"
