"""A front that marches from a click, and the walk back down its arrival times, compiled: see `core/compiled.py`.

Sethian's fast marching, second order (SIAM Review 41, 1999), with the arithmetic of `skfmm.travel_time`, operation by
operation: times, and so the path, are the same to the last bit. But the front comes only as far as the walk asks for.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.uint8]
Places = npt.NDArray[np.int64]
# By pixel, row by row, the border included: when the front comes to it, what it is, its distance from the line where
# the front begins, and the front's speed; then the front's pixels as a heap by their times, each one's place in it, and
# (1,) how many they are.
Front = tuple[Array, Flags, Array, Array, Places, Places, Places]

# What a pixel is: not reached, in the front, behind it, or none at all: the border, two pixels wide.
_FAR, _FRONT, _BEHIND, _BORDER = 0, 1, 2, 3
_BORDER_PX = 2
_FRONT_TYPE = "Tuple((float64[::1], uint8[::1], float64[::1], float64[::1], int64[::1], int64[::1], int64[::1]))"


@compiled("float64(float64, float64, float64)", is_exact=True)
def _later_root(a: float, b: float, c: float) -> float:
    """Of a t² + b t + c = 0; infinite where there is none."""
    determinant = b * b - 4.0 * a * c
    return (-b + math.sqrt(determinant)) / 2.0 / a if determinant >= 0.0 else np.inf


@compiled(f"UniTuple(float64, 3)({_FRONT_TYPE}, int64, int64)", is_exact=True)
def _along(front: Front, pixel: int, step: int) -> tuple[float, float, float]:
    """What one axis adds to a pixel's equation a t² + b t + c = 1 / speed²."""
    times, flags, signed = front[0], front[1], front[2]
    first, second = np.inf, np.inf
    for way in (-step, step):
        near, next_one = pixel + way, pixel + 2 * way
        if flags[near] == _BEHIND and times[near] < first:
            first = times[near]
            if flags[next_one] == _BEHIND and (times[next_one] <= first or first == 0.0):
                second = times[next_one]
                if signed[next_one] * signed[near] < 0.0 or signed[next_one] * signed[pixel] < 0.0:
                    second = -second  # on the other side of the line where the front begins
    if second < np.inf:
        ahead = (1.0 / 3.0) * (4.0 * first - second)
        return 2.25, -4.5 * ahead, 2.25 * (ahead * ahead)
    if first < np.inf:
        return 1.0, -2.0 * first, first * first
    return 0.0, 0.0, 0.0


@compiled(f"float64({_FRONT_TYPE}, int64, int64)", is_exact=True)
def _time(front: Front, pixel: int, width: int) -> float:
    """When the front comes to a pixel, by what is behind it beside the pixel."""
    a, b, c = _along(front, pixel, width)
    d, e, f = _along(front, pixel, 1)
    speed = front[3][pixel]
    right = 1.0 / (speed * speed)
    time = _later_root(a + d, b + e, c + f - right)
    if time < np.inf:
        return time
    # Along one axis alone, whichever is the sooner.
    return min(_later_root(d, e, f - right), _later_root(a, b, c - right))


@compiled(f"void({_FRONT_TYPE}, int64)", is_exact=True)
def _rise(front: Front, at: int) -> None:
    """Move one of the heap's pixels towards its top, as far as its time says."""
    times, heap, places = front[0], front[4], front[5]
    pixel = heap[at]
    time = times[pixel]
    while at > 0 and time < times[heap[(at - 1) >> 1]]:
        above = (at - 1) >> 1
        heap[at] = heap[above]
        places[heap[at]] = at
        at = above
    heap[at], places[pixel] = pixel, at


@compiled(f"void({_FRONT_TYPE}, int64)", is_exact=True)
def _sink(front: Front, at: int) -> None:
    """Move one of the heap's pixels away from its top, as far as its time says."""
    times, heap, places, size = front[0], front[4], front[5], front[6][0]
    pixel = heap[at]
    time = times[pixel]
    while 2 * at + 1 < size:
        below = 2 * at + 1
        if below + 1 < size and times[heap[below + 1]] < times[heap[below]]:
            below += 1
        if not times[heap[below]] < time:
            break
        heap[at] = heap[below]
        places[heap[at]] = at
        at = below
    heap[at], places[pixel] = pixel, at


