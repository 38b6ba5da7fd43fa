"""Where a camera stands, from a TF message."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from support.message_inputs import MESSAGES, projection

from lasso_motion_ros.core.errors import MessageError
from lasso_motion_ros.geometry.transforms import quaternion_from_rotation
from lasso_motion_ros.nodes.tf_extrinsics import decode_transform, tf_extrinsics
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


def test_the_look_up_asks_for_the_camera_in_the_world_at_the_stamp(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a stand-in for `tf2_ros`: what is asked, that it does not block, and what becomes of its errors."""
    asked: list[tuple] = []

    class TransformException(Exception):  # noqa: N818 - its name in tf2_ros
        pass

    class Buffer:
        def lookup_transform(self, *words: object) -> SimpleNamespace:
            asked.append(words)
            if words[0] == "elsewhere":
                raise TransformException('"elsewhere" passed to lookupTransform does not exist')
            return SimpleNamespace(transform=message((0, 0, 0, 1), (0.1, 0.2, 0.3)))

    listening: list[tuple] = []
    stand_in = SimpleNamespace(
        Buffer=Buffer, TransformListener=lambda *words: listening.append(words), TransformException=TransformException
    )
    monkeypatch.setitem(sys.modules, "tf2_ros", stand_in)
    look_up = tf_extrinsics("the node", "patient_table")
    assert look_up is not None
    assert listening[0][1] == "the node"
    np.testing.assert_allclose(look_up("source_a", 7_000_000_001)[:3, 3], [0.1, 0.2, 0.3])
    target, source, time = asked[0]  # and no timeout: it never waits
    assert (target, source, time.nanoseconds) == ("source_a", "patient_table", 7_000_000_001)
    with pytest.raises(MessageError, match='whose pose TF does not know: "elsewhere" passed to'):
        look_up("elsewhere", 1)


def test_without_tf2_there_is_none() -> None:
    pytest.importorskip("rclpy")
    try:
        import tf2_ros  # noqa: F401
    except ImportError:
        assert tf_extrinsics(None, "patient_table") is None
