"""Where a camera stands, from a TF message."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from message_inputs import MESSAGES, projection

from lasso_motion_ros.errors import MessageError
from lasso_motion_ros.nodes.tf_extrinsics import decode_transform, tf_extrinsics
from lasso_motion_ros.transforms import quaternion_from_rotation
from msg_adapters.calibrations import decode_camera_info, encode_camera_info
from msg_adapters.messages import header_fields


def message(rotation: object, translation: object) -> SimpleNamespace:
    x, y, z, w = rotation
    return SimpleNamespace(
        rotation=SimpleNamespace(x=x, y=y, z=z, w=w),
        translation=SimpleNamespace(**dict(zip("xyz", translation, strict=True))),
    )


def test_a_quarter_turn_by_hand() -> None:
    half = np.sqrt(0.5)
    expected = [[0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]]
    np.testing.assert_allclose(decode_transform(message((0, 0, half, half), (0.1, 0.2, 0.3))), expected, atol=1e-12)


@pytest.mark.parametrize("bad", [((0, 0, 0, 0), (0, 0, 0)), ((0, 0, 0, 1), (np.nan, 0, 0))])
def test_what_is_no_transform_is_refused(bad: tuple) -> None:
    with pytest.raises(MessageError, match="transform: expected finite numbers"):
        decode_transform(message(*bad))


def test_a_plain_camera_matrix_with_it_is_the_full_projection() -> None:
    full = projection("a")
    k, rotation, translation = full.decompose()
    plain = np.column_stack([k, np.zeros(3)])
    fields = encode_camera_info(full, header_fields(7, "source_a")) | {"p": plain.reshape(-1)}
    asked: list[tuple[str, int]] = []

    def look_up(frame_id: str, stamp_ns: int) -> np.ndarray:
        asked.append((frame_id, stamp_ns))
        return decode_transform(message(quaternion_from_rotation(rotation), translation))

    decoded = decode_camera_info(MESSAGES.make("sensor_msgs/msg/CameraInfo", fields), extrinsics=look_up)
    assert asked == [("source_a", 7)]
    point = np.array([[0.01, -0.02, 0.03]])
    np.testing.assert_allclose(decoded.project(point), full.project(point), atol=1e-6)


def test_without_tf2_there_is_none() -> None:
    pytest.importorskip("rclpy")
    try:
        import tf2_ros  # noqa: F401
    except ImportError:
        assert tf_extrinsics(None, "patient_table") is None
