"""Calibration between `sensor_msgs/CameraInfo` and the method's projection.

`p` is the full 3×4 projection from world metres to pixels of the full, unbinned detector image, of any scale
and sign; `binning_x/y` and `roi` say which part of that image was published.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import GeometryError, MessageError
from lasso_motion_ros.geometry.projection import Projection
from msg_adapters.images import MAX_SIDE_PX
from msg_adapters.messages import stamp_to_ns

Array = npt.NDArray[np.float64]
Extrinsics = Callable[[str, int], Array]
"""(frame_id, stamp_ns) → (4, 4) T with x_camera = T · x_world; raises MessageError where it is not known."""

SOURCE_MIN_M, SOURCE_MAX_M = 0.3, 2.0
_NEGLIGIBLE = 1e-9


def decode_camera_info(
    message: Any, image_shape: tuple[int, int] | None = None, extrinsics: Extrinsics | None = None
) -> Projection:
    """The projection to the *published* image's pixels (binning and region of interest applied).

    Args:
        message: the CameraInfo.
        image_shape: (height, width) of its image; checked when given.
        extrinsics: where the pose of a plain camera matrix `p` = [K′|0] comes from; without it such a matrix
            is refused.

    Raises:
        MessageError: named by field: lens distortion; a singular or non-finite matrix; a stereo-style or
            plain camera matrix; a source not 0.3 to 2 m from the world origin; another image size.
    """
    width, height = int(message.width), int(message.height)
    if not (1 <= width <= MAX_SIDE_PX and 1 <= height <= MAX_SIDE_PX):
        raise MessageError(f"width, height: expected 1 to {MAX_SIDE_PX} pixels a side, found {width}×{height}")
    _check_distortion(np.asarray(message.d, dtype=np.float64))
    matrix = _full_matrix(message, extrinsics)
    try:
        detector = Projection(matrix, width, height)
    except GeometryError as error:
        raise MessageError(f"p: {error}") from error
    check_source(detector)
    return _published(detector, message, image_shape)


def needs_pose(message: Any) -> bool:
    """Whether a CameraInfo's `p` is a plain camera matrix, whose pose comes from elsewhere and may change by itself."""
    matrix = np.asarray(message.p, dtype=np.float64)
    return matrix.size == 12 and bool(np.all(np.isfinite(matrix))) and _is_camera_matrix(matrix.reshape(3, 4))


