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
Flags = npt.NDArray[np.bool_]


@compiled("void(uint8[:, ::1], int64[:, ::1], int64[:, ::1], int64, int64, uint8[:, :, ::1], uint8[:, ::1])")
def contrasts(
    flat: Bytes, starts: Numbers, directions: Numbers, radii: int, stride: int, shown: Bytes, best: Bytes
) -> None:
    """What a plane shows along shapes, less half of what it shows beside them: `circle_search._contrasts`.

    Args:
        flat: (DIRECTIONS, L) the responses, an image in one piece each.
        starts: (S, P) where each point of each shape begins, radius by radius; P is a multiple of twelve.
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
            for k in range(0, starts.shape[1], 12):
                # Twelve at a time: what has been summed is read and written a third as often as the images.
                first, which = starts[shape, k : k + 12], directions[shape, k : k + 12]
                a, b = flat[which[0], first[0] :], flat[which[1], first[1] :]
                c, d = flat[which[2], first[2] :], flat[which[3], first[3] :]
                e, f = flat[which[4], first[4] :], flat[which[5], first[5] :]
                g, h = flat[which[6], first[6] :], flat[which[7], first[7] :]
                m, n = flat[which[8], first[8] :], flat[which[9], first[9] :]
                o, p = flat[which[10], first[10] :], flat[which[11], first[11] :]
                for i in range(length):
                    six = a[i] + b[i] + c[i] + d[i] + e[i] + f[i]
                    total[i] = np.uint8(total[i] + six + g[i] + h[i] + m[i] + n[i] + o[i] + p[i])
        for radius in range(1, radii - 1):
            inner = tilt * (radii - 2) + radius - 1
            for row in range(height):
                begin = row * stride
                on = sums[radius, begin : begin + width]
                smaller, larger = sums[radius - 1, begin : begin + width], sums[radius + 1, begin : begin + width]
                of_row, most = shown[inner, row], np.uint8(0)
                for i in range(width):
                    aside = np.uint8(
                        (np.int64(smaller[i]) + np.int64(larger[i])) >> 2
                    )  # int() of a byte is unsigned here
                    of_row[i] = np.uint8(on[i] - aside) if on[i] > aside else np.uint8(0)
                for i in range(width):
                    most = of_row[i] if of_row[i] > most else most
                best[inner, row] = most


@compiled("int64(float64, float64, int64)")
def _direction(along: float, down: float, count: int) -> int:
    """Which of some directions of half a turn is nearest to a line's."""
    nearest = int(np.rint(math.atan2(down, along) * (count / math.pi)))
    if nearest < 0:
        nearest += count
    return nearest - count if nearest >= count else nearest


@compiled("void(float64[::1], float64[::1], float64[::1], float64[::1], int64, int64[::1])")
def _turned(columns: Array, rows: Array, along: Array, down: Array, count: int, direction: Numbers) -> None:
    """Which way a closed curve (P,) goes: from before to after each point, and the nearest of some directions."""
    points = len(columns)
    for p in range(points):
        before, after = (p if p else points) - 1, p + 1 if p + 1 < points else 0
        along[p], down[p] = columns[after] - columns[before], rows[after] - rows[before]
        direction[p] = _direction(along[p], down[p], count)


@compiled("float64(float32[:, :, ::1], int64[::1], float64[::1], float64[::1], float64, float64, float64)")
def _mean(
    responses: Image, direction: Numbers, columns: Array, rows: Array, left: float, top: float, cell_m: float
) -> float:
    """Of some directions (P,) at columns and rows (P,), m; nothing outside."""
    _, height, width = responses.shape
    total = 0.0
    for p in range(len(direction)):
        x, y = int(np.rint((columns[p] - left) / cell_m)), int(np.rint((rows[p] - top) / cell_m))
        if 0 <= x < width and 0 <= y < height:
            total += responses[direction[p], y, x]
    return total / len(direction)


@compiled("void(float64[:, ::1], float64, float64[:, ::1], float64, float64, float64[::1], float64[::1])")
def _lay(parts: Array, lift: float, shares: Array, distance: float, lever: float, columns: Array, rows: Array) -> None:
    """Columns and rows (P,) of a circle's points, m: `circles.laid`.

    Args:
        parts: (3, 4) what the grid asks of its middle and of two radii.
        lift: m by which the plane sees it higher.
        shares: (3, P) how much of each is in the points.
        distance: of the grid's centre from the source, m.
        lever: from the baseline, m.
        columns: filled.
        rows: filled.
    """
    middle, one, other = parts[0], parts[1], parts[2]
    for p in range(len(columns)):
        u, v = shares[1, p], shares[2, p]
        ahead, out = middle[1] + u * one[1] + v * other[1], middle[3] + u * one[3] + v * other[3]
        columns[p] = distance * (middle[0] + u * one[0] + v * other[0]) / ahead
        rows[p] = lever * (middle[2] + u * one[2] + v * other[2]) / out + lift


