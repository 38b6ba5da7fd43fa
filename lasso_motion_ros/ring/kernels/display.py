"""The sums over blocks of `temporal_filter`, compiled: see `core/compiled.py`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.float32]
Pixels = npt.NDArray[np.uint8 | np.uint16]


@compiled(
    "Tuple((float32[:, ::1], float32[::1]))(Array(uint8, 2, 'C', readonly=True), int64, int64)",
    "Tuple((float32[:, ::1], float32[::1]))(Array(uint16, 2, 'C', readonly=True), int64, int64)",
)
def sampled(pixels: Pixels, size: int, most: int) -> tuple[Image, Image]:
    """Blocks from all over an image, side by side, and their means: `temporal_filter.sampled`.

    Args:
        pixels: (H, W).
        size: of a block, pixels.
        most: blocks a side.
    """
    height, width = pixels.shape
    down, right = max(1, height // size // most), max(1, width // size // most)
    rows, columns = height // (size * down), width // (size * right)
    values, grey = np.empty((rows * size, columns * size), np.float32), np.empty(rows * columns, np.float32)
    for r in range(rows):
        for c in range(columns):
            top, left = (r * down + down // 2) * size, (c * right + right // 2) * size
            total = 0
            for i in range(size):
                row = pixels[top + i, left : left + size]
                own = values[r * size + i, c * size : (c + 1) * size]
                for j in range(size):
                    own[j] = row[j]
                    total += row[j]
            grey[r * columns + c] = total / (size * size)
    return values, grey


@compiled("void(float32[:, ::1], float32[:, ::1], float32[::1], float32[::1])")
def _mean_of_products(one: Image, other: Image, columns_sum: Image, means: Image) -> None:
    """(m,) means of the products of a row of blocks (size, m · size) each."""
    size = one.shape[0]
    columns_sum[:] = 0.0
    for i in range(size):
        first, second = one[i], other[i]
        for j in range(columns_sum.size):
            columns_sum[j] += first[j] * second[j]
    for k in range(means.size):
        total = np.float32(0.0)
        for j in range(k * size, (k + 1) * size):
            total += columns_sum[j]
        means[k] = total / np.float32(size * size)


@compiled("Tuple((float32[:, ::1], float32[::1], float32[::1]))(float32[:, ::1], float32[:, ::1], int64)")
def difference(values: Image, before: Image, size: int) -> tuple[Image, Image, Image]:
    """The difference of two samples, what is fine and what is smooth in it apart: `temporal_filter.difference`.

    Args:
        values: (n · size, m · size).
        before: likewise.
        size: of a block, pixels; a multiple of four.

    Returns:
        As `temporal_filter.Difference`.
    """
    height, width = values.shape
    rows, columns, cell = height // size, width // size, size // 4
    fine, ninth = np.zeros((height, width), np.float32), np.float32(1.0 / 9.0)
    energy, moved = np.empty((rows, columns), np.float32), np.zeros((rows, columns), np.float32)
    # Of a row of blocks at a time, which stays near the processor. Blocks' edges say nothing fine.
    change, beside = np.empty((size, width), np.float32), np.zeros((size, width), np.float32)
    inside, columns_sum = np.ones(width, np.float32), np.empty(width, np.float32)
    inside[::size] = 0.0
    inside[size - 1 :: size] = 0.0
    for r in range(rows):
        for i in range(size):
            now, then, own, sums = values[r * size + i], before[r * size + i], change[i], beside[i]
            for j in range(width):
                own[j] = now[j] - then[j]
            for j in range(1, width - 1):
                sums[j] = own[j - 1] + own[j] + own[j + 1]
        columns_sum[:] = 0.0
        for i in range(1, size - 1):
            above, here, below, own, made = beside[i - 1], beside[i], beside[i + 1], change[i], fine[r * size + i]
            for j in range(width):
                made[j] = inside[j] * (own[j] - ninth * (above[j] + here[j] + below[j]))
            for j in range(width):
                columns_sum[j] += made[j] * made[j]
        for k in range(columns):
            total = np.float32(0.0)
            for j in range(k * size, (k + 1) * size):
                total += columns_sum[j]
            energy[r, k] = total / np.float32(size * size)
        for part in range(4):
            columns_sum[:] = 0.0
            for i in range(part * cell, (part + 1) * cell):
                row = change[i]
                for j in range(width):
                    columns_sum[j] += row[j]
            for k in range(columns * 4):
                total = np.float32(0.0)
                for j in range(k * cell, (k + 1) * cell):
                    total += columns_sum[j]
                mean = total / np.float32(cell * cell)
                moved[r, k // 4] += mean * mean / np.float32(16.0)
    return fine, energy.reshape(-1), moved.reshape(-1)


@compiled("float32[::1](float32[:, ::1], float32[:, ::1], int64)")
def products(one: Image, other: Image, size: int) -> Image:
    """(n · m,) means of the products of two images (n · size, m · size), block by block."""
    height, width = one.shape
    means, columns_sum = np.empty((height // size, width // size), np.float32), np.empty(width, np.float32)
    for r in range(height // size):
        block = slice(r * size, (r + 1) * size)
        _mean_of_products(one[block], other[block], columns_sum, means[r])
    return means.reshape(-1)


@compiled("int64[::1](float32[::1])")
def _order(values: Image) -> npt.NDArray[np.int64]:
    """(N,) which of few values is the least, the second, and so on; compiled in a tenth of numpy's sorting's time."""
    order = np.empty(values.size, np.int64)
    for n in range(values.size):
        place = n
        while place > 0 and values[order[place - 1]] > values[n]:
            order[place] = order[place - 1]
            place -= 1
        order[place] = n
    return order


@compiled("float32(float32[::1], float32[::1])", is_exact=True)
def grey_change(now: Image, then: Image) -> np.float32:
    """Relative change of blocks' grey (n,), of the median block: `temporal_filter.grey_change`."""
    change, one = np.empty_like(now), np.float32(1.0)
    for k in range(now.size):
        change[k] = (now[k] - then[k]) / max(now[k], then[k], one)
    middle: np.float32 = change[_order(change)[now.size // 2]]
    return middle


@compiled(
    "float64[:, ::1](float32[:, ::1], float32[:, ::1], float32[:, ::1], float32[:, ::1], int64, float32, float32,"
    " float64, int64, float32, int64)"
)
def group_sums(
    fine: Image,
    before: Image,
    energies: Image,
    moved: Image,
    size: int,
    rounding: float,
    smallest: float,
    share: float,
    fewest: int,
    outlier: float,
    groups: int,
) -> Array:
    """C, E1 and E0 over groups of the blocks in which least moves: `temporal_filter.group_sums`.

    Args:
        fine: (n · size, m · size) of d1.
        before: likewise of d0.
        energies: (2, n · m) of both.
        moved: (2, n · m) of both.
        size: of a block, pixels.
        rounding: what rounding takes from each product.
        smallest: energy of a block that is used.
        share: of such blocks.
        fewest: blocks.
        outlier: median absolute deviations.
        groups: of blocks.

    Returns:
        (3, groups); (3, 0) for too few blocks.
    """
    product, blocks = products(fine, before, size), energies.shape[1]
    noisy, still = np.empty(blocks, np.int64), np.full(blocks, np.float32(np.inf))
    one, two = energies[0] - np.float32(2.0) * rounding, energies[1] - np.float32(2.0) * rounding
    used = 0
    for k in range(blocks):
        if min(one[k], two[k]) > smallest:
            noisy[used], still[used] = k, moved[0, k] + moved[1, k]
            used += 1
    count = int(share * used)
    if count < fewest:
        return np.empty((3, 0))
    order, correlation, off = _order(still[:used]), np.empty(count, np.float32), np.empty(count, np.float32)
    is_used = np.zeros(blocks, np.bool_)
    for n in range(count):
        k = noisy[order[n]]
        correlation[n] = np.float32(2.0) * (product[k] + rounding) / (one[k] + two[k])
    middle = correlation[_order(correlation)[count // 2]]
    for n in range(count):
        off[n] = abs(correlation[n] - middle)
    limit = outlier * max(off[_order(off)[count // 2]], np.float32(1e-3))
    for n in range(count):
        is_used[noisy[order[n]]] = off[n] <= limit
    sums, group = np.zeros((3, groups)), 0
    for k in range(blocks):
        if is_used[k]:
            sums[0, group] += product[k] + rounding
            sums[1, group] += one[k]
            sums[2, group] += two[k]
            group = (group + 1) % groups
    return sums


@compiled("float64(float64, float64, float64)")
def _filter_from(product: float, energy_1: float, energy_0: float) -> float:
    root = math.sqrt(max(product * product - energy_0 * (energy_1 - energy_0), 0.0))
    return 1.0 - (root - product) / energy_0


@compiled("UniTuple(float64, 2)(Array(float64, 2, 'A', readonly=True))")
def filter_of(sums: Array) -> tuple[float, float]:
    """λ of C, E1, E0 (3, G), summed over groups of blocks, and its standard deviation: `temporal_filter.filter_of`."""
    count = sums.shape[1]
    c, e1, e0 = sums[0].sum(), sums[1].sum(), sums[2].sum()
    without = np.empty(count)
    for k in range(count):
        without[k] = _filter_from(c - sums[0, k], e1 - sums[1, k], e0 - sums[2, k])
    mean, spread = without.sum() / count, 0.0
    for k in range(count):
        spread += (without[k] - mean) ** 2
    return _filter_from(c, e1, e0), math.sqrt((count - 1) / count * spread)
