"""What planes show along many circles, compiled: see `core/compiled.py`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.float32]
Bytes = npt.NDArray[np.uint8]
Numbers = npt.NDArray[np.int64]


@compiled("void(uint8[:, ::1], int64[:, ::1], int64[:, ::1], int64, int64, uint8[:, :, ::1], uint8[:, ::1])")
def contrasts(
    flat: Bytes, starts: Numbers, directions: Numbers, radii: int, stride: int, shown: Bytes, best: Bytes
) -> None:
    """What a plane shows along shapes, less half of what it shows beside them: `circle_search._contrasts`.

    Args:
        flat: (DIRECTIONS, L) the responses, an image in one piece each.
        starts: (S, P) where each point of each shape begins, radius by radius; P is a multiple of four.
        directions: (S, P) in which image.
        radii: how many shapes differ by their radius alone; the first and the last are beside others only.
        stride: from row to row of an image.
        shown: (inner shapes, H, W) filled.
        best: (inner shapes, H) the most of each row, filled.
    """
    _, height, width = shown.shape
    length = (height - 1) * stride + width
    sums = np.empty((radii, length), np.uint8)
    for tilt in range(starts.shape[0] // radii):
        for radius in range(radii):
            total, shape = sums[radius], tilt * radii + radius
            total[:] = 0
            for k in range(0, starts.shape[1], 4):
                one, two = starts[shape, k], starts[shape, k + 1]
                three, four = starts[shape, k + 2], starts[shape, k + 3]
                a = flat[directions[shape, k], one : one + length]
                b = flat[directions[shape, k + 1], two : two + length]
                c = flat[directions[shape, k + 2], three : three + length]
                d = flat[directions[shape, k + 3], four : four + length]
                for i in range(length):
                    total[i] = np.uint8(total[i] + a[i] + b[i] + c[i] + d[i])
        for radius in range(1, radii - 1):
            inner = tilt * (radii - 2) + radius - 1
            for row in range(height):
                begin = row * stride
                on = sums[radius, begin : begin + width]
                smaller, larger = sums[radius - 1, begin : begin + width], sums[radius + 1, begin : begin + width]
                of_row, most = shown[inner, row], np.uint8(0)
                for i in range(width):
                    aside = (np.int64(smaller[i]) + np.int64(larger[i])) >> 2  # int() of a byte is unsigned here
                    value = np.uint8(np.maximum(np.int64(on[i]) - aside, 0))
                    of_row[i] = value
                    most = max(most, value)
                best[inner, row] = most


@compiled(
    "UniTuple(float64[:, ::1], 2)(float32[:, :, ::1], float64, float64, float64, float64[:, ::1], float64[:, ::1],"
    " float64[:, ::1], float64[:, ::1], int64[:, ::1], float64[::1], float64[::1])"
)
def beside(
    responses: Image,
    left: float,
    top: float,
    cell_m: float,
    columns: Array,
    rows: Array,
    across: Array,
    down: Array,
    direction: Numbers,
    offsets: Array,
    nearness: Array,
) -> tuple[Array, Array]:
    """How far beside points (N, P) a line lies, and the most that is shown there: `circle_fit._line_beside`.

    Args:
        responses: (DIRECTIONS, H, W) of a plane.
        left: of the first column, metres.
        top: of the first row, metres.
        cell_m: from column to column.
        columns: (N, P) of the points, metres.
        rows: (N, P) likewise.
        across: (N, P) unit vectors along which a line is looked for, along columns,
        down: (N, P) and rows.
        direction: (N, P) of the line.
        offsets: (K,) along them, metres.
        nearness: (K,) how much each counts.
    """
    _, height, width = responses.shape
    found, most = np.zeros(columns.shape), np.zeros(columns.shape)
    for n in range(columns.shape[0]):
        for p in range(columns.shape[1]):
            total, weighted, highest = 0.0, 0.0, 0.0
            of_direction = responses[direction[n, p]]
            for k in range(len(offsets)):
                x = int(np.rint((columns[n, p] + offsets[k] * across[n, p] - left) / cell_m))
                y = int(np.rint((rows[n, p] + offsets[k] * down[n, p] - top) / cell_m))
                if 0 <= x < width and 0 <= y < height:
                    value = of_direction[y, x]
                    weight = value * value * nearness[k]
                    total += weight
                    weighted += weight * offsets[k]
                    highest = max(highest, value)
            found[n, p] = weighted / max(total, 1e-6)
            most[n, p] = highest
    return found, most


@compiled(
    "float64[:, ::1](float32[:, :, ::1], float64, float64, float64, float64[:, ::1], float64[:, ::1],"
    " int64[:, ::1], float64[:, ::1])"
)
def means_along(
    responses: Image,
    left: float,
    top: float,
    cell_m: float,
    columns: Array,
    rows: Array,
    direction: Numbers,
    scales: Array,
) -> Array:
    """(N, K) means of the responses along closed curves (N, P) at some scales (N, K): `circle_fit._means_along`."""
    _, height, width = responses.shape
    count, points = columns.shape
    means = np.zeros(scales.shape)
    for n in range(count):
        column, row = columns[n].mean(), rows[n].mean()
        for k in range(scales.shape[1]):
            total, scale = 0.0, scales[n, k]
            for p in range(points):
                x = int(np.rint((column + scale * (columns[n, p] - column) - left) / cell_m))
                y = int(np.rint((row + scale * (rows[n, p] - row) - top) / cell_m))
                if 0 <= x < width and 0 <= y < height:
                    total += responses[direction[n, p], y, x]
            means[n, k] = total / points
    return means


@compiled(
    "void(float64[:, :, ::1], float64[::1], float64[:, ::1], float64, float64, float32[:, ::1], float64, float64,"
    " float64, float32[:, ::1])"
)
def spots_along(
    parts: Array,
    lifts: Array,
    shares: Array,
    distance: float,
    lever: float,
    spots: Image,
    left: float,
    top: float,
    cell_m: float,
    shown: Image,
) -> None:
    """The spots along circles, where both planes show them: `spot_circles._shown_along`.

    Args:
        parts: (N, 3, 4) what the grid asks of each circle's middle and of two radii.
        lifts: (N,) m by which the plane sees each higher.
        shares: (3, P) how much of each is in the points.
        distance: of the grid's centre from the source, metres.
        lever: from the baseline, metres.
        spots: (H, W) of the plane.
        left: of the first column, metres.
        top: of the first row, metres.
        cell_m: from column to column.
        shown: (N, P) is made what the plane shows, where that is less.
    """
    height, width = spots.shape
    points = shares.shape[1]
    columns, rows = np.empty(points), np.empty(points)
    for n in range(parts.shape[0]):
        middle, one, other = parts[n, 0], parts[n, 1], parts[n, 2]
        for p in range(points):
            u, v = shares[1, p], shares[2, p]
            ahead, out = middle[1] + u * one[1] + v * other[1], middle[3] + u * one[3] + v * other[3]
            columns[p] = (distance * (middle[0] + u * one[0] + v * other[0]) / ahead - left) / cell_m
            rows[p] = (lever * (middle[2] + u * one[2] + v * other[2]) / out + lifts[n] - top) / cell_m
        for p in range(points):
            x, y = int(np.rint(columns[p])), int(np.rint(rows[p]))
            value = spots[y, x] if 0 <= x < width and 0 <= y < height else np.float32(0.0)
            shown[n, p] = min(shown[n, p], value)


@compiled("int64[:, ::1](float64[:, ::1], float64[:, ::1], int64)")
def directions(columns: Array, rows: Array, count: int) -> Numbers:
    """(N, P) which of some directions is nearest to closed curves' tangents: `direction_maps.nearest_direction`."""
    curves, points = columns.shape
    nearest = np.empty((curves, points), np.int64)
    for n in range(curves):
        for p in range(points):
            before, after = (p - 1) % points, (p + 1) % points
            down, along = rows[n, after] - rows[n, before], columns[n, after] - columns[n, before]
            nearest[n, p] = int(np.rint(math.atan2(down, along) * (count / math.pi))) % count
    return nearest


