"""What breathing across its direction may be a linear function of: depth and speed, and what they make together."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def breathing_terms(along: Array, speed: Array, places_a_term: int) -> Array:
    """(N, K) what breathing may be a linear function of, across its direction, the most certain first.

    Args:
        along: (N,) places along the breath, metres.
        speed: (N,) m/s along it.
        places_a_term: how many places tell one of them.
    """
    depth = along - along.mean()
    terms = np.column_stack([np.ones_like(depth), depth, speed, depth * depth, depth * speed])
    return terms[:, : max(3, len(terms) // places_a_term)]


def speed_along(along: Array, intervals: Array) -> Array:
    """(N,) derivative of values (N,) that lie intervals (N - 1,) apart, of second order but for the ends."""
    steps = np.diff(along) / intervals
    speed = np.empty_like(along)
    speed[0], speed[-1] = steps[0], steps[-1]
    # Between two steps the shorter one counts for more.
    before, after = intervals[:-1], intervals[1:]
    speed[1:-1] = (steps[:-1] * after + steps[1:] * before) / (before + after)
    return speed
