"""The ways along an ellipse, compiled: see `core/compiled.py`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]


@compiled("int64[:, ::1](float64[:, :, :, ::1], int64)")
def cheapest_ways(cost: Array, reach: int) -> npt.NDArray[np.int64]:
    """The cheapest monotone way of each outline round its ellipse: `loop_outline._cheapest_ways`.

    Args:
        cost: (N, outlines, 2, angles) of each point at each angle, rising and falling.
        reach: largest step from point to point is one angle less.

    Returns:
        (outlines, N + 1): the direction, then the angle's number of each point.
    """
    length, outlines, _, angles = cost.shape
    found = np.empty((outlines, length + 1), np.int64)
    totals = np.empty((length, angles))
    for outline in range(outlines):
        best = np.inf
        for direction in range(2):
            for angle in range(angles):
                totals[0, angle] = cost[0, outline, direction, angle]
            for row in range(1, length):
                here, last, own = totals[row], totals[row - 1], cost[row, outline, direction]
                for angle in range(angles):
                    here[angle] = last[angle]
                for step in range(1, reach):
                    later, earlier = here[step:], last[: angles - step]
                    for angle in range(later.size):
                        later[angle] = earlier[angle] if earlier[angle] < later[angle] else later[angle]
                for angle in range(angles):
                    here[angle] += own[angle]
            index = 0
            for angle in range(1, angles):
                if totals[length - 1, angle] < totals[length - 1, index]:
                    index = angle
            if direction > 0 and not totals[length - 1, index] < best:
                continue
            best = totals[length - 1, index]
            found[outline, 0], found[outline, length] = direction, index
            for row in range(length - 2, -1, -1):
                # Of several alike, the nearest.
                at = index
                for before in range(index - 1, max(index - reach, -1), -1):
                    if totals[row, before] < totals[row, at]:
                        at = before
                index = at
                found[outline, row + 1] = index
    return found
