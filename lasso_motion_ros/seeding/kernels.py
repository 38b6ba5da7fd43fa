"""The walk down a front's arrival times, and the ways along an ellipse, compiled: see `core/compiled.py`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]


@compiled("float64(Array(float64, 2, 'A', readonly=True), int64, int64)", is_exact=True)
def _slope_along_rows(values: Array, row: int, column: int) -> float:
    """Central difference along a row, one-sided at its ends."""
    first, last = max(column - 1, 0), min(column + 1, values.shape[1] - 1)
    return float((values[row, last] - values[row, first]) / (last - first))


@compiled("float64(Array(float64, 2, 'A', readonly=True), int64, int64)", is_exact=True)
def _slope_along_columns(values: Array, row: int, column: int) -> float:
    first, last = max(row - 1, 0), min(row + 1, values.shape[0] - 1)
    return float((values[last, column] - values[first, column]) / (last - first))


@compiled(
    "Tuple((float64[:, ::1], boolean))(Array(float64, 2, 'A', readonly=True), Array(float64, 1, 'A', readonly=True),"
    " Array(float64, 1, 'A', readonly=True), float64, float64)",
    is_exact=True,  # whether a walk of whole steps ends a step later is a matter of the last bit
)
def descended(arrival: Array, start: Array, goal: Array, step_px: float, goal_px: float) -> tuple[Array, bool]:
    """Walk down the arrival times: `minimal_path._descend`.

    Args:
        arrival: (h, w) times.
        start: (2,) x and y.
        goal: (2,) likewise.
        step_px: length of a step.
        goal_px: how near to the goal it ends.

    Returns:
        (M, 2) the places; whether the walk got to its goal.
    """
    height, width = arrival.shape
    last_x, last_y = width - 1.001, height - 1.001  # the last place with four pixels around it
    x, y = min(start[0], last_x), min(start[1], last_y)
    path = np.empty((20 * (height + width) + 2, 2))
    path[0, 0], path[0, 1] = x, y
    for n in range(1, path.shape[0] - 1):
        if math.hypot(x - goal[0], y - goal[1]) < goal_px:
            path[n, 0], path[n, 1] = goal[0], goal[1]
            return path[: n + 1].copy(), True
        column, row = int(x), int(y)
        right, below = x - column, y - row
        down_x = (1.0 - below) * (
            (1.0 - right) * _slope_along_rows(arrival, row, column)
            + right * _slope_along_rows(arrival, row, column + 1)
        ) + below * (
            (1.0 - right) * _slope_along_rows(arrival, row + 1, column)
            + right * _slope_along_rows(arrival, row + 1, column + 1)
        )
        down_y = (1.0 - below) * (
            (1.0 - right) * _slope_along_columns(arrival, row, column)
            + right * _slope_along_columns(arrival, row, column + 1)
        ) + below * (
            (1.0 - right) * _slope_along_columns(arrival, row + 1, column)
            + right * _slope_along_columns(arrival, row + 1, column + 1)
        )
        size = math.hypot(down_x, down_y)
        if not size > 0.0:
            return path[:n].copy(), False
        x = min(max(x - step_px * down_x / size, 0.0), last_x)
        y = min(max(y - step_px * down_y / size, 0.0), last_y)
        path[n, 0], path[n, 1] = x, y
    return path, False


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
            totals[0] = cost[0, outline, direction]
            for row in range(1, length):
                here, last, own = totals[row], totals[row - 1], cost[row, outline, direction]
                here[:] = last
                for step in range(1, reach):
                    later, earlier = here[step:], last[: angles - step]
                    for angle in range(later.size):
                        later[angle] = earlier[angle] if earlier[angle] < later[angle] else later[angle]
                for angle in range(angles):
                    here[angle] += own[angle]
            index = int(np.argmin(totals[length - 1]))
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
