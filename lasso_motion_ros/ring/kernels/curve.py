"""The probability of a loop's curve and its derivatives, compiled: see `core/compiled.py`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.float32]


@compiled("UniTuple(float64, 3)(float32[:, :, ::1], float64, float64)")
def _at(sampled: Image, x: float, y: float) -> tuple[float, float, float]:
    """Value and slopes (3, h, w) of a place between four pixels, bilinear; nothing outside."""
    _, height, width = sampled.shape
    value, across, down = 0.0, 0.0, 0.0
    if -1.0 < x < width and -1.0 < y < height:
        column, row = math.floor(x), math.floor(y)
        right, below = x - column, y - row
        for j in range(2):
            for i in range(2):
                if 0 <= row + j < height and 0 <= column + i < width:
                    share = (right if i else 1.0 - right) * (below if j else 1.0 - below)
                    value += share * sampled[0, row + j, column + i]
                    across += share * sampled[1, row + j, column + i]
                    down += share * sampled[2, row + j, column + i]
    return value, across, down


@compiled("void(float64[:, ::1], float64, float64[::1], float64[:, ::1], float64[::1])")
def _solved(normal: Array, damping: float, right: Array, lower: Array, step: Array) -> None:
    """The step (P,) that a normal matrix (P, P) with a larger diagonal takes to the right side, by Cholesky.

    Args:
        normal: positive definite.
        damping: share of its diagonal that is added.
        right: (P,).
        lower: (P, P) room for the factor.
        step: (P,), changed.
    """
    count = len(right)
    for k in range(count):
        for j in range(k + 1):
            total = normal[k, j] * (1.0 + damping) if j == k else normal[k, j]
            for i in range(j):
                total -= lower[k, i] * lower[j, i]
            lower[k, j] = math.sqrt(total) if j == k else total / lower[j, j]
    for k in range(count):
        total = right[k]
        for i in range(k):
            total -= lower[k, i] * step[i]
        step[k] = total / lower[k, k]
    for k in range(count - 1, -1, -1):
        total = step[k]
        for i in range(k + 1, count):
            total -= lower[i, k] * step[i]
        step[k] = total / lower[k, k]


@compiled(
    "float64(float64[::1], float64, float64[:, ::1], float64[:, :, ::1], float64, float64, int64, float64[:, ::1],"
    " float64[::1])"
)
def _clicked(
    click: Array,
    unit: float,
    seen: Array,
    moving: Array,
    freedom: float,
    variance: float,
    number: int,
    rows: Array,
    pulls: Array,
) -> float:
    """Logarithm of how likely one click of a plane is beside a curve: `loop_curve._of_clicks`.

    Args:
        click: (2,) pixels.
        unit: millimetres per pixel.
        seen: (3, N) x and y of the curve, pixels, and their third homogeneous coordinate,
        moving: (3, P, N) and what each parameter adds to the homogeneous pixels.
        freedom: of Student's distribution,
        variance: and its scale, mm².
        number: of the click, among all that is seen.
        rows: (P, M) its column is filled: how it depends on each parameter,
        pulls: (M,) and how far it pulls.
    """
    count, points = rows.shape[0], seen.shape[1]
    nearest, least = 0, np.inf
    for n in range(points):
        x, y = click[0] - seen[0, n], click[1] - seen[1, n]
        squared = x * x + y * y
        if squared < least:
            nearest, least = n, squared
    nearest = min(max(nearest, 1), points - 2)
    x, y = seen[0, nearest + 1] - seen[0, nearest - 1], seen[1, nearest + 1] - seen[1, nearest - 1]
    length = max(math.hypot(x, y), 1e-9)
    across_x, across_y = -y / length, x / length
    beside = unit * ((click[0] - seen[0, nearest]) * across_x + (click[1] - seen[1, nearest]) * across_y)
    squared = beside * beside / variance
    weight = math.sqrt((freedom + 1.0) / ((freedom + squared) * variance))
    pulls[number] = weight * beside
    to_pixels = weight * unit / seen[2, nearest]
    across_x, across_y = to_pixels * across_x, to_pixels * across_y
    nearer = across_x * seen[0, nearest] + across_y * seen[1, nearest]
    for k in range(count):
        rows[k, number] = across_x * moving[0, k, nearest] + across_y * moving[1, k, nearest]
        rows[k, number] -= nearer * moving[2, k, nearest]
    return -0.5 * (freedom + 1.0) * math.log1p(squared / freedom)


@compiled(
    "float64(float64[::1], float64[::1], float64[:, :, ::1], float64[:, :, :, ::1], float64[:, ::1], float64[:, ::1],"
    " float64[::1], float32[:, :, ::1], float32[:, :, ::1], float32[:, :, ::1], float32[:, :, ::1],"
    " float64[:, :, ::1], float64[:, ::1], float64[:, ::1], float64, float64, float64, float64, float64,"
    " float64[::1], float64[:, ::1])"
)
def probability(
    parameters: Array,
    precision: Array,
    fixed: Array,
    moving: Array,
    clicks_a: Array,
    clicks_b: Array,
    units: Array,
    coarse_a: Image,
    coarse_b: Image,
    fine_a: Image,
    fine_b: Image,
    corners: Array,
    amplitudes: Array,
    weights: Array,
    share: float,
    low: float,
    high: float,
    freedom: float,
    variance: float,
    gradient: Array,
    normal: Array,
) -> float:
    """Logarithm of a curve's probability, its gradient, and about its negative second derivatives.

    As `loop_curve._Fit._probability`. How pixels depend on the parameters is not written down: what a point says is a
    sum of what each parameter adds to its homogeneous pixels.

    Args:
        parameters: (P,) of the curve.
        precision: (P,) of theirs, before anything is seen.
        fixed: (2, 3, N) per plane, homogeneous pixels of the circle.
        moving: (2, 3, P, N) what each parameter adds to them.
        clicks_a: (C, 2) plane A's, pixels.
        clicks_b: likewise.
        units: (2,) millimetres per pixel.
        coarse_a: (3, h, w) plane A's values and their slopes in x and y.
        coarse_b: likewise.
        fine_a: likewise, of a second image; not looked at where there are weights for one only.
        fine_b: likewise.
        corners: (images, 2, 2) per image and plane, its first pixel.
        amplitudes: (images, 2) of an electrode in it.
        weights: (images, N) of the curve's points.
        share: of the arc that is electrodes.
        low: the least that one plane may say against an electrode,
        high: and the most for one.
        freedom: of Student's distribution of the clicks,
        variance: and its scale, mm².
        gradient: (P,), changed.
        normal: (P, P), changed.
    """
    count, points, layers = parameters.shape[0], fixed.shape[2], weights.shape[0]
    beside = layers * points
    # Each column is what one thing that is seen, of weight 1, depends on; and how far it pulls along that.
    things = beside + clicks_a.shape[0] + clicks_b.shape[0]
    rows, pulls = np.zeros((count, things)), np.zeros(things)
    value = 0.0
    seen = fixed.copy()
    for plane in range(2):
        for i in range(3):
            of_points = seen[plane, i]
            for k in range(count):
                moved, by = moving[plane, i, k], parameters[k]
                for n in range(points):
                    of_points[n] += moved[n] * by
        for n in range(points):
            seen[plane, 0, n] /= seen[plane, 2, n]
            seen[plane, 1, n] /= seen[plane, 2, n]
    pull = np.zeros((2, 3, points))  # of the homogeneous pixels' changes
    for layer in range(layers):
        in_a, in_b = (fine_a, fine_b) if layer else (coarse_a, coarse_b)
        amplitude_a, amplitude_b = amplitudes[layer, 0], amplitudes[layer, 1]
        corner_ax, corner_ay = corners[layer, 0, 0], corners[layer, 0, 1]
        corner_bx, corner_by = corners[layer, 1, 0], corners[layer, 1, 1]
        first = layer * points
        for n in range(points):
            value_a, across_a, down_a = _at(in_a, seen[0, 0, n] - corner_ax, seen[0, 1, n] - corner_ay)
            value_b, across_b, down_b = _at(in_b, seen[1, 0, n] - corner_bx, seen[1, 1, n] - corner_by)
            one_a = math.exp(amplitude_a * (value_a - 0.5 * amplitude_a))
            one_b = math.exp(amplitude_b * (value_b - 0.5 * amplitude_b))
            odds = min(max(one_a, low), high) * min(max(one_b, low), high)
            whole = 1.0 - share + share * odds
            value += weights[layer, n] * math.log(whole)
            weight = math.sqrt(weights[layer, n])
            speaks = weight * share * odds / whole
            rising_a = amplitude_a * speaks / seen[0, 2, n] if low <= one_a <= high else 0.0
            rising_b = amplitude_b * speaks / seen[1, 2, n] if low <= one_b <= high else 0.0
            pull[0, 0, n], pull[0, 1, n] = rising_a * across_a, rising_a * down_a
            pull[1, 0, n], pull[1, 1, n] = rising_b * across_b, rising_b * down_b
            for plane in range(2):
                nearer = pull[plane, 0, n] * seen[plane, 0, n] + pull[plane, 1, n] * seen[plane, 1, n]
                pull[plane, 2, n] = -nearer
            pulls[first + n] = weight
        for k in range(count):
            row = rows[k, first : first + points]
            for plane in range(2):
                for i in range(3):
                    moved, by = moving[plane, i, k], pull[plane, i]
                    for n in range(points):
                        row[n] += by[n] * moved[n]
    for plane in range(2):
        clicks = clicks_b if plane else clicks_a
        for c in range(clicks.shape[0]):
            value += _clicked(
                clicks[c], units[plane], seen[plane], moving[plane], freedom, variance, beside, rows, pulls
            )
            beside += 1
    for k in range(count):
        value -= 0.5 * precision[k] * parameters[k] * parameters[k]
        row, total = rows[k], 0.0
        for n in range(beside):
            total += row[n] * pulls[n]
        gradient[k] = total - precision[k] * parameters[k]
        for j in range(k + 1):
            other, total = rows[j], 0.0
            for n in range(beside):
                total += row[n] * other[n]
            normal[k, j] = normal[j, k] = total
        normal[k, k] += precision[k]
    return value


@compiled(
    "float64(float64[::1], float64[::1], float64[:, :, ::1], float64[:, :, :, ::1], float64[:, ::1], float64[:, ::1],"
    " float64[::1], float32[:, :, ::1], float32[:, :, ::1], float32[:, :, ::1], float32[:, :, ::1],"
    " float64[:, :, ::1], float64[:, ::1], float64[:, ::1], float64, float64, float64, float64, float64,"
    " float64[:, :, ::1], int64, float64, float64, float64, float64, float64)"
)
def climb(
    parameters: Array,
    precision: Array,
    fixed: Array,
    moving: Array,
    clicks_a: Array,
    clicks_b: Array,
    units: Array,
    coarse_a: Image,
    coarse_b: Image,
    fine_a: Image,
    fine_b: Image,
    corners: Array,
    amplitudes: Array,
    weights: Array,
    share: float,
    low: float,
    high: float,
    freedom: float,
    variance: float,
    moved: Array,
    steps: int,
    least: float,
    damping: float,
    most: float,
    largest_step_mm: float,
    settled: float,
) -> float:
    """Go to the maximum of the probability, and what that is: `loop_curve._Fit.climb`.

    Args:
        parameters: (P,) to begin with, changed.
        precision: this and all until `variance` as of `probability`.
        fixed: likewise.
        moving: likewise.
        clicks_a: likewise.
        clicks_b: likewise.
        units: likewise.
        coarse_a: likewise.
        coarse_b: likewise.
        fine_a: likewise.
        fine_b: likewise.
        corners: likewise.
        amplitudes: likewise.
        weights: likewise.
        share: likewise.
        low: likewise.
        high: likewise.
        freedom: likewise.
        variance: likewise.
        moved: (N, 3, P - 1) metres by which each parameter but the last moves a point.
        steps: at most.
        least: damping,
        damping: the first,
        most: and the largest.
        largest_step_mm: of a point.
        settled: gain of a step that is the last.
    """
    count = parameters.shape[0]
    gradient, normal = np.empty(count), np.empty((count, count))
    its_gradient, its_normal = np.empty(count), np.empty((count, count))
    lower, step, there = np.empty((count, count)), np.empty(count), np.empty(count)
    here = probability(
        parameters,
        precision,
        fixed,
        moving,
        clicks_a,
        clicks_b,
        units,
        coarse_a,
        coarse_b,
        fine_a,
        fine_b,
        corners,
        amplitudes,
        weights,
        share,
        low,
        high,
        freedom,
        variance,
        gradient,
        normal,
    )
    for _ in range(steps):
        _solved(normal, damping, gradient, lower, step)
        longest = 0.0
        for n in range(moved.shape[0]):
            squared = 0.0
            for i in range(3):
                way, by = moved[n, i], 0.0
                for k in range(count - 1):
                    by += way[k] * step[k]
                squared += by * by
            longest = max(longest, squared)
        shorter = min(1.0, largest_step_mm / max(1e3 * math.sqrt(longest), 1e-9))
        for k in range(count):
            there[k] = parameters[k] + shorter * step[k]
        its = probability(
            there,
            precision,
            fixed,
            moving,
            clicks_a,
            clicks_b,
            units,
            coarse_a,
            coarse_b,
            fine_a,
            fine_b,
            corners,
            amplitudes,
            weights,
            share,
            low,
            high,
            freedom,
            variance,
            its_gradient,
            its_normal,
        )
        if its > here:
            gained, here = its - here, its
            gradient, its_gradient = its_gradient, gradient
            normal, its_normal = its_normal, normal
            for k in range(count):
                parameters[k] = there[k]
            damping = max(damping / 3.0, least)
            if gained < settled:
                break
        else:
            damping *= 4.0
            if damping > most:
                break
    return here
