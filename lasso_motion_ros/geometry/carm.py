"""The projection of an ideal C-arm from its angles and distances."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import GeometryError
from lasso_motion_ros.geometry.projection import Projection


def carm_projection(
    lao_rad: float,
    cranial_rad: float,
    *,
    source_detector_m: float,
    source_object_m: float,
    pixel_size_m: float | tuple[float, float],
    width: int,
    height: int,
    mirrored: bool = True,
    iso_centre: npt.ArrayLike = (0.0, 0.0, 0.0),
    roll_rad: float = 0.0,
    principal_point: tuple[float, float] | None = None,
) -> Projection:
    """The projection of an ideal C-arm at the usual angles.

    World axes are the patient's, supine: +x to the left, +y posterior, +z cranial (LPS), metres.

    Args:
        lao_rad: rotation of the detector about the patient's long axis, LAO positive, RAO negative.
        cranial_rad: tilt of the detector, CRAN positive, CAUD negative.
        source_detector_m: source to detector (SID), metres.
        source_object_m: source to iso-centre (SOD), metres.
        pixel_size_m: detector pixel pitch, metres; one value, or the pitches along x and y.
        width: image columns.
        height: image rows.
        mirrored: True for the usual display as seen facing the patient (patient's left at the image's right).
        iso_centre: (3,) iso-centre in the world frame, metres.
        roll_rad: rotation of what the image shows about the principal point, from +x towards +y; a detector that is
            turned clockwise, as seen looking towards the source, turns it the other way.
        principal_point: (x, y) pixel on which the iso-centre is projected; the image's centre unless given.

    Raises:
        GeometryError: a distance or size that is not positive.
    """
    pitch_x, pitch_y = pixel_size_m if isinstance(pixel_size_m, tuple) else (pixel_size_m, pixel_size_m)
    for name, value in (
        ("source_detector_m", source_detector_m),
        ("source_object_m", source_object_m),
        ("pixel_size_m", pitch_x),
        ("pixel_size_m", pitch_y),
    ):
        if not value > 0.0:
            raise GeometryError(f"{name} must be positive, found {value}")
    sin_a, cos_a = np.sin(lao_rad), np.cos(lao_rad)
    sin_b, cos_b = np.sin(cranial_rad), np.cos(cranial_rad)
    towards_detector = np.array([sin_a * cos_b, -cos_a * cos_b, sin_b])
    image_right = np.array([cos_a, sin_a, 0.0]) * (1.0 if mirrored else -1.0)
    image_down = np.array([sin_a * sin_b, -cos_a * sin_b, -cos_b])
    cos_r, sin_r = np.cos(roll_rad), np.sin(roll_rad)
    rows = np.stack(
        [
            cos_r * image_right - sin_r * image_down,
            sin_r * image_right + cos_r * image_down,
            towards_detector,
        ]
    )
    x, y = ((width - 1) / 2.0, (height - 1) / 2.0) if principal_point is None else principal_point
    camera = np.array([[source_detector_m / pitch_x, 0.0, x], [0.0, source_detector_m / pitch_y, y], [0.0, 0.0, 1.0]])
    origin = np.array([0.0, 0.0, source_object_m]) - rows @ np.asarray(iso_centre, dtype=np.float64)
    return Projection(camera @ np.column_stack([rows, origin]), width, height)
