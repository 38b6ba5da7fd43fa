"""Messages from fields, both kinds; poses, markers and stamps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lasso_motion_ros.core.errors import MessageError
from lasso_motion_ros.geometry.transforms import apply, rigid
from msg_adapters.images import decode_image, encode_image
from msg_adapters.markers import (
    DELETE,
    LINE_STRIP,
    TRIANGLE_LIST,
    decode_points,
    encode_delete,
    encode_line_strip,
    encode_points,
    encode_triangles,
)
from msg_adapters.messages import RosMessages, header_fields, ns_to_stamp, stamp_to_ns
from msg_adapters.poses import decode_pose, encode_pose, encode_pose_stamped, encode_pose_with_covariance_stamped
from msg_adapters.recorded_messages import RecordedMessages, jazzy_types
from msg_adapters.topics import GROUND_TRUTH, INPUTS, OUTPUTS

STAMP_NS = 1_760_000_000_133_333_333


def factories() -> list[Any]:
    found: list[Any] = [pytest.param(RecordedMessages(), id="recorded")]
    ros = pytest.param(RosMessages(), id="ros", marks=pytest.mark.ros)
    return [*found, ros]


@pytest.fixture(params=factories())
def messages(request: pytest.FixtureRequest) -> Any:
    if isinstance(request.param, RosMessages):
        pytest.importorskip("sensor_msgs.msg")
    return request.param


@given(st.integers(0, 2**31 * 10**9 - 1))
def test_stamps_are_exact(stamp_ns: int) -> None:
    message = RecordedMessages().make("builtin_interfaces/msg/Time", ns_to_stamp(stamp_ns))
    assert stamp_to_ns(message) == stamp_ns


def test_every_topic_of_the_contract_can_be_made(messages: Any) -> None:
    for topic in (*INPUTS, *OUTPUTS, *GROUND_TRUTH):
        made = messages.make(topic.type_name, {})
        if isinstance(messages, RecordedMessages):
            assert len(jazzy_types().serialize_cdr(made, topic.type_name)) > 4


def test_unknown_types_and_fields_are_named(messages: Any) -> None:
    with pytest.raises(MessageError, match="nothing_msgs/msg/Nothing"):
        messages.make("nothing_msgs/msg/Nothing", {})
    with pytest.raises(MessageError, match="no field 'clicks'"):
        messages.make("geometry_msgs/msg/PoseStamped", {"clicks": 1})
    with pytest.raises(MessageError, match="no field 'seconds'"):
        messages.make("std_msgs/msg/Header", {"stamp": {"seconds": 1}})


def test_images_pass_through_either_kind(messages: Any) -> None:
    pixels = np.arange(12, dtype=np.uint16).reshape(3, 4) * 300
    message = messages.make("sensor_msgs/msg/Image", encode_image(pixels, header_fields(STAMP_NS, "xray")))
    assert np.array_equal(decode_image(message), pixels)
    assert stamp_to_ns(message.header.stamp) == STAMP_NS


def test_fixed_arrays_and_sequences(messages: Any) -> None:
    fields = {"p": np.arange(12.0), "d": [0.0] * 5, "roi": {"width": 3}, "binning_x": 2}
    message = messages.make("sensor_msgs/msg/CameraInfo", fields)
    assert list(message.p) == list(range(12))
    assert list(message.d) == [0.0] * 5
    assert (message.roi.width, message.binning_x, message.binning_y) == (3, 2, 0)


def test_poses(messages: Any) -> None:
    transform = rigid((0.1, -0.2, 0.3), (0.01, -0.02, 0.03), (0.1, 0.0, 0.0))
    header = header_fields(STAMP_NS, "patient_table")
    pose = messages.make("geometry_msgs/msg/PoseStamped", encode_pose_stamped(transform, header))
    assert decode_pose(pose) == pytest.approx(transform)
    covariance = np.arange(36.0).reshape(6, 6)
    message = messages.make(
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        encode_pose_with_covariance_stamped(transform, covariance, header),
    )
    assert decode_pose(message) == pytest.approx(transform)
    assert list(message.pose.covariance) == list(range(36))
    assert message.header.frame_id == "patient_table"


def test_poses_that_are_none_are_refused() -> None:
    messages = RecordedMessages()
    for w, found in ((0.0, "0"), (1e200, r"1e\+200")):
        with pytest.raises(MessageError, match=f"of length 1, found {found}"):
            decode_pose(messages.make("geometry_msgs/msg/Pose", {"orientation": {"w": w}}))
    with pytest.raises(MessageError, match="not finite"):
        decode_pose(messages.make("geometry_msgs/msg/Pose", {"orientation": {"w": 1.0}, "position": {"x": np.inf}}))


def test_markers(messages: Any) -> None:
    points = np.array([[0.0, 0.1, 0.2], [0.3, 0.4, 0.5], [0.6, 0.7, 0.8]])
    header = header_fields(STAMP_NS, "patient_table")
    kind = "visualization_msgs/msg/Marker"
    strip = messages.make(kind, encode_line_strip(points, header, "catheter"))
    assert (strip.type, strip.action, strip.ns) == (LINE_STRIP, 0, "catheter")
    assert strip.scale.x > 0.0
    assert strip.color.a > 0.0
    assert strip.pose.orientation.w == 1.0
    assert np.array_equal(decode_points(strip), points)
    assert np.array_equal(decode_points(messages.make(kind, encode_points(points, header, "targets"))), points)
    mesh = messages.make(kind, encode_triangles(points, np.array([[0, 1, 2], [2, 1, 0]]), header, "surface"))
    assert mesh.type == TRIANGLE_LIST
    assert np.array_equal(decode_points(mesh), points[[0, 1, 2, 2, 1, 0]])
    assert messages.make(kind, encode_delete(header, "catheter")).action == DELETE


def test_a_markers_own_pose_is_applied() -> None:
    transform = rigid((0.0, 0.0, np.pi / 2), (1.0, 0.0, 0.0))
    fields = encode_points(np.array([[1.0, 0.0, 0.0]]), {}, "x") | {"pose": encode_pose(transform)}
    message = RecordedMessages().make("visualization_msgs/msg/Marker", fields)
    assert decode_points(message) == pytest.approx(apply(transform, np.array([[1.0, 0.0, 0.0]])))
