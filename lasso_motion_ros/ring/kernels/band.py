"""What the working image does between its filters, compiled: see `core/compiled.py`.

Each goes once through the image where numpy and OpenCV go five times. What varies slowly comes in cells of two by two
pixels, and is interpolated between their centres.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled
from lasso_motion_ros.ring.kernels.blur import BY_REACH

Image = npt.NDArray[np.float32]
Array = npt.NDArray[np.float64]
Grey = npt.NDArray[np.uint16]

_ONE, _QUARTER, _MOST = np.float32(1.0), np.float32(0.25), np.float32(0.75)
MEAN_CELLS = 31  # over which `local_mean` goes, along rows and columns
WINDOW_PX = 33  # in which `evidence` tells the noise
_REACH = 2  # of the band's blur of pixels, on either side
# Blurs of cells, of the band, and of evidence's pixels and cells.
_COARSE_BAND, _FINE, _COARSE = BY_REACH[4], BY_REACH[5], BY_REACH[8]
_FAR = 1e9  # pixels: what lies further off is outside as well
_TAPS = "Array(float32, 1, 'C', readonly=True)"
_EVIDENCE = f"{_TAPS}, {_TAPS}, {_TAPS}, boolean, float32, float32, float32"


@compiled("float32[:, ::1](float32[:, ::1])", is_exact=True)
def _in_cells(values: Image) -> Image:
    """Means (h // 2, w // 2) of values (h, w): `working_image.in_cells`, to the last bit."""
    cells = np.empty((values.shape[0] // 2, values.shape[1] // 2), np.float32)
    for i in range(cells.shape[0]):
        above, below, own = values[2 * i], values[2 * i + 1], cells[i]
        for j in range(cells.shape[1]):
            own[j] = _QUARTER * ((above[2 * j] + above[2 * j + 1]) + (below[2 * j] + below[2 * j + 1]))
    return cells


@compiled("void(float32[:, ::1], int64, float32[::1], float32[::1])")
def _between_cells(cells: Image, row: int, column_of_cells: Image, result: Image) -> None:
    """One row of cells (h, w), interpolated to (2 w,) pixels, as `cv2.resize` does.

    Args:
        cells: (h, w).
        row: of the pixels.
        column_of_cells: (w + 2,) overwritten.
        result: (2 w,) written.
    """
    height, width = cells.shape
    cell = row // 2
    other = min(cell + 1, height - 1) if row % 2 else max(cell - 1, 0)
    near, far = cells[cell], cells[other]
    inner = column_of_cells[1:]
    for c in range(width):
        inner[c] = _MOST * near[c] + _QUARTER * far[c]
    column_of_cells[0], column_of_cells[width + 1] = column_of_cells[1], column_of_cells[width]
    for c in range(width):
        result[2 * c] = _QUARTER * column_of_cells[c] + _MOST * column_of_cells[c + 1]
        result[2 * c + 1] = _MOST * column_of_cells[c + 1] + _QUARTER * column_of_cells[c + 2]


@compiled("float32[:, ::1](float32[:, ::1])")
def local_mean(cells: Image) -> Image:
    """Means (h, w) of the `MEAN_CELLS` by `MEAN_CELLS` cells (h, w) about each, as `cv2.blur`; h and w are larger.

    Beyond the border rows and columns come again from the other side.
    """
    height, width = cells.shape
    half = MEAN_CELLS // 2
    columns, made, share = np.zeros(width), np.empty_like(cells), np.float32(1.0 / MEAN_CELLS**2)
    for k in range(-half, half + 1):
        row = k if k >= 0 else -k - 1
        for j in range(width):
            columns[j] += cells[row, j]
    beyond = width + 2 * half
    # Over 1, 2, 4, 8 and 16 columns from each on: sums by doubling, of all columns at once.
    # (As in `evidence`: in a function of its own the arrays might overlap, no vectors are made, and both take 1.5 times
    # as long.)
    one, two, four = np.zeros(beyond, np.float32), np.zeros(beyond, np.float32), np.zeros(beyond, np.float32)
    eight, sixteen = np.zeros(beyond, np.float32), np.zeros(beyond, np.float32)
    for i in range(height):
        for j in range(width):
            one[half + j] = columns[j]
        for j in range(half):
            one[half - 1 - j], one[half + width + j] = columns[j], columns[width - 1 - j]
        for j in range(beyond - 1):
            two[j] = one[j] + one[j + 1]
        for j in range(beyond - 3):
            four[j] = two[j] + two[j + 2]
        for j in range(beyond - 7):
            eight[j] = four[j] + four[j + 4]
        for j in range(beyond - 15):
            sixteen[j] = eight[j] + eight[j + 8]
        for j in range(width):
            made[i, j] = share * (sixteen[j] + eight[j + 16] + four[j + 24] + two[j + 28] + one[j + 30])
        if i + 1 < height:
            after, first = i + half + 1, i - half
            after, first = after if after < height else 2 * height - 1 - after, first if first >= 0 else -first - 1
            for j in range(width):
                columns[j] += cells[after, j] - cells[first, j]
    return made


@compiled("void(Array(uint16, 1, 'C', readonly=True), Array(uint16, 1, 'C', readonly=True), uint16[::1])")
def _halve_rows(above: Grey, below: Grey, halved: Grey) -> None:
    """Two rows (2 w,) to the rounded means (w,) of two by two."""
    for j in range(halved.size):
        upper = np.uint32(above[2 * j]) + np.uint32(above[2 * j + 1])
        lower = np.uint32(below[2 * j]) + np.uint32(below[2 * j + 1])
        halved[j] = (upper + lower + np.uint32(2)) >> np.uint32(2)


@compiled("uint16[:, ::1](Array(uint16, 2, 'C', readonly=True), int64, int64, int64, int64)")
def halved(pixels: Grey, left: int, top: int, width: int, height: int) -> Grey:
    """A part of an image, reduced to half: what `cv2.resize` gives of it (INTER_AREA), to the last bit.

    Of an image that comes from far memory in three fifths of the time: row by row, each read once, from left to right.

    Args:
        pixels: (H, W).
        left: first column of the part.
        top: its first row.
        width: columns of the result.
        height: its rows.
    """
    made = np.empty((height, width), np.uint16)
    for i in range(height):
        row = top + 2 * i
        _halve_rows(pixels[row, left : left + 2 * width], pixels[row + 1, left : left + 2 * width], made[i])
    return made


@compiled("Tuple((float32[:, ::1], float64))(Array(uint16, 2, 'C', readonly=True))")
def _grey_in_cells(grey: Grey) -> tuple[Image, float]:
    """What `_in_cells` gives of grey values (h, w), which add up exactly; and the largest of them, 1 at least."""
    height, width = grey.shape[0] // 2, grey.shape[1] // 2
    cells, most = np.empty((height, width), np.float32), np.uint16(1)
    for i in range(height):
        above, below, own = grey[2 * i], grey[2 * i + 1], cells[i]
        for j in range(2 * width):
            most = max(most, above[j], below[j])
        for j in range(width):
            upper = np.int32(above[2 * j]) + np.int32(above[2 * j + 1])
            lower = np.int32(below[2 * j]) + np.int32(below[2 * j + 1])
            own[j] = _QUARTER * np.float32(upper + lower)
    return cells, float(most)


@compiled(f"UniTuple(float32[:, ::1], 2)(Array(uint16, 2, 'C', readonly=True), {_TAPS}, float32[:, ::1], boolean)")
def _banded(grey: Grey, taps: Image, slow: Image, bright: bool) -> tuple[Image, Image]:
    """What is left of an image once it is blurred a little and what varies slowly is taken off, and the power of that.

    Row by row, so that what one step leaves is in the nearest memory for the next: as a blur of `BY_REACH` and then a
    subtraction, to the last bit.

    Args:
        grey: (2 h, 2 w), larger than the blur's reach.
        taps: of the blur, from the middle one on.
        slow: (h, w) cells, blurred much.
        bright: whether what is brighter is positive.

    Returns:
        (2 h, 2 w) the band; (h, w) its mean square in each cell.
    """
    (height, width), half = grey.shape, slow.shape[1]
    band, power = np.empty((height, width), np.float32), np.empty(slow.shape, np.float32)
    rows, line = np.empty((2 * _REACH + 1, width), np.float32), np.empty(width + 2 * _REACH, np.float32)
    cells, coarse = np.empty(half + 2, np.float32), np.empty(width, np.float32)
    sign = np.float32(1.0 if bright else -1.0)
    for last in range(-_REACH, height + _REACH):
        # The rows about the next one that is blurred, mirrored in those at the border.
        mirrored, slot = height - 1 - abs(height - 1 - abs(last)), last % (2 * _REACH + 1)
        for j in range(width):
            rows[slot, j] = grey[mirrored, j]
        i = last - _REACH
        if i < 0:
            continue
        for j in range(width):
            total = taps[0] * rows[i % (2 * _REACH + 1), j]
            for k in range(1, _REACH + 1):
                total += taps[k] * (rows[(i - k) % (2 * _REACH + 1), j] + rows[(i + k) % (2 * _REACH + 1), j])
            line[j + _REACH] = total
        for k in range(1, _REACH + 1):
            line[_REACH - k], line[_REACH + width - 1 + k] = line[_REACH + k], line[_REACH + width - 1 - k]
        _between_cells(slow, i, cells, coarse)
        own = band[i]
        for j in range(width):
            total = taps[0] * line[j + _REACH]
            for k in range(1, _REACH + 1):
                total += taps[k] * (line[j + _REACH - k] + line[j + _REACH + k])
            own[j] = total
        for j in range(width):
            own[j] = sign * (own[j] - coarse[j])
        if i % 2:
            above, mean = band[i - 1], power[i // 2]
            for c in range(half):
                mean[c] = _QUARTER * (
                    above[2 * c] * above[2 * c]
                    + above[2 * c + 1] * above[2 * c + 1]
                    + own[2 * c] * own[2 * c]
                    + own[2 * c + 1] * own[2 * c + 1]
                )
    return band, power


@compiled("float32[:, ::1](float32[:, ::1], float32[:, ::1], float32, float32)")
def divided(band: Image, power: Image, floor: float, clip: float) -> Image:
    """Divide a band by its local root mean square, and clip it.

    Args:
        band: (2 h, 2 w) overwritten by the quotient.
        power: (h, w) mean square about each cell.
        floor: of it.
        clip: of the quotient, either way.

    Returns:
        (2 h, 2 w) the root mean square.
    """
    height, width = power.shape
    noise, root, cells = np.empty_like(band), np.empty((height, width), np.float32), np.empty(width + 2, np.float32)
    for i in range(height):
        values, roots = power[i], root[i]
        for c in range(width):
            roots[c] = np.sqrt(values[c] if values[c] > floor else floor)
    for i in range(2 * height):
        row, own = band[i], noise[i]
        _between_cells(root, i, cells, own)
        for j in range(2 * width):
            row[j] = min(max(row[j] / own[j], -clip), clip)
    return noise


@compiled("float32[:, ::1](float32[:, ::1], float32[:, ::1], boolean, float32, float32, float32)")
def _relative(fine: Image, slow: Image, bright: bool, floor: float, lowest: float, highest: float) -> Image:
    """What is as wide as an electrode, relative to its local noise.

    Args:
        fine: (2 h, 2 w) logarithm of the grey values, blurred a little; overwritten.
        slow: (h, w) cells of it, blurred much.
        bright: whether what is brighter is positive.
        floor: of the mean square in the window about a pixel, `WINDOW_PX` a side; the image is larger than half of it.
        lowest: of the evidence.
        highest: likewise.

    Returns:
        (2 h, 2 w).
    """
    height, width = fine.shape
    cells, coarse = np.empty(slow.shape[1] + 2, np.float32), np.empty(width, np.float32)
    sign = np.float32(1.0 if bright else -1.0)
    for i in range(height):
        _between_cells(slow, i, cells, coarse)
        for j in range(width):
            fine[i, j] = sign * (fine[i, j] - coarse[j])
    # Squares summed up over the window's rows. Beyond the border rows and columns come again from the other side.
    half = WINDOW_PX // 2
    columns = np.zeros(width)
    for k in range(-half, half + 1):
        row = k if k >= 0 else -k - 1
        for j in range(width):
            columns[j] += fine[row, j] * fine[row, j]
    beyond = width + 2 * half
    # Over 1, 2, 4, 8 and 16 columns from each on: sums by doubling, of all columns at once.
    one, two, four = np.zeros(beyond, np.float32), np.zeros(beyond, np.float32), np.zeros(beyond, np.float32)
    eight, sixteen = np.zeros(beyond, np.float32), np.zeros(beyond, np.float32)
    made, share = np.empty_like(fine), np.float32(1.0 / WINDOW_PX**2)
    for i in range(height):
        for j in range(width):
            one[half + j] = columns[j]
        for j in range(half):
            one[half - 1 - j], one[half + width + j] = columns[j], columns[width - 1 - j]
        for j in range(beyond - 1):
            two[j] = one[j] + one[j + 1]
        for j in range(beyond - 3):
            four[j] = two[j] + two[j + 2]
        for j in range(beyond - 7):
            eight[j] = four[j] + four[j + 4]
        for j in range(beyond - 15):
            sixteen[j] = eight[j] + eight[j + 8]
        for j in range(width):
            noise = np.sqrt(max(share * (sixteen[j] + sixteen[j + 16] + one[j + 32]), floor))
            made[i, j] = min(max(fine[i, j] / noise, lowest), highest)
        if i + 1 < height:
            after, first = i + half + 1, i - half
            after, first = after if after < height else 2 * height - 1 - after, first if first >= 0 else -first - 1
            for j in range(width):
                columns[j] += fine[after, j] * fine[after, j] - fine[first, j] * fine[first, j]
    return made


@compiled(f"UniTuple(float32[:, ::1], 2)(Array(uint16, 2, 'C', readonly=True), {_TAPS}, {_TAPS}, boolean, float32)")
def band_passed(grey: Grey, fine: Image, coarse: Image, bright: bool, clip: float) -> tuple[Image, Image]:
    """What is as fine as a catheter, relative to the local noise, and that noise: `working_image._band_pass`.

    Args:
        grey: (2 h, 2 w), h and w larger than `MEAN_CELLS`.
        fine: taps of the blur of pixels, from the middle one on.
        coarse: of cells.
        bright: whether what is brighter is positive.
        clip: of the result, either way.

    Returns:
        (2 h, 2 w) each.
    """
    cells, most = _grey_in_cells(grey)
    band, power = _banded(grey, fine, _COARSE_BAND(cells, coarse), bright)
    # A constant area (collimator, saturation) has no noise to divide by and stays zero.
    return band, divided(band, local_mean(power), 1e-6 * most, clip)


@compiled(f"float32[:, ::1](Array(uint16, 2, 'A', readonly=True), {_EVIDENCE})")
def evidence(
    grey: Grey,
    logarithms: Image,
    fine: Image,
    coarse: Image,
    bright: bool,
    floor: float,
    lowest: float,
    highest: float,
) -> Image:
    """What is as wide as an electrode, relative to its local noise: `working_image._evidence`.

    Args:
        grey: (h, w), both larger than half of `WINDOW_PX`.
        logarithms: of each grey value.
        fine: taps of the blur of pixels, from the middle one on.
        coarse: of cells.
        bright: whether what is brighter is positive.
        floor: of the mean square in the window about a pixel.
        lowest: of the evidence.
        highest: likewise.

    Returns:
        (h, w).
    """
    height, width = grey.shape
    logarithm = np.empty((height, width), np.float32)
    for i in range(height):
        for j in range(width):
            logarithm[i, j] = logarithms[grey[i, j]]
    return _relative(_FINE(logarithm, fine), _COARSE(_in_cells(logarithm), coarse), bright, floor, lowest, highest)


@compiled("float32(float32[:, ::1], int64, int64)")
def _inside(values: Image, row: int, column: int) -> np.float32:
    """A value of an image (h, w), and zero outside it."""
    height, width = values.shape
    is_inside = 0 <= row < height and 0 <= column < width
    return np.float32(values[row, column] if is_inside else 0.0)


@compiled(
    "float32[::1](Array(uint16, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True), int64, int64,"
    f" {_EVIDENCE})"
)
def evidence_at(
    grey: Grey,
    pixels: Array,
    cell: int,
    reach: int,
    logarithms: Image,
    fine: Image,
    coarse: Image,
    bright: bool,
    floor: float,
    lowest: float,
    highest: float,
) -> Image:
    """(N,) the same at pixels (N, 2), finite, of an image (H, W): `WorkingImage.evidence_at`.

    Args:
        grey: (H, W).
        pixels: (N, 2) x, y.
        cell: pixels on a side of a cell, of which the surroundings are whole ones.
        reach: of the surroundings of the pixels, pixels.
        logarithms: as for `evidence`, and so on.
        fine: likewise.
        coarse: likewise.
        bright: likewise.
        floor: likewise.
        lowest: likewise.
        highest: likewise.

    Returns:
        None of them, (0,), where the surroundings are too small for it.
    """
    first_x = first_y = _FAR
    last_x = last_y = -_FAR
    for n in range(pixels.shape[0]):
        x, y = min(max(pixels[n, 0], -_FAR), _FAR), min(max(pixels[n, 1], -_FAR), _FAR)
        first_x, last_x, first_y, last_y = min(first_x, x), max(last_x, x), min(first_y, y), max(last_y, y)
    left = max(0, math.floor((first_x - reach) / cell) * cell)
    top = max(0, math.floor((first_y - reach) / cell) * cell)
    right = min(grey.shape[1], math.ceil((last_x + reach + 1) / cell) * cell)
    bottom = min(grey.shape[0], math.ceil((last_y + reach + 1) / cell) * cell)
    if min(right - left, bottom - top) <= WINDOW_PX // 2:
        return np.empty(0, np.float32)
    values = evidence(grey[top:bottom, left:right], logarithms, fine, coarse, bright, floor, lowest, highest)
    made = np.empty(pixels.shape[0], np.float32)
    for n in range(made.size):
        x = np.float32(min(max(pixels[n, 0], -_FAR), _FAR) - left)
        y = np.float32(min(max(pixels[n, 1], -_FAR), _FAR) - top)
        column, row = math.floor(x), math.floor(y)
        right_share, lower_share = x - np.float32(column), y - np.float32(row)
        upper = _inside(values, row, column) * (_ONE - right_share) + _inside(values, row, column + 1) * right_share
        lower = _inside(values, row + 1, column) * (_ONE - right_share)
        lower += _inside(values, row + 1, column + 1) * right_share
        made[n] = upper * (_ONE - lower_share) + lower * lower_share
    return made


@compiled(
    "float64(Array(float32, 2, 'A', readonly=True), Array(uint16, 2, 'A', readonly=True), float64, float64, int64)"
)
def contrast_unit(noise: Image, grey: Grey, x: float, y: float, half: int) -> float:
    """The noise at a pixel as a share of the grey about it: `WorkingImage.contrast_unit`.

    Args:
        noise: (h, w) of an image.
        grey: (h, w) of it.
        x: of the pixel, or beside the image.
        y: likewise.
        half: how far about it the grey counts, pixels.
    """
    height, width = noise.shape
    column, row = min(max(round(x), 0), width - 1), min(max(round(y), 0), height - 1)
    top, bottom = max(row - half, 0), min(row + half + 1, height)
    left, right = max(column - half, 0), min(column + half + 1, width)
    total = 0
    for i in range(top, bottom):
        for j in range(left, right):
            total += grey[i, j]
    share: float = noise[row, column] / max(total / ((bottom - top) * (right - left)), 1.0)
    return share