@compiled(f"void({_FRONT_TYPE}, int64)", is_exact=True)
def _begin(front: Front, width: int) -> None:
    """Put behind the front what lies on the line where it begins or beside it, and what is beside that into it."""
    times, flags, signed, speeds, heap, _, count = front
    for pixel in range(signed.size):
        if flags[pixel] == _FAR and signed[pixel] == 0.0:
            flags[pixel], times[pixel] = _BEHIND, 0.0
    for pixel in range(signed.size):
        if flags[pixel] != _FAR:
            continue
        total = 0.0
        for step in (width, 1):
            nearest = 0.0
            for other in (pixel - step, pixel + step):
                if signed[pixel] * signed[other] < 0.0:
                    away = signed[pixel] / (signed[pixel] - signed[other])
                    if nearest == 0.0 or nearest > away:
                        nearest = away
            if nearest > 0.0:
                total += 1.0 / nearest / nearest
        if total > 0.0:
            flags[pixel], times[pixel] = _BEHIND, math.sqrt(1.0 / total) / speeds[pixel]
    for pixel in range(signed.size):
        if flags[pixel] != _FAR:
            continue
        for step in (-width, width, -1, 1):
            if flags[pixel + step] == _BEHIND:
                flags[pixel], times[pixel] = _FRONT, _time(front, pixel, width)
                heap[count[0]] = pixel
                count[0] += 1
                _rise(front, count[0] - 1)
                break


@compiled(f"void({_FRONT_TYPE}, int64, int64, float64)", is_exact=True)
def _march(front: Front, width: int, goal: int, latest: float) -> None:
    """Let the front go on until a pixel is behind it, or until the latest time."""
    times, flags, _, _, heap, places, count = front
    together = np.empty(heap.size, np.int64)
    while count[0] > 0 and flags[goal] != _BEHIND and times[heap[0]] <= latest:
        now, members = times[heap[0]], 0
        # What it comes to at the same time goes behind it together.
        while count[0] > 0 and times[heap[0]] == now:
            pixel = heap[0]
            together[members], flags[pixel] = pixel, _BEHIND
            members += 1
            count[0] -= 1
            heap[0] = heap[count[0]]
            _sink(front, 0)
        for pixel in together[:members]:
            for step in (-width, width, -1, 1):
                near = pixel + step
                if flags[near] == _FAR:
                    flags[near], heap[count[0]] = _FRONT, near
                    times[near] = _time(front, near, width)
                    count[0] += 1
                    _rise(front, count[0] - 1)
                    continue
                if flags[near] == _BEHIND:
                    near += step
                if flags[near] == _FRONT:
                    before = times[near]
                    times[near] = _time(front, near, width)
                    if times[near] < before:
                        _rise(front, places[near])
                    else:
                        _sink(front, places[near])


@compiled(f"void({_FRONT_TYPE}, int64, int64, int64, int64, float64[::1], int64, int64, int64)", is_exact=True)
def _ask(
    front: Front,
    row: int,
    column: int,
    rows: int,
    columns: int,
    latest: Array,
    end_row: int,
    end_column: int,
    around: int,
) -> None:
    """Have the times of the four pixels from one on, and of those beside them, by which the walk goes on.

    Args:
        front: which has begun.
        row: of the first of the four.
        column: likewise.
        rows: of the image.
        columns: likewise.
        latest: (1,) time that the front has, if what is about the walk's beginning is behind it by then. Else it has
            all the time, and infinity is written here.
        end_row: of the pixel where the walk begins.
        end_column: likewise.
        around: and so many pixels about it.
    """
    times, flags = front[0], front[1]
    width = columns + 2 * _BORDER_PX
    for i in range(max(row - 1, 0), min(row + 3, rows)):
        for j in range(max(column - 1, 0), min(column + 3, columns)):
            if i in (row - 1, row + 2) and j in (column - 1, column + 2):
                continue
            pixel = (i + _BORDER_PX) * width + j + _BORDER_PX
            if flags[pixel] == _BEHIND:
                continue
            _march(front, width, pixel, latest[0])
            if flags[pixel] == _BEHIND:
                continue
            is_passed = True
            for m in range(max(end_row - around, 0), min(end_row + around + 1, rows)):
                for n in range(max(end_column - around, 0), min(end_column + around + 1, columns)):
                    at = (m + _BORDER_PX) * width + n + _BORDER_PX
                    is_passed = is_passed and flags[at] == _BEHIND
            if is_passed:
                times[pixel] = latest[0]  # where the front has not come in time
            else:
                latest[0] = np.inf
                _march(front, width, pixel, latest[0])


@compiled("float64(float64[::1], int64, int64, int64, int64)", is_exact=True)
def _slope_along_rows(times: Array, row: int, column: int, rows: int, columns: int) -> float:
    """Central difference along a row of the image, one-sided at its ends."""
    first, last = max(column - 1, 0), min(column + 1, columns - 1)
    start = (row + _BORDER_PX) * (columns + 2 * _BORDER_PX) + _BORDER_PX
    return float((times[start + last] - times[start + first]) / (last - first))