def encode_camera_info(projection: Projection, header: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of the CameraInfo of an unbinned, uncropped image; `k` and `r` agree with `p`."""
    k, rotation, _ = projection.decompose()
    return {
        "header": header,
        "height": projection.height,
        "width": projection.width,
        "distortion_model": "plumb_bob",
        "d": np.zeros(5),
        "k": k.reshape(-1),
        "r": rotation.reshape(-1),
        "p": np.array(projection.matrix).reshape(-1),
    }


def check_source(detector: Projection) -> None:
    """Check that the source is where a C-arm's can be.

    Raises:
        MessageError: it is not 0.3 to 2 m from the world origin.
    """
    distance = float(np.linalg.norm(detector.source))
    if SOURCE_MIN_M <= distance <= SOURCE_MAX_M:
        return
    hint = ""
    if SOURCE_MIN_M <= distance / 1e3 <= SOURCE_MAX_M:
        hint = "; the matrix looks like millimetres, metres are expected"
    elif SOURCE_MIN_M <= distance / 1e2 <= SOURCE_MAX_M:
        hint = "; the matrix looks like centimetres, metres are expected"
    raise MessageError(
        f"p: expected the source {SOURCE_MIN_M:g} to {SOURCE_MAX_M:g} m from the world origin,"
        f" found {distance:.4g} m{hint}"
    )


def encode_plain_camera(k: Array, width: int, height: int, header: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of the CameraInfo of a plain camera: `p` = [K|0], its pose elsewhere (TF)."""
    return {
        "header": header,
        "height": height,
        "width": width,
        "distortion_model": "plumb_bob",
        "d": np.zeros(5),
        "k": k.reshape(-1),
        "r": np.eye(3).reshape(-1),
        "p": np.column_stack([k, np.zeros(3)]).reshape(-1),
    }


def _check_distortion(distortion: Array) -> None:
    if np.any(distortion != 0.0):  # also true of NaN
        raise MessageError(
            f"d: expected all zero (images corrected before), found {np.array2string(distortion, precision=4)}"
        )


def _full_matrix(message: Any, extrinsics: Extrinsics | None) -> Array:
    """The (3, 4) matrix from world metres to pixels of the full detector."""
    matrix = np.asarray(message.p, dtype=np.float64)
    if matrix.size != 12:
        raise MessageError(f"p: expected 12 values (3×4, row by row), found {matrix.size}")
    matrix = matrix.reshape(3, 4)
    if not np.all(np.isfinite(matrix)):
        raise MessageError("p: expected 12 finite values, found some that are not")
    if not np.any(matrix):
        raise MessageError("p: expected a projection matrix, found all zero (an uncalibrated camera)")
    if not _is_camera_matrix(matrix):
        return matrix
    left, column = matrix[:, :3], matrix[:, 3]
    if np.any(np.abs(column[:2]) > _NEGLIGIBLE * np.abs(np.diag(left)[:2])):
        raise MessageError(
            "p: a stereo-style matrix [K′|−f·B 0 0]; expected the full projection K[R|t] from world metres to pixels"
        )
    if extrinsics is None:
        raise MessageError(
            "p: a plain camera matrix [K′|0], whose pose must come from TF, which is not available; expected the"
            " full projection K[R|t] from world metres to pixels"
        )
    pose = np.asarray(extrinsics(message.header.frame_id, stamp_to_ns(message.header.stamp)), dtype=np.float64)
    return np.asarray(left @ pose[:3])


def _is_camera_matrix(matrix: Array) -> bool:
    """Upper triangular with a third row (0, 0, s, 0): a camera matrix K′ with no rotation in it."""
    left, column = matrix[:, :3], matrix[:, 3]
    scale = abs(left[2, 2])
    return scale > 0.0 and bool(
        np.all(np.abs(left[[2, 2], [0, 1]]) <= _NEGLIGIBLE * scale)
        and abs(left[1, 0]) <= _NEGLIGIBLE * abs(left[1, 1])
        and abs(column[2]) <= _NEGLIGIBLE * scale
    )


def _published(detector: Projection, message: Any, image_shape: tuple[int, int] | None) -> Projection:
    """The detector's projection, cropped and binned as the message says."""
    binning_x, binning_y = max(1, int(message.binning_x)), max(1, int(message.binning_y))
    roi = message.roi
    x, y, width, height = int(roi.x_offset), int(roi.y_offset), int(roi.width), int(roi.height)
    if width == 0 and height == 0 and x == 0 and y == 0:  # the message's own way to say "all of it"
        width, height = detector.width, detector.height
    if width < 1 or height < 1 or x + width > detector.width or y + height > detector.height:
        raise MessageError(
            f"roi: expected a region inside {detector.width}×{detector.height}, found {width}×{height} at ({x}, {y})"
        )
    columns, rows = width // binning_x, height // binning_y
    if columns < 1 or rows < 1:
        raise MessageError(f"binning_x, binning_y: {binning_x}×{binning_y} leave nothing of {width}×{height} pixels")
    if image_shape is not None and image_shape != (rows, columns):
        raise MessageError(
            f"width, height: the calibration is for an image of {columns}×{rows} (with binning and roi),"
            f" the image has {image_shape[1]}×{image_shape[0]}"
        )
    try:
        published = detector.read_out(x, y, width, height, binning_x, binning_y)
        # Checked like any other matrix: extreme binning may cost it its rank.
        return Projection(published.matrix, columns, rows, detector_width=published.detector_width)
    except GeometryError as error:
        raise MessageError(f"p: with binning {binning_x}×{binning_y} and roi: {error}") from error
