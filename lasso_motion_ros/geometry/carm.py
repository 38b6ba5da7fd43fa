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
    pixel_size_m: float,
    width: int,
    height: int,
    mirrored: bool = True,
    iso_centre: npt.ArrayLike = (0.0, 0.0, 0.0),
    roll_rad: float = 0.0,
) -> Projection:
    """The projection of an ideal C-arm at the usual angles.

    World axes are the patient's, supine: +x to the left, +y posterior, +z cranial (LPS), metres.

    Args:
        lao_rad: rotation of the detector about the patient's long axis, LAO positive, RAO negative.
        cranial_rad: tilt of the detector, CRAN positive, CAUD negative.
        source_detector_m: source to detector (SID), metres.
        source_object_m: source to iso-centre (SOD), metres.
        pixel_size_m: detector pixel pitch, metres.
        width: image columns.
        height: image rows.
        mirrored: True for the usual display as seen facing the patient (patient's left at the image's right).
        iso_centre: (3,) iso-centre in the world frame, metres.
        roll_rad: rotation of the image about its centre, from +x towards +y.

    Raises:
        GeometryError: a distance or size that is not positive.
    """
    for name, value in (
        ("source_detector_m", source_detector_m),
        ("source_object_m", source_object_m),
        ("pixel_size_m", pixel_size_m),
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
    focal = source_detector_m / pixel_size_m
    camera = np.array([[focal, 0.0, (width - 1) / 2.0], [0.0, focal, (height - 1) / 2.0], [0.0, 0.0, 1.0]])
    origin = np.array([0.0, 0.0, source_object_m]) - rows @ np.asarray(iso_centre, dtype=np.float64)
    return Projection(camera @ np.column_stack([rows, origin]), width, height)