@compiled("float64(float64[::1], int64, int64, int64, int64)", is_exact=True)
def _slope_along_columns(times: Array, row: int, column: int, rows: int, columns: int) -> float:
    first, last = max(row - 1, 0), min(row + 1, rows - 1)
    width = columns + 2 * _BORDER_PX
    start = _BORDER_PX * width + column + _BORDER_PX
    return float((times[start + last * width] - times[start + first * width]) / (last - first))


@compiled(f"{_FRONT_TYPE}(Array(float64, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True))", is_exact=True)
def _prepared(signed: Array, cost: Array) -> Front:
    """A front that has not begun yet: see `way_down`."""
    height, width = cost.shape
    size = (height + 2 * _BORDER_PX) * (width + 2 * _BORDER_PX)
    times, flags, distance, speeds = np.zeros(size), np.empty(size, np.uint8), np.zeros(size), np.empty(size)
    for pixel in range(size):
        flags[pixel], speeds[pixel] = _BORDER, 1.0
    for i in range(height):
        for j in range(width):
            pixel = (i + _BORDER_PX) * (width + 2 * _BORDER_PX) + j + _BORDER_PX
            flags[pixel], distance[pixel], speeds[pixel] = _FAR, signed[i, j], 1.0 / cost[i, j]
    heap, places, count = np.empty(size, np.int64), np.empty(size, np.int64), np.zeros(1, np.int64)
    return times, flags, distance, speeds, heap, places, count


@compiled(
    "Tuple((float64[:, ::1], boolean))(Array(float64, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True),"
    " Array(float64, 1, 'A', readonly=True), Array(float64, 1, 'A', readonly=True), int64, float64, float64, float64)",
    is_exact=True,  # whether a walk of whole steps ends a step later is a matter of the last bit
)
def way_down(
    signed: Array, cost: Array, start: Array, goal: Array, around: int, latest: float, step_px: float, goal_px: float
) -> tuple[Array, bool]:
    """The walk down the arrival times of a front: `minimal_path._arrival` and `minimal_path._descend`.

    Args:
        signed: (h, w) distance from the line about the goal, where the front begins.
        cost: (h, w) one by its speed.
        start: (2,) x and y, where the walk begins.
        goal: (2,) likewise, where it ends.
        around: if the front has passed so many pixels about the start
        latest: by this time, it goes no further.
        step_px: length of a step.
        goal_px: how near to the goal it ends.

    Returns:
        (M, 2) the places; whether the walk got to its goal.
    """
    height, width = cost.shape
    front = _prepared(signed, cost)
    _begin(front, width + 2 * _BORDER_PX)
    times, limit = front[0], np.empty(1)
    limit[0] = latest
    end_row, end_column = round(start[1]), round(start[0])
    last_x, last_y = width - 1.001, height - 1.001  # the last place with four pixels around it
    x, y = min(start[0], last_x), min(start[1], last_y)
    path = np.empty((20 * (height + width) + 2, 2))
    path[0, 0], path[0, 1] = x, y
    for n in range(1, path.shape[0] - 1):
        if math.hypot(x - goal[0], y - goal[1]) < goal_px:
            path[n, 0], path[n, 1] = goal[0], goal[1]
            return path[: n + 1], True
        column, row = int(x), int(y)
        _ask(front, row, column, height, width, limit, end_row, end_column, around)
        right, below = x - column, y - row
        down_x = (1.0 - below) * (
            (1.0 - right) * _slope_along_rows(times, row, column, height, width)
            + right * _slope_along_rows(times, row, column + 1, height, width)
        ) + below * (
            (1.0 - right) * _slope_along_rows(times, row + 1, column, height, width)
            + right * _slope_along_rows(times, row + 1, column + 1, height, width)
        )
        down_y = (1.0 - below) * (
            (1.0 - right) * _slope_along_columns(times, row, column, height, width)
            + right * _slope_along_columns(times, row, column + 1, height, width)
        ) + below * (
            (1.0 - right) * _slope_along_columns(times, row + 1, column, height, width)
            + right * _slope_along_columns(times, row + 1, column + 1, height, width)
        )
        size = math.hypot(down_x, down_y)
        if not size > 0.0:
            return path[:n], False
        x = min(max(x - step_px * down_x / size, 0.0), last_x)
        y = min(max(y - step_px * down_y / size, 0.0), last_y)
        path[n, 0], path[n, 1] = x, y
    return path, False
