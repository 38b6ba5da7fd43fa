"""A projection in the conventions of other tools: OpenCV, RTK and DiffDRR. Lengths in mm.

OpenCV counts pixels from the centre of the first one, as we do. RTK maps the world to millimetres on the detector, and
has the image's origin and spacing turn those into pixels. DiffDRR counts from the corner of the picture, upwards, and
has RAS axes. Written after cv2.projectPoints, RTK's ThreeDCircularProjectionGeometry (projection matrix = magnification
· source translation · rotation) and DiffDRR 0.6 (its DRR class's perspective projection).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import GeometryError
from lasso_motion_ros.geometry.projection import Projection

Array = npt.NDArray[np.float64]
_MM = 1e3
# Relative: above it a detector's axes are not perpendicular, or its pixels not what they are said to be.
_TOLERANCE = 1e-6
_LPS_TO_RAS = np.diag([-1.0, -1.0, 1.0])


def opencv_camera(projection: Projection) -> dict[str, Any]:
    """OpenCV: pixel ~ K (R x + t), x in mm, in the world's axes.

    Returns:
        `camera_matrix` (3, 3), whose first entry is negative for a mirrored display; `rotation` (3, 3), proper;
        `translation_mm` (3,).
    """
    camera, rotation, translation = projection.decompose()
    return {"camera_matrix": camera, "rotation": rotation, "translation_mm": _MM * translation}


def rtk_geometry(projection: Projection, spacing_mm: tuple[float, float]) -> dict[str, Any]:
    """RTK: the parameters of a projection in its geometry, and the projection image's origin and spacing.

    Args:
        projection: what is to be said.
        spacing_mm: (row, column) between rows and between columns on the detector.

    Returns:
        `source_to_isocenter_mm`, `source_to_detector_mm`, the three angles in degrees, offsets of source and
        projection, `image_origin_mm` and `image_spacing_mm` (x, y). A negative spacing is ITK's
        direction −1 along that axis.

    Raises:
        GeometryError: the spacing does not belong to the projection.
    """
    right, down, towards, detector = _axes(projection, spacing_mm)
    # RTK's detector is right-handed with its normal towards the source; a display that is not needs a turned x axis.
    along_x = 1.0 if np.dot(np.cross(right, down), -towards) > 0.0 else -1.0
    rotation = np.stack([along_x * right, down, -towards])
    source = rotation @ (_MM * projection.source)
    camera, _, _ = projection.decompose()
    # rotation = Rz(−in plane) · Rx(−out of plane) · Ry(−gantry)
    out = np.arcsin(np.clip(-rotation[2, 1], -1.0, 1.0))
    gantry = np.arctan2(rotation[2, 0], rotation[2, 2])
    in_plane = np.arctan2(rotation[0, 1], rotation[1, 1])
    row, column = spacing_mm
    return {
        "source_to_isocenter_mm": float(source[2]),
        "source_to_detector_mm": detector,
        "gantry_angle_deg": float(np.degrees(gantry)),
        "out_of_plane_angle_deg": float(np.degrees(out)),
        "in_plane_angle_deg": float(np.degrees(in_plane)),
        "source_offset_mm": source[:2],
        "projection_offset_mm": source[:2],
        "image_origin_mm": np.array([-along_x * column * camera[0, 2], -row * camera[1, 2]]),
        "image_spacing_mm": np.array([along_x * column, row]),
    }


def diffdrr_detector(projection: Projection, spacing_mm: tuple[float, float]) -> dict[str, Any]:
    """DiffDRR: arguments of `DRR(…)` and the pose for a subject read with `orientation=None, center_volume=False`.

    Args:
        projection: what is to be said.
        spacing_mm: (row, column) between rows and between columns on the detector.

    Returns:
        `sdd`, `height`, `width`, `delx`, `dely`, `x0`, `y0` (mm), `reverse_x_axis`, and `pose` (4, 4), camera to
        world in RAS mm.

    Raises:
        GeometryError: the spacing does not belong to the projection.
    """
    right, down, towards, detector = _axes(projection, spacing_mm)
    camera, _, _ = projection.decompose()
    reverse = bool(np.dot(np.cross(right, -down), towards) < 0.0)
    row, column = spacing_mm
    u = camera[0, 2] + 0.5
    x0 = column * ((projection.width - u if reverse else u) - projection.width / 2.0)
    y0 = row * (projection.height / 2.0 - (camera[1, 2] + 0.5))
    pose = np.eye(4)
    pose[:3, :3] = _LPS_TO_RAS @ np.column_stack([-right if reverse else right, -down, towards])
    pose[:3, 3] = _LPS_TO_RAS @ (_MM * projection.source)
    return {
        "sdd": detector,
        "height": projection.height,
        "width": projection.width,
        "delx": column,
        "dely": row,
        "x0": float(x0),
        "y0": float(y0),
        "reverse_x_axis": reverse,
        "pose": pose,
    }


def _axes(projection: Projection, spacing_mm: tuple[float, float]) -> tuple[Array, Array, Array, float]:
    """Unit vectors (3,) along the picture's x and y and towards the detector; source–detector distance in mm."""
    camera, rotation, _ = projection.decompose()
    row, column = spacing_mm
    along_x, along_y = abs(camera[0, 0]) * column, camera[1, 1] * row
    if abs(along_x / along_y - 1.0) > _TOLERANCE or abs(camera[0, 1]) > _TOLERANCE * camera[1, 1]:
        raise GeometryError(
            f"expected a detector with perpendicular axes and pixels of {row:g} mm × {column:g} mm, found"
            f" {along_x:.3f} mm to it along x, {along_y:.3f} mm along y"
        )
    towards = projection.viewing_direction
    # The third row of the decomposition may point away from the detector; its first two then do so too.
    sign = 1.0 if np.dot(rotation[2], towards) > 0.0 else -1.0
    return sign * np.sign(camera[0, 0]) * rotation[0], sign * rotation[1], towards, float(along_y)