@compiled("int64[:, ::1](float64[:, ::1], float64[::1], int64, int64, float64, float64, float64)")
def triples(
    places: Array,
    lifts: Array,
    begun: int,
    neighbours: int,
    nearest_m2: float,
    farthest_m2: float,
    lift_m: float,
) -> Numbers:
    """(3, T) which points can be on a ring together: `spot_circles._triples`."""
    found = np.empty((3, begun * (neighbours * (neighbours - 1) // 2)), np.int64)
    near, total = np.empty(neighbours, np.int64), 0
    for k in range(begun):
        count = 0
        for n in range(len(lifts)):
            squared = 0.0
            for i in range(3):
                squared += (places[n, i] - places[k, i]) ** 2
            if nearest_m2 < squared < farthest_m2 and abs(lifts[n] - lifts[k]) < lift_m:
                near[count] = n
                count += 1
                if count == neighbours:
                    break
        for a in range(count):
            for b in range(a + 1, count):
                one, other = near[a], near[b]
                squared = 0.0
                for i in range(3):
                    squared += (places[other, i] - places[one, i]) ** 2
                if squared > nearest_m2 and abs(lifts[one] - lifts[other]) < lift_m:
                    found[0, total], found[1, total], found[2, total] = k, one, other
                    total += 1
    return np.ascontiguousarray(found[:, :total])