@compiled(
    "void(float64[:, :, ::1], float64[::1], float64[:, ::1], float64, float64, float64[::1], bool_[::1],"
    " float32[:, :, ::1], float64, float64, float64, float64, float64, float64[::1], float64, float64, float64[::1])"
)
def shown_along(
    parts: Array,
    lifts: Array,
    shares: Array,
    distance: float,
    lever: float,
    radii: Array,
    is_narrow: Flags,
    responses: Image,
    left: float,
    top: float,
    cell_m: float,
    beside_m: float,
    beside_share: float,
    beyond_m: Array,
    narrow_beside: float,
    beyond_share: float,
    shown: Array,
) -> None:
    """What a plane shows along circles, less what it shows beside them: `circle_fit._shown_along`.

    Args:
        parts: (N, 3, 4) what the grid asks of each circle's middle and of two radii.
        lifts: (N,) m by which the plane sees each higher.
        shares: (3, P) how much of each is in the points.
        distance: of the grid's centre from the source, m.
        lever: from the baseline, m.
        radii: (N,) m.
        is_narrow: (N,) whether the plane sees a circle nearly edge-on.
        responses: (DIRECTIONS, H, W) of the plane, widened.
        left: of the first column, m.
        top: of the first row, m.
        cell_m: from column to column.
        beside_m: this and the next four as of the tuning of `circle_fit`.
        beside_share: likewise.
        beyond_m: likewise.
        narrow_beside: likewise.
        beyond_share: likewise.
        shown: (N,) filled.
    """
    count, points = responses.shape[0], shares.shape[1]
    columns, rows, direction = np.empty(points), np.empty(points), np.empty(points, np.int64)
    along, down, aside_columns, aside_rows = np.empty(points), np.empty(points), np.empty(points), np.empty(points)
    ends = 2 * len(beyond_m)
    onward, end_columns, end_rows = np.empty(ends, np.int64), np.empty(ends), np.empty(ends)
    for n in range(len(radii)):
        _lay(parts[n], lifts[n], shares, distance, lever, columns, rows)
        _turned(columns, rows, along, down, count, direction)
        column, row, beside = columns.mean(), rows.mean(), 0.0
        for way in (-1.0, 1.0):
            scale = 1.0 + way * beside_m / radii[n]
            for p in range(points):
                aside_columns[p] = column + scale * (columns[p] - column)
                aside_rows[p] = row + scale * (rows[p] - row)
            beside += 0.5 * _mean(responses, direction, aside_columns, aside_rows, left, top, cell_m)
        if is_narrow[n]:
            area, farthest, far = 0.0, -1.0, 0
            for p in range(points):
                after = p + 1 if p + 1 < points else 0
                area += columns[p] * rows[after] - rows[p] * columns[after]
                away = math.hypot(columns[p] - column, rows[p] - row)
                if away > farthest:
                    farthest, far = away, p
            outward = -beside_m if area < 0.0 else beside_m
            for p in range(points):
                length = max(math.hypot(along[p], down[p]), 1e-12)
                aside_columns[p] = columns[p] + outward * down[p] / length
                aside_rows[p] = rows[p] - outward * along[p] / length
            sides = _mean(responses, direction, aside_columns, aside_rows, left, top, cell_m)
            x, y = (columns[far] - column) / farthest, (rows[far] - row) / farthest
            onward[:] = _direction(x, y, count)
            for k in range(ends):
                reach = (1 - 2 * (k % 2)) * (farthest + beyond_m[k // 2])
                end_columns[k], end_rows[k] = column + reach * x, row + reach * y
            beyond = _mean(responses, onward, end_columns, end_rows, left, top, cell_m)
            beside = min(beside, narrow_beside + sides + beyond_share * beyond)
        on = _mean(responses, direction, columns, rows, left, top, cell_m)
        shown[n] = on - beside_share * beside


@compiled(
    "void(float64[:, :, ::1], float64[::1], float64[:, ::1], float64, float64, float64[:, ::1], float64[:, :, ::1],"
    " float64, float32[:, :, ::1], float64, float64, float64, float64[::1], float64[::1], float64[:, :, ::1],"
    " float64[:, ::1])"
)
def pull(
    parts: Array,
    lifts: Array,
    shares: Array,
    distance: float,
    lever: float,
    basis: Array,
    ways: Array,
    lifted: float,
    responses: Image,
    left: float,
    top: float,
    cell_m: float,
    offsets: Array,
    nearness: Array,
    normal: Array,
    right: Array,
) -> None:
    """Add what the lines beside circles in one plane say of a step towards them: `circle_fit._pull`.

    Args:
        parts: (N, 3, 4) what the grid asks of each circle's middle and of two radii.
        lifts: (N,) m by which the plane sees each higher.
        shares: (3, P) how much of each is in the points: 1, cosine and sine.
        distance: of the grid's centre from the source, m.
        lever: from the baseline, m.
        basis: (2, 3) unit vectors along the plane's columns and rows.
        ways: (N, 3, 2) how far along those each circle's tilt, and two axes across it, move its points.
        lifted: m by which a lift of a metre moves them along the rows.
        responses: (DIRECTIONS, H, W) of the plane.
        left: of the first column, m.
        top: of the first row, m.
        cell_m: from column to column.
        offsets: (K,) m across a circle, at which a line is looked for,
        nearness: (K,) and how much each counts.
        normal: (N, 7, 7) added to.
        right: (N, 7) added to.
    """
    count, points = responses.shape[0], shares.shape[1]
    columns, rows, jacobian, row = np.empty(points), np.empty(points), np.empty((7, points)), np.empty(points)
    weights, pulled, direction = np.empty(points), np.empty(points), np.empty(points, np.int64)
    _, height, width = responses.shape
    along, down, length = np.empty(points), np.empty(points), np.empty(points)
    for n in range(len(lifts)):
        _lay(parts[n], lifts[n], shares, distance, lever, columns, rows)
        _turned(columns, rows, along, down, count, direction)
        mean, tilt, first, second = 0.0, ways[n, 0], ways[n, 1], ways[n, 2]
        for p in range(points):
            length[p] = max(math.hypot(along[p], down[p]), 1e-12)
            along[p] /= length[p]
            down[p] /= length[p]
            mean += length[p] / points
        for p in range(points):
            # Across the circle, and the line that is looked for there.
            x, y = -down[p], along[p]
            total, weighted, most = 0.0, 0.0, 0.0
            of_direction = responses[direction[p]]
            for i in range(len(offsets)):
                at_column = int(np.rint((columns[p] + offsets[i] * x - left) / cell_m))
                at_row = int(np.rint((rows[p] + offsets[i] * y - top) / cell_m))
                value = (
                    of_direction[at_row, at_column]
                    if 0 <= at_column < width and 0 <= at_row < height
                    else np.float32(0.0)
                )
                weight = value * value * nearness[i]
                total += weight
                weighted += weight * offsets[i]
                most = max(most, float(value))
            # Where a plane sees the circle's side, its points lie close together.
            weights[p], pulled[p] = most * min(1.0, length[p] / mean), weighted / max(total, 1e-6)
        for p in range(points):
            x, y, cosine, sine = -down[p], along[p], shares[1, p], shares[2, p]
            for i in range(3):
                jacobian[i, p] = x * basis[0, i] + y * basis[1, i]
            tilted = x * tilt[0] + y * tilt[1]
            jacobian[3, p], jacobian[4, p] = sine * tilted, cosine * tilted
            jacobian[5, p] = cosine * (x * first[0] + y * first[1]) + sine * (x * second[0] + y * second[1])
            jacobian[6, p] = lifted * y
        for i in range(7):
            one, total = jacobian[i], 0.0
            for p in range(points):
                row[p] = one[p] * weights[p]
                total += row[p] * pulled[p]
            right[n, i] += total
            for j in range(i + 1):
                other, total = jacobian[j], 0.0
                for p in range(points):
                    total += row[p] * other[p]
                normal[n, i, j] += total
        for i in range(7):
            for j in range(i):
                normal[n, j, i] = normal[n, i, j]


@compiled("int64[:, ::1](float64[:, ::1], float64[:, ::1], int64)")
def directions(columns: Array, rows: Array, count: int) -> Numbers:
    """(N, P) which of some directions is nearest to closed curves' tangents: `direction_maps.nearest_direction`."""
    curves, points = columns.shape
    nearest, along, down = np.empty((curves, points), np.int64), np.empty(points), np.empty(points)
    for n in range(curves):
        _turned(columns[n], rows[n], along, down, count, nearest[n])
    return nearest


@compiled(
    "void(float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[::1], int64, int64, int64, float32[:, :, ::1],"
    " float32[:, ::1])"
)
def laid_places(
    matrix: Array, aside: Array, up: Array, rows: Array, margin: int, width: int, height: int, at: Image, inside: Image
) -> None:
    """Where an image shows a grid: `laid_image._places`.

    Args:
        matrix: (3, 4) projection.
        aside: (W, 3) world points of the columns, at height 0,
        up: (W, 3) and how far a metre of height goes there.
        rows: (H,) heights, m.
        margin: pixels of the image that are not inside.
        width: of the image, pixels.
        height: likewise.
        at: (H, W, 2) pixels, filled.
        inside: (H, W) 1 where the image reaches, filled.
    """
    count = len(aside)
    seen, risen = np.empty((3, count)), np.empty((3, count))
    for i in range(3):
        for column in range(count):
            total, more = matrix[i, 3], 0.0
            for j in range(3):
                total += matrix[i, j] * aside[column, j]
                more += matrix[i, j] * up[column, j]
            seen[i, column], risen[i, column] = total, more
    for k in range(len(rows)):
        row, of_row, is_inside = rows[k], at[k], inside[k]
        for column in range(count):
            depth = seen[2, column] + row * risen[2, column]
            x = np.float32((seen[0, column] + row * risen[0, column]) / depth)
            y = np.float32((seen[1, column] + row * risen[1, column]) / depth)
            of_row[column, 0], of_row[column, 1] = x, y
            is_in = margin < x < width - margin - 1 and margin < y < height - margin - 1
            is_inside[column] = np.float32(1.0) if is_in else np.float32(0.0)


@compiled(
    "void(float32[:, ::1], float32[:, ::1], float32[:, ::1], float32[:, ::1], float64[:, ::1], int64[:, ::1],"
    " int64[:, ::1], float64[::1], float64, float64, float64, float32[:, :, ::1])"
)
def lines(
    xx: Image,
    yy: Image,
    xy: Image,
    inside: Image,
    across: Array,
    x_steps: Numbers,
    y_steps: Numbers,
    weights: Array,
    outlier: float,
    floor: float,
    ceiling: float,
    responses: Image,
) -> None:
    """The responses to lines of each direction: `direction_maps.direction_maps`.

    Args:
        xx: (H, W) second derivative along the columns,
        yy: (H, W) along the rows,
        xy: (H, W) and mixed.
        inside: (H, W) 1 where the image reaches.
        across: (DIRECTIONS, 3) how much of each of the three is in that across a line.
        x_steps: (DIRECTIONS, S) cells along a line,
        y_steps: (DIRECTIONS, S) likewise,
        weights: (S,) and how much each counts.
        outlier: what is denser counts no more.
        floor: of the mean along a line, in units of its rms,
        ceiling: and where the response is 1.
        responses: (DIRECTIONS, H, W) of zeros, filled.
    """
    count, height, width = responses.shape
    reach = max(np.abs(x_steps).max(), np.abs(y_steps).max())
    # Within a margin of nothing.
    padded = np.zeros((height + 2 * reach, width + 2 * reach), np.float32)
    most, power, area = np.float32(outlier), 0.0, 0.0
    for k in range(count):
        of_xx, of_yy, of_xy = np.float32(across[k, 0]), np.float32(across[k, 1]), np.float32(across[k, 2])
        for row in range(height):
            shown, one, two, mixed = padded[row + reach], xx[row], yy[row], xy[row]
            for i in range(width):
                value = of_xx * one[i] + of_yy * two[i] + of_xy * mixed[i]
                shown[reach + i] = min(max(value, -most), most)
        for row in range(height):
            response = responses[k, row]
            for step in range(len(weights)):
                weight, first = np.float32(weights[step]), reach + x_steps[k, step]
                along = padded[row + reach + y_steps[k, step], first : first + width]
                for i in range(width):
                    response[i] += weight * along[i]
            for i in range(width):
                power += float(response[i]) * float(response[i])
    for row in range(height):
        for i in range(width):
            area += inside[row, i]
    rms = np.float32(max(math.sqrt(power / max(count * area, 1.0)), 1e-6))
    least, scale = np.float32(floor), np.float32(1.0 / (ceiling - floor))
    for k in range(count):
        for row in range(height):
            response, reaches = responses[k, row], inside[row]
            for i in range(width):
                value = (response[i] * (reaches[i] / rms) - least) * scale
                response[i] = min(max(value, np.float32(0.0)), np.float32(1.0))


@compiled("void(float32[:, :, ::1], int64[:, ::1], int64[:, ::1], int64[:, ::1], int64[:, ::1], float64[:, ::1])")
def laid_elsewhere(
    responses: Image, directions: Numbers, x: Numbers, y: Numbers, elsewhere: Numbers, means: Array
) -> None:
    """The mean response to lines along curves, wherever they are laid: `lines_elsewhere._stand_out`.

    Args:
        responses: (DIRECTIONS, H, W) of a plane, widened.
        directions: (N, P) in which of them.
        x: (N, P) columns of the curves' points, cells.
        y: (N, P) rows.
        elsewhere: (2, K) cells along columns and rows by which they are laid aside.
        means: (N, K) filled.
    """
    _, height, width = responses.shape
    curves, points = x.shape
    for n in range(curves):
        for k in range(elsewhere.shape[1]):
            aside, below, total = elsewhere[0, k], elsewhere[1, k], 0.0
            for p in range(points):
                column, row = x[n, p] + aside, y[n, p] + below
                if 0 <= column < width and 0 <= row < height:
                    total += responses[directions[n, p], row, column]
            means[n, k] = total / points
