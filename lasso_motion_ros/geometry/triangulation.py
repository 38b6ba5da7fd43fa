"""A world point from its pixels in several views."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import GeometryError
from lasso_motion_ros.geometry.projection import Projection

Array = npt.NDArray[np.float64]


def triangulate(projections: tuple[Projection, ...], pixels: tuple[Array, ...]) -> Array:
    """World point (3,) in metres nearest to the rays through one pixel (2,) per view (least squares).

    Raises:
        GeometryError: the rays are parallel, so that no point is nearest.
    """
    normal, right = np.zeros((3, 3)), np.zeros(3)
    for projection, pixel in zip(projections, pixels, strict=True):
        ray = projection.rays(pixel)
        across = np.eye(3) - np.outer(ray, ray)
        normal += across
        right += across @ projection.source
    if np.linalg.cond(normal) > 1e8:
        raise GeometryError("the rays are parallel: no point lies nearest to them")
    return np.asarray(np.linalg.solve(normal, right))
