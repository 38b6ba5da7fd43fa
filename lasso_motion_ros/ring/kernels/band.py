"""What the working image does between its filters, compiled: see `core/compiled.py`.

Each goes once through the image where numpy and OpenCV go five times. What varies slowly comes in cells of two by two
pixels, and is interpolated between their centres.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Image = npt.NDArray[np.float32]

_QUARTER, _MOST = np.float32(0.25), np.float32(0.75)
MEAN_CELLS = 31  # over which `local_mean` goes, along rows and columns
WINDOW_PX = 33  # in which `evidence` tells the noise


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


@compiled("float32[:, ::1](float32[:, ::1], float32[:, ::1], boolean)")
def subtracted(fine: Image, slow: Image, bright: bool) -> Image:
    """Take what varies slowly from an image, and tell the power of what is left.

    Args:
        fine: (2 h, 2 w) blurred a little; overwritten by the band between the two.
        slow: (h, w) cells, blurred much.
        bright: whether what is brighter is positive.

    Returns:
        (h, w) mean square of the band in each cell.
    """
    height, width = slow.shape
    cells, coarse = np.empty(width + 2, np.float32), np.empty(2 * width, np.float32)
    power = np.empty((height, width), np.float32)
    sign = np.float32(1.0 if bright else -1.0)
    for i in range(2 * height):
        _between_cells(slow, i, cells, coarse)
        row = fine[i]
        for j in range(2 * width):
            row[j] = sign * (row[j] - coarse[j])
        if i % 2:
            above, below, mean = fine[i - 1], row, power[i // 2]
            for c in range(width):
                mean[c] = _QUARTER * (
                    above[2 * c] * above[2 * c]
                    + above[2 * c + 1] * above[2 * c + 1]
                    + below[2 * c] * below[2 * c]
                    + below[2 * c + 1] * below[2 * c + 1]
                )
    return power


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
def evidence(fine: Image, slow: Image, bright: bool, floor: float, lowest: float, highest: float) -> Image:
    """What is as wide as an electrode, relative to its local noise: `working_image._evidence`.

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
