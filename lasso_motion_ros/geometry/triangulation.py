"""A world point from its pixels, or its rays, in several views."""

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
    rays = np.array([projection.rays(pixel) for projection, pixel in zip(projections, pixels, strict=True)])
    return nearest_to_rays(np.array([projection.source for projection in projections]), rays)


def nearest_to_rays(points: Array, rays: Array) -> Array:
    """World point (3,) in metres nearest to rays (N, 3), unit vectors, through points (N, 3) (least squares).

    Raises:
        GeometryError: the rays are parallel, so that no point is nearest.
    """
    normal, right = np.zeros((3, 3)), np.zeros(3)
    for point, ray in zip(points, rays, strict=True):
        across = np.eye(3) - np.outer(ray, ray)
        normal += across
        right += across @ point
    if np.linalg.cond(normal) > 1e8:
        raise GeometryError("the rays are parallel: no point lies nearest to them")
    return np.asarray(np.linalg.solve(normal, right))
