"""Answers written as bytes: the very bytes that a serialiser makes of the same fields."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.message_inputs import MESSAGES

from lasso_motion_ros.core.errors import MessageError
from lasso_motion_ros.geometry.transforms import rigid
from msg_adapters.answer_bytes import answer_bytes
from msg_adapters.markers import encode_delete, encode_line_strip
from msg_adapters.messages import header_fields
from msg_adapters.poses import encode_pose_stamped, encode_pose_with_covariance_stamped
from msg_adapters.recorded_messages import jazzy_types

STAMPS = st.integers(0, 2**31 * 1_000_000_000 - 1)
NAMES = st.text(st.characters(exclude_characters="\x00", exclude_categories=["Cs"]), max_size=9)
TRANSFORM = rigid((0.1, -0.2, 0.3), (1e-3, -2e-3, 3e-3))


def serialised(type_name: str, fields: Mapping[str, Any]) -> bytes:
    return bytes(jazzy_types().serialize_cdr(MESSAGES.make(type_name, fields), type_name))


def check(type_name: str, fields: Mapping[str, Any]) -> None:
    assert answer_bytes(type_name, fields) == serialised(type_name, fields)


@given(NAMES)
def test_a_string(text: str) -> None:
    check("std_msgs/msg/String", {"data": text})


@given(STAMPS, NAMES)
def test_headers_and_poses(stamp_ns: int, frame_id: str) -> None:
    header = header_fields(stamp_ns, frame_id)
    covariance = np.arange(36.0).reshape(6, 6)
    check("std_msgs/msg/Header", header)
    check("geometry_msgs/msg/PoseStamped", encode_pose_stamped(TRANSFORM, header))
    fields = encode_pose_with_covariance_stamped(TRANSFORM, covariance, header)
    check("geometry_msgs/msg/PoseWithCovarianceStamped", fields)


@given(STAMPS, NAMES, NAMES, st.integers(0, 5))
def test_markers(stamp_ns: int, frame_id: str, namespace: str, count: int) -> None:
    header, points = header_fields(stamp_ns, frame_id), 0.1 * np.arange(3.0 * count).reshape(count, 3)
    check("visualization_msgs/msg/Marker", encode_line_strip(points, header, namespace))
    check("visualization_msgs/msg/Marker", encode_line_strip(points, header, namespace) | {"id": 7})
    check("visualization_msgs/msg/Marker", encode_delete(header, namespace))


def test_the_middleware_reads_them() -> None:
    serialization = pytest.importorskip("rclpy.serialization", reason="needs ROS 2")
    from visualization_msgs.msg import Marker

    points = np.array([[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]])
    fields = encode_line_strip(points, header_fields(1_500_000_000, "table"), "catheter")
    data = answer_bytes("visualization_msgs/msg/Marker", fields)
    read = serialization.deserialize_message(data, Marker)
    assert (read.header.frame_id, read.ns, read.header.stamp.nanosec) == ("table", "catheter", 500_000_000)
    assert [(point.x, point.y, point.z) for point in read.points] == [tuple(row) for row in points.tolist()]
    assert (read.scale.x, read.color.a, read.texture.format, read.mesh_file.filename) == (1e-3, 1.0, "", "")


def test_other_types_are_refused() -> None:
    with pytest.raises(MessageError, match=r"no answer is a sensor_msgs/msg/Image"):
        answer_bytes("sensor_msgs/msg/Image", {})
