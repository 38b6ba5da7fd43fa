"""Where a camera stands, from TF, for calibrations whose `p` is a plain camera matrix."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from rclpy.node import Node

from lasso_motion_ros.core.errors import MessageError
from lasso_motion_ros.geometry.transforms import rotation_from_quaternion
from msg_adapters.calibrations import Extrinsics


def tf_extrinsics(node: Node, world_frame: str) -> Extrinsics | None:
    """Looks up x_camera = T · x_world at an image's stamp, never blocking; None where `tf2_ros` is not installed.

    Args:
        node: listens to /tf and /tf_static.
        world_frame: the frame of the poses.
    """
    try:
        import tf2_ros
        from rclpy.time import Time
    except ImportError:
        return None
    buffer = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer, node)

    def look_up(frame_id: str, stamp_ns: int, _listener: Any = listener) -> npt.NDArray[np.float64]:
        try:
            found = buffer.lookup_transform(frame_id, world_frame, Time(nanoseconds=stamp_ns))
        except tf2_ros.TransformException as error:
            raise MessageError(f"p: a plain camera matrix [K′|0], whose pose TF does not know: {error}") from error
        return decode_transform(found.transform)

    return look_up


def decode_transform(message: Any) -> npt.NDArray[np.float64]:
    """The (4, 4) matrix of a `geometry_msgs/Transform`: x_target = T · x_source of `lookup_transform(target, source)`.

    Raises:
        MessageError: a number that is not finite, or a quaternion that is not of length 1.
    """
    rotation = np.array([message.rotation.x, message.rotation.y, message.rotation.z, message.rotation.w])
    translation = np.array([message.translation.x, message.translation.y, message.translation.z])
    if not (np.all(np.isfinite(translation)) and abs(np.linalg.norm(rotation) - 1.0) < 1e-3):
        raise MessageError(f"transform: expected finite numbers and a unit quaternion, found {translation}, {rotation}")
    transform = np.eye(4)
    transform[:3, :3] = rotation_from_quaternion(rotation)
    transform[:3, 3] = translation
    return transform
