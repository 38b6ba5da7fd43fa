"""Distances between curves, compiled: see `core/compiled.py`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]


@compiled("float64[::1](Array(float64, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True))")
def distances(points: Array, curve: Array) -> Array:
    """(N,) distance of each point (N, D) to an open polyline (M, D), M ≥ 2: `curves.distance_to_curve`."""
    count, dimensions = points.shape
    segments = curve.shape[0] - 1
    shape = dimensions, segments
    starts, steps, shares = np.empty(shape), np.empty(shape), np.empty(shape)
    for i in range(segments):
        squared = 0.0
        for k in range(dimensions):
            starts[k, i], steps[k, i] = curve[i, k], curve[i + 1, k] - curve[i, k]
            squared += steps[k, i] * steps[k, i]
        for k in range(dimensions):
            shares[k, i] = steps[k, i] / (squared if squared > 0.0 else 1.0)
    nearest, along, squares = np.empty(count), np.empty(segments), np.empty(segments)
    for n in range(count):
        for i in range(segments):
            along[i], squares[i] = 0.0, 0.0
        for k in range(dimensions):
            value, start, share = points[n, k], starts[k], shares[k]
            for i in range(segments):
                along[i] += (value - start[i]) * share[i]
        for k in range(dimensions):
            value, start, step = points[n, k], starts[k], steps[k]
            for i in range(segments):
                off = value - start[i] - min(max(along[i], 0.0), 1.0) * step[i]
                squares[i] += off * off
        least = squares[0]
        for i in range(1, segments):
            least = min(least, squares[i])
        nearest[n] = math.sqrt(least)
    return nearest
