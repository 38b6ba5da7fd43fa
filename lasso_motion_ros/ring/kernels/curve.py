"""The probability of a loop's curve and its derivatives, compiled: see `core/compiled.py`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.float32]


@compiled("void(float64[:, ::1], float64[:, :, ::1], float64[::1], float64[:, ::1], float64[:, :, ::1])")
def seen(fixed: Array, moving: Array, parameters: Array, pixels: Array, along: Array) -> None:
    """Where a plane sees a curve, and how that depends on the parameters: `loop_curve._View.pixels`.

    Args:
        fixed: (N, 3) homogeneous pixels of the circle.
        moving: (N, 3, P) what each parameter adds to them.
        parameters: (P,).
        pixels: (N, 2), changed.
        along: (N, 2, P), changed.
    """
    count = parameters.shape[0]
    for n in range(fixed.shape[0]):
        x, y, depth = fixed[n, 0], fixed[n, 1], fixed[n, 2]
        for k in range(count):
            x += moving[n, 0, k] * parameters[k]
            y += moving[n, 1, k] * parameters[k]
            depth += moving[n, 2, k] * parameters[k]
        x, y = x / depth, y / depth
        pixels[n, 0], pixels[n, 1] = x, y
        for k in range(count):
            along[n, 0, k] = (moving[n, 0, k] - x * moving[n, 2, k]) / depth
            along[n, 1, k] = (moving[n, 1, k] - y * moving[n, 2, k]) / depth


@compiled("float64(float32[:, ::1], int64, int64)")
def _value(image: Image, row: int, column: int) -> float:
    """Of a pixel (h, w); nothing outside."""
    height, width = image.shape
    return float(image[row, column]) if 0 <= row < height and 0 <= column < width else 0.0


@compiled("float64(float32[:, ::1], float64, float64)")
def _at(image: Image, x: float, y: float) -> float:
    """Of a place between four pixels, bilinear; nothing outside."""
    height, width = image.shape
    if not (-1.0 < x < width and -1.0 < y < height):
        return 0.0
    column, row = math.floor(x), math.floor(y)
    right, below = x - column, y - row
    upper = (1.0 - right) * _value(image, row, column) + right * _value(image, row, column + 1)
    lower = (1.0 - right) * _value(image, row + 1, column) + right * _value(image, row + 1, column + 1)
    return (1.0 - below) * upper + below * lower


@compiled(
    "float64(float32[:, :, ::1], float64[::1], float64, float64[:, ::1], float64[:, :, ::1], "
    "float32[:, :, ::1], float64[::1], float64, float64[:, ::1], float64[:, :, ::1], "
    "float64[::1], float64, float64, float64, float64[::1], float64[:, ::1])"
)
def electrodes(
    sampled_a: Image,
    corner_a: Array,
    amplitude_a: float,
    pixels_a: Array,
    along_a: Array,
    sampled_b: Image,
    corner_b: Array,
    amplitude_b: float,
    pixels_b: Array,
    along_b: Array,
    weights: Array,
    share: float,
    low: float,
    high: float,
    gradient: Array,
    normal: Array,
) -> float:
    """Logarithm of how much likelier one image of each plane is with the curve's electrodes: `loop_curve._of_images`.

    Args:
        sampled_a: (3, h, w) plane A's values and their slopes in x and y,
        corner_a: (2,) its first pixel,
        amplitude_a: of an electrode in it,
        pixels_a: (N, 2) where it sees the curve,
        along_a: (N, 2, P) and how that depends on the parameters.
        sampled_b: likewise,
        corner_b: likewise,
        amplitude_b: likewise,
        pixels_b: likewise,
        along_b: likewise.
        weights: (N,) of the curve's points.
        share: of the arc that is electrodes.
        low: the least that one plane may say against an electrode,
        high: and the most for one.
        gradient: (P,), added to.
        normal: (P, P), added to.
    """
    count = gradient.shape[0]
    slopes = np.empty(count)
    value = 0.0
    for n in range(weights.shape[0]):
        xa, ya = pixels_a[n, 0] - corner_a[0], pixels_a[n, 1] - corner_a[1]
        xb, yb = pixels_b[n, 0] - corner_b[0], pixels_b[n, 1] - corner_b[1]
        one_a = math.exp(amplitude_a * (_at(sampled_a[0], xa, ya) - 0.5 * amplitude_a))
        one_b = math.exp(amplitude_b * (_at(sampled_b[0], xb, yb) - 0.5 * amplitude_b))
        odds = min(max(one_a, low), high) * min(max(one_b, low), high)
        whole = 1.0 - share + share * odds
        value += weights[n] * math.log(whole)
        rising_a = amplitude_a if low <= one_a <= high else 0.0
        rising_b = amplitude_b if low <= one_b <= high else 0.0
        if rising_a == 0.0 and rising_b == 0.0:
            continue
        speaks = share * odds / whole
        steep_ax = speaks * rising_a * _at(sampled_a[1], xa, ya)
        steep_ay = speaks * rising_a * _at(sampled_a[2], xa, ya)
        steep_bx = speaks * rising_b * _at(sampled_b[1], xb, yb)
        steep_by = speaks * rising_b * _at(sampled_b[2], xb, yb)
        for k in range(count):
            slopes[k] = (
                steep_ax * along_a[n, 0, k]
                + steep_ay * along_a[n, 1, k]
                + steep_bx * along_b[n, 0, k]
                + steep_by * along_b[n, 1, k]
            )
            gradient[k] += weights[n] * slopes[k]
        for k in range(count):
            weighted = weights[n] * slopes[k]
            for j in range(count):
                normal[k, j] += weighted * slopes[j]
    return value


@compiled(
    "float64(float64[:, ::1], float64, float64[:, ::1], float64[:, :, ::1], float64, float64, float64[::1], "
    "float64[:, ::1])"
)
def clicked(
    clicks: Array,
    unit: float,
    pixels: Array,
    along: Array,
    freedom: float,
    variance: float,
    gradient: Array,
    normal: Array,
) -> float:
    """Logarithm of how likely one plane's clicks are beside a curve: `loop_curve._of_clicks`.

    Args:
        clicks: (C, 2) pixels.
        unit: millimetres per pixel.
        pixels: (N, 2) of the curve,
        along: (N, 2, P) and how they depend on the parameters.
        freedom: of Student's distribution,
        variance: and its scale, mm².
        gradient: (P,), added to.
        normal: (P, P), added to.
    """
    count, points = gradient.shape[0], pixels.shape[0]
    row = np.empty(count)
    value = 0.0
    for c in range(clicks.shape[0]):
        nearest, least = 0, np.inf
        for n in range(points):
            x, y = clicks[c, 0] - pixels[n, 0], clicks[c, 1] - pixels[n, 1]
            squared = x * x + y * y
            if squared < least:
                nearest, least = n, squared
        nearest = min(max(nearest, 1), points - 2)
        x = pixels[nearest + 1, 0] - pixels[nearest - 1, 0]
        y = pixels[nearest + 1, 1] - pixels[nearest - 1, 1]
        length = max(math.hypot(x, y), 1e-9)
        across_x, across_y = -y / length, x / length
        beside = unit * (
            (clicks[c, 0] - pixels[nearest, 0]) * across_x + (clicks[c, 1] - pixels[nearest, 1]) * across_y
        )
        squared = beside * beside / variance
        weight = (freedom + 1.0) / ((freedom + squared) * variance)
        value -= 0.5 * (freedom + 1.0) * math.log1p(squared / freedom)
        for k in range(count):
            row[k] = unit * (across_x * along[nearest, 0, k] + across_y * along[nearest, 1, k])
            gradient[k] += weight * beside * row[k]
        for k in range(count):
            for j in range(count):
                normal[k, j] += weight * row[k] * row[j]
    return value
