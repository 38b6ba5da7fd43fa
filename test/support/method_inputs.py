"""Inputs that the tests of the method share: an ideal biplane C-arm, rings, and drawn curves."""

from __future__ import annotations

import numpy as np

from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.seeding.cones import Ellipse3D

SOURCE_DETECTOR_M = 1.2
SOURCE_OBJECT_M = 0.785


def plane(lao_deg: float, cranial_deg: float = 0.0, *, side: int = 1024, mirrored: bool = True) -> Projection:
    """An ideal plane with a detector of 204.8 mm."""
    return carm_projection(
        np.radians(lao_deg),
        np.radians(cranial_deg),
        source_detector_m=SOURCE_DETECTOR_M,
        source_object_m=SOURCE_OBJECT_M,
        pixel_size_m=0.2048 / side,
        width=side,
        height=side,
        mirrored=mirrored,
    )


def biplane(*, side: int = 1024, mirrored: bool = True) -> dict[str, Projection]:
    """RAO 30 and LAO 60."""
    return {"a": plane(-30.0, side=side, mirrored=mirrored), "b": plane(60.0, side=side, mirrored=mirrored)}


def flipped(projection: Projection) -> Projection:
    """The same detector displayed with left and right exchanged."""
    flip = np.array([[-1.0, 0.0, projection.width - 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    return Projection(flip @ projection.matrix, projection.width, projection.height)


def flip_pixels(pixels: np.ndarray, projection: Projection) -> np.ndarray:
    """Pixels of `projection` where its flipped display shows them."""
    return np.column_stack([projection.width - 1.0 - pixels[:, 0], pixels[:, 1]])


def ring(
    normal: np.ndarray, centre: np.ndarray = (0.0, 0.0, 0.0), radius: float = 0.010, axis_ratio: float = 1.0
) -> Ellipse3D:
    """A ring about a normal (3,), metres."""
    normal = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
    u = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    u /= np.linalg.norm(u)
    return Ellipse3D(np.asarray(centre, dtype=float), radius * u, radius * axis_ratio * np.cross(normal, u))


def angle_deg(first: np.ndarray, second: np.ndarray) -> float:
    """Angle between two axes without direction."""
    # The arc sine keeps its precision at small angles, where the arc cosine loses half of the digits.
    sine = np.linalg.norm(np.cross(first, second)) / (np.linalg.norm(first) * np.linalg.norm(second))
    return float(np.degrees(np.arcsin(min(1.0, sine))))


def closed(points: np.ndarray) -> np.ndarray:
    """A curve with its first point repeated at the end."""
    return np.vstack([points, points[:1]])


def draw_curve(
    points: np.ndarray,
    shape: tuple[int, int],
    *,
    sigma_px: float = 1.2,
    background: float | np.ndarray = 180.0,
    depth: float = 90.0,
    bright: bool = False,
) -> np.ndarray:
    """A uint8 image of a line of Gaussian profile along a polyline (N, 2), dark unless said otherwise."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.arange(0.0, length[-1], 0.2)
    dense = np.column_stack([np.interp(at, length, column) for column in points.T])
    reach = int(np.ceil(4 * sigma_px))
    rows, columns = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    x = np.rint(dense[:, 0]).astype(int)[:, None] + columns.ravel()
    y = np.rint(dense[:, 1]).astype(int)[:, None] + rows.ravel()
    squared = (x - dense[:, :1]) ** 2 + (y - dense[:, 1:]) ** 2
    inside = (x >= 0) & (y >= 0) & (x < shape[1]) & (y < shape[0])
    profile = np.zeros(shape)
    np.maximum.at(profile, (y[inside], x[inside]), np.exp(-0.5 * squared[inside] / sigma_px**2))
    return np.clip(np.rint(background + (depth if bright else -depth) * profile), 0, 255).astype(np.uint8)
