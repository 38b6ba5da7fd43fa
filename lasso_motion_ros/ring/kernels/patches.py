"""Where a patch of an image has gone in the next one, compiled: see `core/compiled.py` and `companion_patches`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled
from lasso_motion_ros.ring.kernels.search import vertex

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.float32]
Pixels = npt.NDArray[np.uint8 | np.uint16]

# Columns of a patch that are multiplied at a time: their sum is read and written once for all of them.
_TAPS = 8


def _of_either(signature: str) -> tuple[str, str]:
    """A signature for images of both types of pixels."""
    return signature.format("uint8"), signature.format("uint16")


_CELLS = (
    "float32[:, ::1](Array({}, 2, 'C', readonly=True), int64, int64, int64, int64, int64,"
    " Array(float32, 1, 'C', readonly=True))"
)


@compiled(*_of_either(_CELLS))
def _logarithms(pixels: Pixels, cell: int, left: int, top: int, right: int, bottom: int, known: Image) -> Image:
    """(bottom - top, right - left) logarithms of the grey values in cells of an image, one at least.

    Args:
        pixels: (H, W).
        cell: pixels on a side of a cell.
        left: the first column of cells.
        top: the first row of them.
        right: behind the last column.
        bottom: behind the last row.
        known: `working_image.grey_logarithms`.
    """
    columns, width = right - left, (right - left) * cell
    sums, cells = np.empty(width, np.float32), np.empty(columns, np.float32)  # of whole numbers: exact
    made, share = np.empty((bottom - top, columns), np.float32), np.float32(1.0 / (cell * cell))
    for i in range(bottom - top):
        sums[:] = 0.0
        for k in range(cell):
            row = pixels[(top + i) * cell + k, left * cell : right * cell]
            for j in range(width):
                sums[j] += np.float32(row[j])
        own = made[i]
        # To whole grey values, as `cv2.resize` rounds them. (With a fixed number of terms vectors are made.)
        if cell == 2:
            for j in range(columns):
                cells[j] = np.floor(share * (sums[2 * j] + sums[2 * j + 1]) + np.float32(0.5))
        elif cell == 4:
            for j in range(columns):
                cells[j] = np.rint(share * (sums[4 * j] + sums[4 * j + 1] + sums[4 * j + 2] + sums[4 * j + 3]))
        else:
            for j in range(columns):
                total = np.float32(0.0)
                for k in range(cell):
                    total += sums[j * cell + k]
                cells[j] = np.rint(share * total)
        for j in range(columns):
            own[j] = known[np.int32(cells[j])]
    return made


@compiled("float32[:, ::1](float32[:, ::1], Array(float32, 1, 'C', readonly=True))")
def _blurred(values: Image, taps: Image) -> Image:
    """What the blurs of `kernels.blur` do, by any number of taps."""
    height, width = values.shape
    reach = taps.size - 1
    made, line = np.empty_like(values), np.empty(width + 2 * reach, np.float32)
    inner = line[reach:]
    for i in range(height):
        own, tap = values[i], taps[0]
        for j in range(width):
            inner[j] = tap * own[j]
        for k in range(1, reach + 1):
            above, below, tap = values[abs(i - k)], values[height - 1 - abs(height - 1 - k - i)], taps[k]
            for j in range(width):
                inner[j] += tap * (above[j] + below[j])
        for k in range(1, reach + 1):
            line[reach - k], line[reach + width - 1 + k] = line[reach + k], line[reach + width - 1 - k]
        own, tap = made[i], taps[0]
        for j in range(width):
            own[j] = tap * inner[j]
        for k in range(1, reach + 1):
            before, after, tap = line[reach - k :], line[reach + k :], taps[k]
            for j in range(width):
                own[j] += tap * (before[j] + after[j])
    return made


@compiled("float32[:, ::1](float32[:, ::1], Array(float32, 2, 'C', readonly=True))")
def _products(shown: Image, pattern: Image) -> Image:
    """Scalar products of a pattern (n, n) with what is shown (h, w) wherever it fits in.

    They are (h - n + 1, w - n + 1 or more): columns beyond say nothing.
    """
    side, (height, width) = pattern.shape[0], shown.shape
    # Zeros behind both, so that columns are whole multiples of the taps.
    columns = -(-(width - side + 1) // _TAPS) * _TAPS
    taps = -(-side // _TAPS) * _TAPS
    rows, weights = np.zeros((height, columns + taps), np.float32), np.zeros((side, taps), np.float32)
    for i in range(height):
        for j in range(width):
            rows[i, j] = shown[i, j]
    for i in range(side):
        for j in range(side):
            weights[i, j] = pattern[i, j]
    made = np.zeros((height - side + 1, columns), np.float32)
    for i in range(side):
        w = weights[i]
        for t in range(0, taps, _TAPS):
            a, b, c, d, e, f, g, h = w[t], w[t + 1], w[t + 2], w[t + 3], w[t + 4], w[t + 5], w[t + 6], w[t + 7]
            for y in range(made.shape[0]):
                row, own = rows[y + i, t : t + columns + _TAPS], made[y]
                for x in range(columns):
                    own[x] += a * row[x] + b * row[x + 1] + c * row[x + 2] + d * row[x + 3]
                    own[x] += e * row[x + 4] + f * row[x + 5] + g * row[x + 6] + h * row[x + 7]
    return made


@compiled("float32[:, ::1](float32[:, ::1], Array(float32, 2, 'C', readonly=True))")
def _likeness(shown: Image, values: Image) -> Image:
    """Normalised correlation of a patch (n, n) with what is shown (h, w) wherever it fits in: `cv2.matchTemplate`."""
    side, width = values.shape[0], shown.shape[1]
    area = side * side
    mean, power = 0.0, 0.0
    for i in range(side):
        for j in range(side):
            mean += values[i, j] / area
    pattern = np.empty((side, side), np.float32)
    for i in range(side):
        for j in range(side):
            pattern[i, j] = values[i, j] - mean
            power += pattern[i, j] * pattern[i, j]
    products = _products(shown, pattern)
    made = np.empty((shown.shape[0] - side + 1, width - side + 1), np.float32)
    # Sums and squares of the rows under the patch, which moves down, and of its columns of those.
    sums, squares = np.zeros(width), np.zeros(width)
    for y in range(-side + 1, made.shape[0]):
        for j in range(width):
            entering = shown[y + side - 1, j]
            sums[j] += entering
            squares[j] += entering * entering
        if y < 0:
            continue
        total, total_square = 0.0, 0.0
        for j in range(width):
            total += sums[j]
            total_square += squares[j]
            x = j - side + 1
            if x < 0:
                continue
            spread = total_square - total * total / area
            # What is the same all over but for the rounding is like nothing.
            is_even = spread <= 1.2e-6 * total_square
            likeness = 0.0 if is_even else products[y, x] / math.sqrt(spread * power)
            made[y, x] = min(max(likeness, -1.0), 1.0)
            total -= sums[x]
            total_square -= squares[x]
        for j in range(width):
            leaving = shown[y, j]
            sums[j] -= leaving
            squares[j] -= leaving * leaving
    return made


_FOUND = (
    "UniTuple(float64, 3)(Array({}, 2, 'C', readonly=True), Array(float32, 2, 'C', readonly=True), float32, boolean,"
    " int64, UniTuple(int64, 4), Array(float32, 1, 'C', readonly=True), Array(float32, 1, 'C', readonly=True),"
    " Array(float32, 1, 'C', readonly=True))"
)


@compiled(*_of_either(_FOUND))
def found(
    pixels: Pixels,
    values: Image,
    lowest: float,
    bright: bool,
    cell: int,
    part: tuple[int, int, int, int],
    fine: Image,
    coarse: Image,
    known: Image,
) -> tuple[float, float, float]:
    """Where a part of an image is most like a patch: `companion_patches._found`.

    Args:
        pixels: (H, W) the image.
        values: (n, n) the patch.
        lowest: below which what is shown is cut off.
        bright: whether devices are brighter than what is behind them.
        cell: pixels on a side of a cell.
        part: where the patch is looked for, cells (left, top, right, bottom).
        fine: taps of the narrower blur, from the middle one on.
        coarse: of the wider one, at least as many.
        known: `working_image.grey_logarithms`.

    Returns:
        The cell x, y of the patch's first there, to a fraction; and the correlation.
    """
    left, top, right, bottom = part
    reach = coarse.size - 1
    outer_left, outer_top = max(left - reach, 0), max(top - reach, 0)
    outer_right, outer_bottom = (
        min(right + reach, pixels.shape[1] // cell),
        min(bottom + reach, pixels.shape[0] // cell),
    )
    logarithm = _logarithms(pixels, cell, outer_left, outer_top, outer_right, outer_bottom, known)
    fast, slow = _blurred(logarithm, fine), _blurred(logarithm, coarse)
    shown, sign = np.empty((bottom - top, right - left), np.float32), np.float32(1.0 if bright else -1.0)
    for i in range(bottom - top):
        a, b = fast[i + top - outer_top, left - outer_left :], slow[i + top - outer_top, left - outer_left :]
        for j in range(right - left):
            shown[i, j] = max(sign * (a[j] - b[j]), lowest)
    likeness = _likeness(shown, values)
    height, width = likeness.shape
    y, x = 0, 0
    for i in range(height):
        for j in range(width):
            if likeness[i, j] > likeness[y, x]:
                y, x = i, j
    column, row, best = float(left + x), float(top + y), likeness[y, x]
    if 0 < x < width - 1:
        column += vertex(likeness[y, x - 1], best, likeness[y, x + 1])
    if 0 < y < height - 1:
        row += vertex(likeness[y - 1, x], best, likeness[y + 1, x])
    return column, row, float(best)
