"""Rigid transforms between 4×4 matrices and pose messages."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import MessageError
from lasso_motion_ros.geometry.transforms import quaternion_from_rotation, rotation_from_quaternion

Array = npt.NDArray[np.float64]


def encode_pose(transform: Array) -> dict[str, Any]:
    """The fields of a `geometry_msgs/Pose` for a rigid (4, 4) transform, metres."""
    x, y, z, w = quaternion_from_rotation(transform[:3, :3])
    return {
        "position": {name: float(value) for name, value in zip("xyz", transform[:3, 3], strict=True)},
        "orientation": {"x": float(x), "y": float(y), "z": float(z), "w": float(w)},
    }


def encode_transform_stamped(transform: Array, header: Mapping[str, Any], child: str) -> dict[str, Any]:
    """The fields of a `geometry_msgs/TransformStamped`: x_parent = T · x_child; the header's frame is the parent."""
    pose = encode_pose(transform)
    placed = {"translation": pose["position"], "rotation": pose["orientation"]}
    return {"header": header, "child_frame_id": child, "transform": placed}


def encode_pose_stamped(transform: Array, header: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a `geometry_msgs/PoseStamped`."""
    return {"header": header, "pose": encode_pose(transform)}


def encode_pose_with_covariance_stamped(
    transform: Array, covariance: Array, header: Mapping[str, Any]
) -> dict[str, Any]:
    """The fields of a `geometry_msgs/PoseWithCovarianceStamped`.

    Args:
        transform: (4, 4) rigid, metres.
        covariance: (6, 6), ROS order x, y, z, rotation about the fixed axes x, y, z (m, rad).
        header: fields of the header.
    """
    flat = np.asarray(covariance, dtype=np.float64).reshape(36)
    return {"header": header, "pose": {"pose": encode_pose(transform), "covariance": flat}}


def decode_covariance(message: Any) -> Array | None:
    """The (6, 6) covariance of a PoseWithCovarianceStamped; None where it says that it knows none (all zero).

    Raises:
        MessageError: values that are not finite, or a matrix that is none of a covariance.
    """
    covariance = np.array(message.pose.covariance, dtype=np.float64).reshape(6, 6)
    if not np.any(covariance):
        return None
    if fault := covariance_fault(covariance):
        raise MessageError(f"pose.covariance: {fault}")
    return covariance


def covariance_fault(covariance: Array) -> str:
    """What keeps a matrix (6, 6) from being a covariance, in words; empty where nothing does."""
    scale = np.max(np.abs(covariance))
    if not (np.isfinite(scale) and np.allclose(covariance, covariance.T, atol=1e-6 * scale)):
        return "expected a symmetric matrix of finite values"
    if np.linalg.eigvalsh(covariance)[0] < -1e-6 * scale:
        return "expected a covariance, found a negative variance"
    return ""


def decode_pose(message: Any) -> Array:
    """The (4, 4) transform of a Pose, PoseStamped or PoseWithCovarianceStamped, metres.

    Raises:
        MessageError: values that are not finite, or a quaternion whose length is nowhere near 1.
    """
    while hasattr(message, "pose"):
        message = message.pose
    orientation = message.orientation
    quaternion = np.array([orientation.x, orientation.y, orientation.z, orientation.w], dtype=np.float64)
    position = np.array([message.position.x, message.position.y, message.position.z], dtype=np.float64)
    if not (np.all(np.isfinite(quaternion)) and np.all(np.isfinite(position))):
        raise MessageError("pose: a value is not finite")
    length = math.hypot(*quaternion)
    if not 1e-6 <= length <= 1e6:
        raise MessageError(f"pose.orientation: expected a quaternion of length 1, found {length:g}")
    return transform_from(position, quaternion)


def transform_from(position: Array, quaternion: Array) -> Array:
    """The (4, 4) transform of a position (3,), metres, and a quaternion (4,): x, y, z, w, of any length but zero."""
    transform = np.eye(4)
    transform[:3, :3] = rotation_from_quaternion(quaternion)
    transform[:3, 3] = position
    return transform
