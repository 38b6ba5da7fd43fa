"""The direction of a breath, and how far a place lies off it, compiled: see `core/compiled.py`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled
from lasso_motion_ros.motion.rotation_kernels import principal_axis

Array = npt.NDArray[np.float64]

_POINTS = "Array(float64, 2, 'C', readonly=True)"
_VECTOR = "Array(float64, 1, 'A', readonly=True)"


@compiled(f"Tuple((float64[::1], float64))({_POINTS})")
def direction(points: Array) -> tuple[Array, float]:
    """(3,) direction of largest spread of points (N, 3), and the root mean square along it: `_principal_axis`."""
    count, mean, scatter = points.shape[0], np.zeros(3), np.zeros((3, 3))
    for n in range(count):
        for k in range(3):
            mean[k] += points[n, k] / count
    for n in range(count):
        for k in range(3):
            for m in range(3):
                scatter[k, m] += (points[n, k] - mean[k]) * (points[n, m] - mean[m])
    axis, square = principal_axis(scatter), 0.0
    for k in range(3):
        for m in range(3):
            square += axis[k] * scatter[k, m] * axis[m]
    return axis, math.sqrt(max(square, 0.0) / count)


@compiled(f"UniTuple(float64, 2)({_VECTOR}, {_POINTS}, {_VECTOR}, boolean)")
def compared(displacement: Array, curve: Array, axis: Array, is_line: bool) -> tuple[float, float]:
    """How far a place is across a curve, and beyond its ends: `BreathingCurve._compared`.

    Args:
        displacement: (3,) metres.
        curve: (N, 3) metres.
        axis: (3,) its direction.
        is_line: whether it counts as a line so far.
    """
    count, mean = curve.shape[0], np.zeros(3)
    for n in range(count):
        for k in range(3):
            mean[k] += curve[n, k] / count
    highest, lowest, at = -np.inf, np.inf, 0.0
    for n in range(count):
        along = 0.0
        for k in range(3):
            along += (curve[n, k] - mean[k]) * axis[k]
        highest, lowest = max(highest, along), min(lowest, along)
    for k in range(3):
        at += (displacement[k] - mean[k]) * axis[k]
    beyond = max(at - highest, lowest - at, 0.0)
    if is_line:
        square = 0.0
        for k in range(3):
            off = displacement[k] - mean[k] - at * axis[k]
            square += off * off
        return math.sqrt(square), beyond
    nearest = np.inf
    for n in range(count - 1):
        length, along, square = 1e-300, 0.0, 0.0
        for k in range(3):
            step = curve[n + 1, k] - curve[n, k]
            length += step * step
            along += (displacement[k] - curve[n, k]) * step
        along = min(max(along / length, 0.0), 1.0)
        for k in range(3):
            off = displacement[k] - curve[n, k] - along * (curve[n + 1, k] - curve[n, k])
            square += off * off
        nearest = min(nearest, square)
    return math.sqrt(max(nearest - beyond * beyond, 0.0)), beyond
