"""Small pieces of a plane's image that hold something plain beside the ring, and where they have gone in a later one.

Electrodes, leads and clips stand out of everything else in the body. What a piece shows is looked for by normalised
correlation, in cells of half a millimetre: that is fine enough for devices of one to three, and cheap.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.frames import Frame
from lasso_motion_ros.ring.search import vertex
from lasso_motion_ros.ring.working_image import CELL_PX, blur_taps, grey_logarithms, reduction_factor

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.float32]

_FINE_CELLS = 5  # of the narrower blur, on a side


@dataclass(frozen=True)
class PatchTuning:
    """What is looked for, and how far."""

    count: int = 4  # in a plane, at most
    half_mm: float = 7.0  # of a patch's side: two pairs of electrodes, and no two alike along a catheter
    reach_mm: float = 70.0  # from the ring's middle
    from_ring_mm: float = 9.0  # at least: what is nearer is the ring's own, or works at it
    apart_mm: float = 8.0
    fine_mm: float = 0.45  # standard deviations of the two Gaussians whose difference shows devices
    coarse_mm: float = 1.35
    brightest: float = 2.0  # times the noise: what is brighter than all around is no device
    plainest: float = 1e-3  # of the plainest patch: the least that a patch must stand out
    search_mm: float = 4.0  # about the places where it may have gone
    widest_mm: float = 16.0  # between the likeliest of those places and another: further off it is not looked for
    same: float = 0.5  # correlation, of the same thing


@dataclass(frozen=True, eq=False)
class CompanionPatch:
    """A piece of a plane's image.

    Attributes:
        home: (2,) the cell of its middle where it was found.
        values: (n, n) float32, what it shows.
        lowest: below which what is shown is cut off, as in `values`.
    """

    home: npt.NDArray[np.int_]
    values: Image
    lowest: float


@dataclass(frozen=True, eq=False)
class CompanionGrid:
    """The cells in which a plane's image is looked at.

    Attributes:
        factor: full pixels on a side of a working pixel; a cell has twice as many.
        cell_mm: size of a cell at the ring's depth.
        bright: whether devices are brighter than what is behind them.
    """

    factor: int
    cell_mm: float
    bright: bool

    @staticmethod
    def of(frame: Frame, centre: Array, *, bright: bool) -> CompanionGrid:
        """The grid for a ring about a world point (3,) m."""
        factor = reduction_factor(frame.projection, centre)
        return CompanionGrid(factor, CELL_PX * factor * frame.projection.millimetres_per_pixel(centre), bright)

    @property
    def cell_px(self) -> int:
        """Full pixels on a side of a cell."""
        return CELL_PX * self.factor

    def shape(self, frame: Frame) -> tuple[int, int]:
        """Rows and columns of whole cells."""
        height, width = frame.pixels.shape
        return height // self.cell_px, width // self.cell_px


def find_patches(frame: Frame, grid: CompanionGrid, ring: Array, tuning: PatchTuning) -> list[CompanionPatch]:
    """The plainest pieces of an image about the ring, not of it.

    Args:
        frame: the image.
        grid: its cells.
        ring: (N, 2) pixels along the ring's curve.
        tuning: what is looked for.
    """
    half = round(tuning.half_mm / grid.cell_mm)
    rows, columns = grid.shape(frame)
    if tuning.count == 0 or min(rows, columns) <= 2 * half + 2:
        return []
    shown = _devices(frame, grid, tuning, (0, 0, columns, rows))
    lowest = -tuning.brightest * 1.4826 * float(np.median(np.abs(shown)))
    shown = np.maximum(shown, np.float32(lowest))
    mask = _about_ring(ring / grid.cell_px, (rows, columns), half, grid, tuning)
    corners = cv2.goodFeaturesToTrack(
        shown, tuning.count, tuning.plainest, tuning.apart_mm / grid.cell_mm, mask=mask, blockSize=2 * half + 1
    )
    if corners is None:
        return []
    patches = []
    for x, y in np.rint(corners[:, 0]).astype(int).tolist():
        values = shown[y - half : y + half + 1, x - half : x + half + 1]
        patches.append(CompanionPatch(np.array([x, y]), values.copy(), lowest))
    return patches


def follow_patch(
    patch: CompanionPatch, frame: Frame, grid: CompanionGrid, places_mm: Array, tuning: PatchTuning
) -> tuple[Array, float]:
    """Where a patch has gone.

    Args:
        patch: to follow.
        frame: the image.
        grid: its cells.
        places_mm: (N, 2) displacements from its home that are likely, the likeliest first, mm.
        tuning: how far it is looked for.

    Returns:
        (2,) its displacement in mm, and the correlation there; 0 where nothing of it is inside the image.
    """
    half, cell_mm, margin = len(patch.values) // 2, grid.cell_mm, tuning.search_mm
    (x, y), *others = places_mm.tolist()
    near = [(x, y), *((u, v) for u, v in others if max(abs(u - x), abs(v - y)) <= tuning.widest_mm)]
    (column, row), (rows, columns) = patch.home.tolist(), grid.shape(frame)

    def window(along: Sequence[float], home: int, size: int) -> tuple[int, int]:
        first = math.floor((min(along) - margin) / cell_mm) + home - half
        last = math.ceil((max(along) + margin) / cell_mm) + home + half
        return max(first, 0), min(last + 1, size)

    left, right = window([u for u, _ in near], column, columns)
    top, bottom = window([v for _, v in near], row, rows)
    if min(right - left, bottom - top) < len(patch.values):
        return places_mm[0], 0.0
    x, y, likeness = _found(patch, frame, grid, tuning, (left, top, right, bottom))
    return np.array([(x - (column - half)) * cell_mm, (y - (row - half)) * cell_mm]), likeness


def _found(
    patch: CompanionPatch, frame: Frame, grid: CompanionGrid, tuning: PatchTuning, part: tuple[int, int, int, int]
) -> tuple[float, float, float]:
    """Where a part of an image, cells (left, top, right, bottom), is most like a patch.

    Returns:
        The cell x, y of the patch's first there, to a fraction; and the correlation.
    """
    if has_kernels():
        from lasso_motion_ros.ring.kernels import patches as kernels

        fine, coarse, reach = _scales(grid, tuning)
        place: tuple[float, float, float] = kernels.found(
            np.ascontiguousarray(frame.pixels),
            patch.values,
            patch.lowest,
            grid.bright,
            grid.cell_px,
            part,
            blur_taps(_FINE_CELLS, fine),
            blur_taps(2 * reach + 1, coarse),
            grey_logarithms(),
        )
        return place
    shown = np.maximum(_devices(frame, grid, tuning, part), np.float32(patch.lowest))
    likeness = cv2.matchTemplate(shown, patch.values, cv2.TM_CCOEFF_NORMED)
    _, best, _, (x, y) = cv2.minMaxLoc(likeness)
    left, top, _, _ = part
    return left + x + _beyond(likeness[y], x), top + y + _beyond(likeness[:, x], y), float(best)


def _scales(grid: CompanionGrid, tuning: PatchTuning) -> tuple[float, float, int]:
    """Standard deviations of the two blurs, and how far the wider one reaches, cells."""
    fine, coarse = tuning.fine_mm / grid.cell_mm, tuning.coarse_mm / grid.cell_mm
    return fine, coarse, 2 * round(coarse) + 1  # two standard deviations: what lies further hardly counts


def _devices(frame: Frame, grid: CompanionGrid, tuning: PatchTuning, part: tuple[int, int, int, int]) -> Image:
    """What is as fine as a device in some cells (left, top, right, bottom) of an image, positive on it.

    In the logarithm of the grey values a device weighs the same in bright and dark regions, at any dose.
    """
    rows, columns = grid.shape(frame)
    fine, coarse, reach = _scales(grid, tuning)
    left, top, right, bottom = part
    outer_left, outer_top = max(left - reach, 0), max(top - reach, 0)
    outer_right, outer_bottom = min(right + reach, columns), min(bottom + reach, rows)
    cell = grid.cell_px
    cropped = frame.pixels[outer_top * cell : outer_bottom * cell, outer_left * cell : outer_right * cell]
    size = outer_right - outer_left, outer_bottom - outer_top
    grey = cv2.resize(cropped, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    logarithm = cv2.log(cv2.max(grey, 1.0, dst=grey), dst=grey)
    slow = cv2.GaussianBlur(logarithm, (2 * reach + 1, 2 * reach + 1), coarse)
    fast = cv2.GaussianBlur(logarithm, (_FINE_CELLS, _FINE_CELLS), fine)
    band = cv2.subtract(fast, slow, dst=fast) if grid.bright else cv2.subtract(slow, fast, dst=fast)
    inner = band[top - outer_top : bottom - outer_top, left - outer_left : right - outer_left]
    return np.asarray(inner, dtype=np.float32)


def _about_ring(
    ring: Array, shape: tuple[int, int], half: int, grid: CompanionGrid, tuning: PatchTuning
) -> npt.NDArray[np.uint8]:
    """Cells (h, w) that may be a patch's middle: 255 about the ring, whose curve is (N, 2) cells, and not on it."""
    allowed = np.zeros(shape, np.uint8)
    middle = tuple(np.rint(ring.mean(axis=0)).astype(int).tolist())
    cv2.circle(allowed, middle, round(tuning.reach_mm / grid.cell_mm), 255, cv2.FILLED)
    hull = cv2.convexHull(np.rint(ring).astype(np.int32))
    cv2.fillConvexPoly(allowed, hull, 0)
    cv2.polylines(allowed, [hull], True, 0, 2 * round(tuning.from_ring_mm / grid.cell_mm))
    border = half + 1
    allowed[:border] = allowed[-border:] = 0
    allowed[:, :border] = allowed[:, -border:] = 0
    return allowed


def _beyond(values: Image, at: int) -> float:
    """How far beside a peak (index) of values (N,) the vertex of a parabola lies; 0 at their ends."""
    return float(vertex(*values[at - 1 : at + 2])) if 0 < at < len(values) - 1 else 0.0
