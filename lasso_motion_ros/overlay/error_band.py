"""The band about a surface's outline that holds 95 % of the error that the motion's covariance tells of.

Each vertex of the outline has its own share of the motion's uncertainty: a rotation moves what lies far from its centre
more. Its covariance, projected into the image (first order), is an ellipse about its place; the band is what the
ellipses of the outline cover.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import apply
from lasso_motion_ros.overlay.compositing import AlphaMask
from lasso_motion_ros.overlay.silhouette import Silhouette
from lasso_motion_ros.overlay.triangle_mesh import TriangleMesh

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How the band is drawn.

    Attributes:
        squared_radius: of the ellipse that holds 95 % of a normal error in two dimensions (χ², 2 degrees of freedom).
        corners: of the polygon that stands for an ellipse.
        opacity: of the band; film and outline must stay visible.
        subpixel_bits: OpenCV draws at 2⁻ᵇⁱᵗˢ pixels.
    """

    squared_radius: float = 5.991
    corners: int = 16
    opacity: float = 0.28
    subpixel_bits: int = 4


_TUNING = _Tuning()


def pixel_covariances(covariance: Array, points: Array, projection: Projection) -> Array:
    """(N, 2, 2) covariances in px² of the images of moved points.

    Args:
        covariance: (6, 6) of the motion at the world origin: x, y, z, then about the fixed axes x, y, z; m, rad.
        points: (N, 3) where the points are now, world metres.
        projection: world metres to pixels.
    """
    to_pixels = projection.jacobian(points)
    # A point moves by v + ω × p, so a pixel by J v + (p × J) · ω, row by row.
    whole = np.empty((*to_pixels.shape[:2], 6))
    whole[..., :3] = to_pixels
    (x, y, z), (a, b, c) = points.T[..., None], np.moveaxis(to_pixels, -1, 0)
    whole[..., 3], whole[..., 4], whole[..., 5] = y * c - z * b, z * a - x * c, x * b - y * a
    return np.asarray(whole @ covariance @ whole.transpose(0, 2, 1))


def error_band(
    mesh: TriangleMesh, shape: Silhouette, projection: Projection, motion: Array, covariance: Array
) -> AlphaMask:
    """The alpha mask of the band.

    Args:
        mesh: the surface, world metres at the reference.
        shape: its silhouette in the picture, moved.
        projection: world metres to pixels.
        motion: (4, 4) T with p_now = T · p_reference.
        covariance: (6, 6) of it, as in `pixel_covariances`.
    """
    outer = _on_the_rim(shape)
    if not np.any(outer):
        return AlphaMask(np.zeros((0, 0), dtype=np.uint8), 0, 0)
    ends = shape.ends[outer]
    vertices, place = np.unique(ends, return_inverse=True)
    places = np.empty((len(vertices), 1, 2))
    places[place.reshape(ends.shape), 0] = shape.edges[outer]
    # (vertices, corners, 2)
    ellipses = places + _ellipses(pixel_covariances(covariance, apply(motion, mesh.vertices[vertices]), projection))
    size = np.array([projection.width, projection.height])
    # Only the part that holds the band: blending takes longer than drawing it.
    low = np.clip(np.floor(ellipses.min(axis=(0, 1))).astype(int) - 1, 0, size - 1)
    high = np.clip(np.ceil(ellipses.max(axis=(0, 1))).astype(int) + 2, low + 1, size)
    band = np.zeros(tuple((high - low)[::-1].tolist()), dtype=np.uint8)
    # Far outside the image, coordinates would overflow OpenCV's fixed-point format.
    fixed = np.rint(np.clip(ellipses - low, -1e4, 1e4) * 2**_TUNING.subpixel_bits).astype(np.int32)
    opacity = round(255 * _TUNING.opacity)
    for both in fixed[place.reshape(ends.shape)].reshape(len(ends), -1, 2):
        cv2.fillConvexPoly(band, cv2.convexHull(both), opacity, cv2.LINE_AA, _TUNING.subpixel_bits)
    return AlphaMask(band, int(low[0]), int(low[1]))


def _on_the_rim(shape: Silhouette) -> npt.NDArray[np.bool_]:
    """(E,) which edges lie on the region's rim and not inside it, within the image."""
    rows, columns = shape.coverage.shape
    if rows == 0 or columns == 0:
        return np.zeros(len(shape.edges), dtype=bool)
    middle = 0.5 * (shape.edges[:, 0] + shape.edges[:, 1]) - (shape.left, shape.top)
    x, y = np.rint(np.clip(middle, -1e6, 1e6)).astype(np.int64).T
    seen = (x >= -2) & (y >= -2) & (x < columns + 2) & (y < rows + 2)
    rim = np.zeros(len(shape.edges), dtype=bool)
    # Something of the 3 × 3 pixels about it is not inside; beside the box nothing is.
    beside = np.arange(-1, 2)
    x, y = x[seen, None, None] + beside, y[seen, None, None] + beside[:, None]
    in_box = (x >= 0) & (y >= 0) & (x < columns) & (y < rows)
    inside = shape.coverage[np.clip(y, 0, rows - 1), np.clip(x, 0, columns - 1)] >= 0.5
    rim[seen] = ~(inside & in_box).all(axis=(1, 2))
    return rim


def _ellipses(covariances: Array) -> Array:
    """(N, corners, 2) polygons about the origin, pixels."""
    angles = np.linspace(0.0, 2.0 * np.pi, _TUNING.corners, endpoint=False)
    circle = np.sqrt(_TUNING.squared_radius) * np.column_stack([np.cos(angles), np.sin(angles)])
    values, axes = np.linalg.eigh(covariances)
    roots = axes * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    return np.asarray(circle @ roots.transpose(0, 2, 1))
