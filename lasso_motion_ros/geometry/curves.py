"""Polylines: arc length, even resampling, distances between curves, tangents and normals."""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels

Array = npt.NDArray[np.float64]
Real = TypeVar("Real", bound=np.floating[Any])

SMALLEST_SPACING = 1e-9  # pixels; points nearer to each other than this have no direction
_BLOCK = 1 << 14  # distances at once: what belongs to them stays in the processor's cache
_QUARTER_TURN = np.array([-1.0, 1.0])


def arc_length(points: Array) -> Array:
    """(N,) length along an open polyline (N, D) up to each of its points, in the points' unit."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def resample(points: Array, count: int) -> Array:
    """(count, D) points evenly spaced along an open polyline (N, D), both ends included."""
    length = arc_length(points)
    at = np.linspace(0.0, length[-1], count)
    return np.column_stack([np.interp(at, length, column) for column in points.T])


def distance_to_curve(points: Array, curve: Array) -> Array:
    """(N,) distance of each point (N, D) to an open polyline (M, D), exact on its segments."""
    points = np.asarray(points, dtype=np.float64)
    if has_kernels():
        from lasso_motion_ros.geometry.kernels import distances

        nearest_by: Array = distances(points, curve)
        return nearest_by
    start, step = curve[:-1], np.diff(curve, axis=0)
    squared = (step * step).sum(axis=1)
    per_length = step / np.where(squared > 0.0, squared, 1.0)[:, None]
    nearest = _nearest_segments(points, start, step, per_length)
    offset = points - start[nearest]
    along = np.clip((offset * per_length[nearest]).sum(axis=1), 0.0, 1.0)
    return np.asarray(np.linalg.norm(offset - along[:, None] * step[nearest], axis=1))


def distance_of_point(point: Array, curve: Array) -> float:
    """Distance of one point (D,) to an open polyline (M, D), exact on its segments: `distance_to_curve` in a third."""
    step, offset = np.diff(curve, axis=0), point - curve[:-1]
    squared = np.maximum((step * step).sum(axis=1), np.finfo(np.float64).tiny)
    along = np.minimum(np.maximum((offset * step).sum(axis=1) / squared, 0.0), 1.0)
    offset -= along[:, None] * step
    return math.sqrt(float((offset * offset).sum(axis=1).min()))


def _nearest_segments(points: Array, start: Array, step: Array, per_length: Array) -> npt.NDArray[np.int64]:
    """(N,) which segment (M, D) is the nearest to each point, in single precision: it takes half the time.

    Where it takes one segment for another, both are equally far to seven digits.
    """
    middle = start.mean(axis=0)
    at, starts, steps, shares = (
        np.ascontiguousarray(vectors.T, dtype=np.float32)
        for vectors in (points - middle, start - middle, step, per_length)
    )
    nearest = np.empty(len(points), dtype=np.int64)
    rows = max(1, _BLOCK // max(1, len(start)))
    for first in range(0, len(points), rows):
        block = slice(first, first + rows)
        offsets = [one[block, None] - beginning for one, beginning in zip(at, starts, strict=True)]
        along = offsets[0] * shares[0]
        for offset, one in zip(offsets[1:], shares[1:], strict=True):
            along += offset * one
        np.minimum(np.maximum(along, 0.0, out=along), 1.0, out=along)
        for offset, one in zip(offsets, steps, strict=True):
            offset -= along * one  # from the nearest point of the segment
            offset *= offset
        for offset in offsets[1:]:
            offsets[0] += offset
        nearest[block] = offsets[0].argmin(axis=1)
    return nearest


def slope(values: npt.NDArray[Real], axis: int) -> npt.NDArray[Real]:
    """Central differences along an axis, one-sided at its ends: `np.gradient` for hot loops."""
    along = values.swapaxes(0, axis)
    differences = np.empty_like(along)
    np.subtract(along[2:], along[:-2], out=differences[1:-1])
    differences[1:-1] *= 0.5
    np.subtract(along[1], along[0], out=differences[0])
    np.subtract(along[-1], along[-2], out=differences[-1])
    return differences.swapaxes(0, axis)


def unit_tangents(points: Array, *, closed: bool = False) -> tuple[Array, Array]:
    """Unit tangents (..., N, 2) of polylines (..., N, 2) and the spacing (..., N) of their points there.

    Where points coincide the tangent is zero.

    Args:
        points: in order along the curve; a closed one's first point is not repeated.
        closed: the first point follows the last.
    """
    steps = 0.5 * (np.roll(points, -1, axis=-2) - np.roll(points, 1, axis=-2)) if closed else slope(points, axis=-2)
    spacing = np.hypot(steps[..., 0], steps[..., 1])
    return steps / np.maximum(spacing, SMALLEST_SPACING)[..., None], spacing


def quarter_turn(vectors: Array) -> Array:
    """(..., 2) vectors (x, y) turned to (−y, x): a curve's normals from its tangents."""
    return np.asarray(vectors[..., ::-1] * _QUARTER_TURN)
