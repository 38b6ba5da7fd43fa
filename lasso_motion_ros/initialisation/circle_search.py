"""The best of all circles that a ring can be, everywhere that both planes look, in steps of a millimetre and a half.

A circle's projection is the same curve wherever it lies, nearly: the planes are some ten times farther away than it
may be moved. So one plane's responses along circles of one shape (tilt and radius), whichever place they have in its
image, are one sum of shifted images. Both planes show a circle at one height. So of each row of both, at one shape,
the best place is the best in each plane, and all places in space are tried.

A straight line, a rib or a lead has as much along it as a wire; a catheter's ring has nothing beside it. So what
circles show that are a little smaller and larger counts against it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.directions import half_sphere
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.initialisation.circles import POINTS, Circles, Indices, highest, laid
from lasso_motion_ros.initialisation.direction_maps import DirectionMaps, nearest_direction
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid, largest_lift_m
from lasso_motion_ros.initialisation.laid_image import CELL_MM

Array = npt.NDArray[np.float64]
Coarse = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class _Tuning:
    """How finely shapes and places are tried."""

    fine_cells: int = 3  # of the maps, that make one
    normals: int = 160  # over half a sphere: 0.2 rad apart, a cell at the end of a radius
    radii_mm: tuple[float, ...] = (5.2, 6.8, 8.4, 10.2, 12.2, 14.4, 16.8)  # the outermost are beside others only
    levels: int = 7  # of a response: with 36 points the sum is a byte
    widened_cells: int = 5  # of the maps: a circle between two that are tried is seen in both
    reach_m: float = 0.018  # of a shape
    rows: int = 3_000  # of some shape, in which places are looked for
    kept: int = 200
    same_m: float = 3e-3
    same_cosine: float = 0.9


TUNING = _Tuning()
_CELL_M = 1e-3 * CELL_MM * TUNING.fine_cells  # of a coarse cell
STRONGER_SHARE = 0.3  # of the plane that shows more: a circle is what the weaker one shows of it


def search_circles(
    maps: Mapping[Plane, DirectionMaps], grid: EpipolarGrid, between_s: float, check: Callable[[], None] = lambda: None
) -> Circles:
    """The best circles, distinct, best first.

    Args:
        maps: both planes'.
        grid: on which they are laid out.
        between_s: from plane A's exposure to plane B's.
        check: called again and again; what it raises ends the search.
    """
    shapes = _shapes(grid)
    shown = {plane: _contrasts(maps[plane], shapes, plane, grid, check) for plane in PLANES}
    best = {plane: most for plane, (_, most) in shown.items()}
    steps = round(largest_lift_m(between_s) / _CELL_M)
    rows = [_best_rows(best, step) for step in range(-steps, steps + 1)]
    of_shape, row, step, scores = (np.concatenate(part) for part in zip(*rows, strict=True))
    check()
    order = highest(scores, TUNING.rows)
    of_shape, row, step = of_shape[order], row[order], step[order]
    # In each plane two places of the row: the best may be another thing.
    a, b = _two_peaks(shown["a"][0][of_shape, row]), _two_peaks(shown["b"][0][of_shape, row + step])
    column: dict[Plane, Indices] = {"a": a[0][:, [0, 0, 1, 1]].reshape(-1), "b": b[0][:, [0, 1, 0, 1]].reshape(-1)}
    scores = _together(a[1][:, [0, 0, 1, 1]], b[1][:, [0, 1, 0, 1]]).reshape(-1)
    of_shape, row, step = (np.repeat(one, 4) for one in (of_shape, row, step))
    middle = 0.5 * (_CELL_M - 1e-3 * CELL_MM)
    columns = {plane: np.asarray(maps[plane].left + middle + _CELL_M * column[plane], np.float64) for plane in PLANES}
    centres = grid.places(columns, maps["a"].top + middle + _CELL_M * row)
    # Nearer to the planes' sources a circle looks larger.
    depth = (centres - grid.sources["a"]) @ grid.outward / grid.lever
    inner = shapes[_of_inner(len(shapes))]
    found = Circles(
        centres,
        inner.normals[of_shape],
        inner.radii[of_shape] * depth,
        _CELL_M * step.astype(np.float64),
        scores / (POINTS * TUNING.levels),
    )
    return found.distinct(TUNING.kept, TUNING.same_m, TUNING.same_cosine)


def _shapes(grid: EpipolarGrid) -> Circles:
    """A circle of each tilt and radius in the middle of the grid, radius by radius for each tilt."""
    radii = 1e-3 * np.array(TUNING.radii_mm)
    count = TUNING.normals * len(radii)
    return Circles(
        np.tile(grid.centre, (count, 1)),
        np.repeat(half_sphere(TUNING.normals), len(radii), axis=0),
        np.tile(radii, TUNING.normals),
        np.zeros(count),
        np.zeros(count),
    )


def _of_inner(count: int) -> Indices:
    """Which shapes have a smaller and a larger one beside them."""
    return np.arange(count).reshape(-1, len(TUNING.radii_mm))[:, 1:-1].reshape(-1)


def _contrasts(
    maps: DirectionMaps, shapes: Circles, plane: Plane, grid: EpipolarGrid, check: Callable[[], None]
) -> tuple[Coarse, Coarse]:
    """What a plane shows along each inner shape in all places, less half of what it shows beside it.

    Returns:
        (inner shapes, H, W) that, by the place of a shape's middle, and (inner shapes, H) the most of each row.
    """
    pooled = _pooled(maps)
    columns, rows = laid(shapes, plane, grid)
    directions = nearest_direction(columns, rows)
    reach = int(np.ceil(TUNING.reach_m / _CELL_M))
    count, height, width = pooled.shape
    padded = np.pad(pooled, ((0, 0), (reach, reach), (reach, reach)))
    stride = width + 2 * reach
    # An image in one piece: a shift is an offset in it, and what wraps around comes from the margin.
    flat = padded.reshape(count, -1)
    starts = (np.rint(rows / _CELL_M).astype(np.int64) + reach) * stride
    starts += np.rint(columns / _CELL_M).astype(np.int64) + reach
    radii = len(TUNING.radii_mm)
    if has_kernels():
        from lasso_motion_ros.initialisation import kernels

        shown = np.empty((len(shapes) // radii * (radii - 2), height, width), np.uint8)
        best = np.empty(shown.shape[:2], np.uint8)
        kernels.contrasts(flat, starts, directions, radii, stride, shown, best)
        return shown, best
    sums = _sums(flat, starts, directions, (height - 1) * stride + width, check)
    check()
    on = np.pad(sums, ((0, 0), (0, 2 * reach))).reshape(-1, radii, height, stride)[..., :width].astype(np.int16)
    contrast = on[:, 1:-1] - ((on[:, :-2] + on[:, 2:]) >> 2)
    shown = np.maximum(contrast, 0, out=contrast).astype(np.uint8).reshape(-1, height, width)
    return shown, shown.max(axis=2)


def _pooled(maps: DirectionMaps) -> Coarse:
    """(DIRECTIONS, H, W) the strongest response about each coarse cell's middle."""
    kernel = np.ones((TUNING.widened_cells, TUNING.widened_cells), np.uint8)
    cells = slice(TUNING.fine_cells // 2, None, TUNING.fine_cells)
    wide = np.stack([cv2.dilate(one, kernel)[cells, cells] for one in maps.responses])
    return np.asarray(np.rint(wide * TUNING.levels), np.uint8)


def _sums(flat: Coarse, starts: Indices, directions: Indices, length: int, check: Callable[[], None]) -> Coarse:
    """(shapes, length) sums of the responses along each shape, by the place of its middle.

    Args:
        flat: (DIRECTIONS, L) the responses.
        starts: (shapes, POINTS) where each point begins,
        directions: and in which of them.
        length: of a sum.
        check: called again and again.
    """
    sums = np.zeros((len(starts), length), np.uint8)
    for number, (total, of_shape, which) in enumerate(zip(sums, starts.tolist(), directions.tolist(), strict=True)):
        if number % TUNING.normals == 0:
            check()
        for start, k in zip(of_shape, which, strict=True):
            np.add(total, flat[k, start : start + length], out=total)
    return sums


def _best_rows(best: Mapping[Plane, Coarse], step: int) -> tuple[Indices, Indices, Indices, Array]:
    """Shapes, rows of plane A, steps to those of plane B, and scores of the rows that show most in both planes."""
    height = min(best[plane].shape[1] for plane in PLANES)
    rows = np.arange(max(0, -step), min(height, height - step))
    scores = _together(best["a"][:, rows], best["b"][:, rows + step])
    order = highest(scores.reshape(-1), TUNING.rows)
    shape, row = np.unravel_index(order, scores.shape)
    return shape, rows[row], np.full(len(order), step), scores.reshape(-1)[order]


def _two_peaks(rows: Coarse) -> tuple[Indices, Coarse]:
    """(M, 2) columns and values of the highest in each of some rows (M, W), and of the next that is not beside it."""
    index = np.arange(len(rows))
    first = rows.argmax(axis=1)
    others = rows.copy()
    for aside in range(-2, 3):
        others[index, np.clip(first + aside, 0, rows.shape[1] - 1)] = 0
    second = others.argmax(axis=1)
    return np.stack([first, second], axis=1), np.stack([rows[index, first], others[index, second]], axis=1)


def _together(a: Coarse, b: Coarse) -> Array:
    return np.asarray(np.minimum(a, b) + STRONGER_SHARE * np.maximum(a, b), dtype=np.float64)
