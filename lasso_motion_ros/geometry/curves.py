"""Polylines in any dimension: arc length, even resampling, distances between curves."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


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
    start, step = curve[:-1], np.diff(curve, axis=0)
    squared = np.einsum("md,md->m", step, step)
    offset = points[:, None, :] - start[None]
    along = np.einsum("nmd,md->nm", offset, step) / np.where(squared > 0.0, squared, 1.0)
    nearest = offset - np.clip(along, 0.0, 1.0)[..., None] * step
    return np.asarray(np.sqrt(np.einsum("nmd,nmd->nm", nearest, nearest).min(axis=1)))
