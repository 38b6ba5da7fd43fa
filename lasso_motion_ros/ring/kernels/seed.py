"""Circles beside clicks, compiled: see `core/compiled.py`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.float32]


@compiled(
    "float64[:, :, ::1](Array(float64, 3, 'A', readonly=True), Array(float64, 2, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True))"
)
def projected(world: Array, matrix: Array, around: Array) -> Array:
    """(2, N, K) x and y of points along circles under a projection: `seed_circle._projected`.

    Args:
        world: (4, 3, K) homogeneous: each circle's centre, and two of its radii; metres.
        matrix: (3, 4) to pixels.
        around: (N, 3) what of the three makes each point.
    """
    points, circles = around.shape[0], world.shape[2]
    seen, pixels = np.empty((3, 3, circles)), np.empty((2, points, circles))
    for row in range(3):
        for part in range(3):
            one = seen[row, part]
            one[:] = 0.0
            for k in range(4):
                factor, other = matrix[row, k], world[k, part]
                for c in range(circles):
                    one[c] += factor * other[c]
    for n in range(points):
        a, b, d = around[n, 0], around[n, 1], around[n, 2]
        for row in range(2):
            result = pixels[row, n]
            centre, first, second = seen[row]
            deep, deep_first, deep_second = seen[2]
            for c in range(circles):
                depth = a * deep[c] + b * deep_first[c] + d * deep_second[c]
                result[c] = (a * centre[c] + b * first[c] + d * second[c]) / depth
    return pixels


@compiled(
    "float64[::1](Array(float64, 3, 'A', readonly=True), Array(float64, 2, 'A', readonly=True), float64, float64)"
)
def beside(pixels: Array, clicks: Array, unit: float, farthest: float) -> Array:
    """(K,) mean squared distance of clicks from circles, mm²: `seed_circle._Views`.

    Args:
        pixels: (2, N, K) x and y of points along each circle.
        clicks: (C, 2) pixels.
        unit: millimetres per pixel.
        farthest: what a click counts at most, mm².
    """
    _, points, circles = pixels.shape
    mean, nearest = np.zeros(circles), np.empty(circles)
    for c in range(clicks.shape[0]):
        nearest[:] = np.inf
        for n in range(points):
            x, y = pixels[0, n], pixels[1, n]
            for k in range(circles):
                off_x, off_y = x[k] - clicks[c, 0], y[k] - clicks[c, 1]
                squared = off_x * off_x + off_y * off_y
                nearest[k] = squared if squared < nearest[k] else nearest[k]
        for k in range(circles):
            mean[k] += min(unit * unit * nearest[k], farthest) / clicks.shape[0]
    return mean
