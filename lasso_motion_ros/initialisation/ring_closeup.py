"""What a few successive pairs show of one ring together: a close-up of the first pair, with the others laid on it.

By how much a ring has moved it tells itself: what lies along its curve in one plane correlates with what all other
pairs have there. That is finer than the motion of the block about it, in which other things move otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.initialisation.block_motion import BlockMotion
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid
from lasso_motion_ros.initialisation.laid_image import CELL_MM, Image, reduced
from lasso_motion_ros.initialisation.laid_pair import LaidPair
from lasso_motion_ros.initialisation.shaped_rings import ShapedRings
from lasso_motion_ros.ring.search import vertex
from lasso_motion_ros.ring.working_image import NOISE_WINDOW_PX

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How a ring's own motion is told, and how much of the images is taken."""

    beside_cells: float = 2.0  # standard deviation of the weights beside its curve
    reach_cells: int = 8  # from the motion of the block about it
    rounds: int = 2
    range: tuple[float, float] = (-1.0, 3.0)  # of the evidence
    margin_m: float = 14e-3  # of a close-up, beyond the ring


TUNING = _Tuning()
_CELL_M = 1e-3 * CELL_MM
_FULL_SCALE = 60_000.0  # of a close-up's grey values: finer than any noise
_SAMPLED = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP


class RingCloseups:
    """Close-ups of rings in the first of some successive pairs.

    Args:
        pairs: laid out.
        motions: per plane, how the blocks of the first have moved until each of the others.
    """

    def __init__(self, pairs: Sequence[LaidPair], motions: Mapping[Plane, Sequence[BlockMotion]]) -> None:
        self._pairs, self._motions = pairs, motions
        self._bands = {p: [np.clip(one.bands[p], *TUNING.range) * one.laid[p].inside for one in pairs] for p in PLANES}
        self._values = {p: [_values(one, p) for one in pairs] for p in PLANES}

    def of(self, ring: ShapedRings, told: Sequence[Array]) -> FramePair:
        """The close-up of one ring; its frames are as fine as a ring is looked for.

        Args:
            ring: one.
            told: for each later pair, (4,) m by which it has moved until then, and by which its lift has grown, as its
                electrodes have it.
        """
        frames = {plane: self._closeup(ring, told, plane) for plane in PLANES}
        return replace(self._pairs[0].pair, a=frames["a"], b=frames["b"])

    def _closeup(self, ring: ShapedRings, told: Sequence[Array], plane: Plane) -> Frame:
        first = self._pairs[0]
        curve = _laid(ring, first.grid, plane)
        middle = _middle(curve)
        by_electrodes = [
            _middle(_laid(replace(ring, centres=ring.centres + by[:3], lifts=ring.lifts + by[3]), one.grid, plane))
            - middle
            for one, by in zip(self._pairs[1:], told, strict=True)
        ]
        moved = self._moved(curve, middle, by_electrodes, plane)
        values, projection = self._values[plane][0]
        here = _affine(projection, first.grid, plane, middle)
        reach = np.abs(here[:, :2]) @ (0.5 * np.ptp(curve, axis=0) + TUNING.margin_m)
        reach = np.maximum(reach, NOISE_WINDOW_PX + 2)  # a working image is no smaller
        height, width = values.shape
        left, top = np.clip(np.floor(here[:, 2] - reach), 0, (width - 1, height - 1)).astype(int).tolist()
        right, bottom = np.clip(np.ceil(here[:, 2] + reach), (left, top), (width - 1, height - 1)).astype(int).tolist()
        size = (right - left + 1, bottom - top + 1)
        shown = values[top : bottom + 1, left : right + 1]
        total, weights = shown.copy(), np.ones_like(shown)
        for later, by, (there, seen) in zip(self._pairs[1:], moved, self._values[plane][1:], strict=True):
            to = _affine(seen, later.grid, plane, middle + by)
            turned = to[:, :2] @ np.linalg.inv(here[:, :2])
            matrix = np.column_stack([turned, to[:, 2] + turned @ ((left, top) - here[:, 2])])
            block = cv2.warpAffine(
                there, matrix, size, flags=_SAMPLED, borderMode=cv2.BORDER_CONSTANT, borderValue=np.nan
            )
            is_seen = np.isfinite(block)
            if is_seen.any():
                level = float(shown[is_seen].mean()) - float(block[is_seen].mean())  # another exposure
                total += np.where(is_seen, block + np.float32(level), np.float32(0.0))
                weights += is_seen
        mean = total / weights
        grey = mean if first.bright else np.asarray(cv2.exp(mean - mean.max()))
        scaled = np.clip(grey * np.float32(_FULL_SCALE / max(float(grey.max()), 1e-9)), 0.0, _FULL_SCALE)
        frame = first.pair.frames[plane]
        return Frame(frame.stamp_ns, np.rint(scaled).astype(np.uint16), projection.cropped(left, top, *size))

    def _moved(self, curve: Array, middle: Array, told: Sequence[Array], plane: Plane) -> list[Array]:
        """(2,) metres in the grid by which a ring has moved until each later pair.

        Args:
            curve: (P, 2) of the ring in the plane's grid.
            middle: (2,) of it.
            told: for each later pair, (2,) as its electrodes have it.
            plane: which.
        """
        half = int(np.ceil(0.5 * np.ptp(curve, axis=0).max() / _CELL_M + 3.0 * TUNING.beside_cells))
        beside = _beside((curve - middle) / _CELL_M + half, 2 * half + 1)
        laid = [one.laid[plane] for one in self._pairs]

        def about(number: int, moved: Array, reach: int) -> Image:
            image = laid[number]
            at = (middle + moved - (image.left, image.top)) / _CELL_M - reach
            to = np.array([[1.0, 0.0, at[0]], [0.0, 1.0, at[1]]])
            size = (2 * reach + 1, 2 * reach + 1)
            return np.asarray(cv2.warpAffine(self._bands[plane][number], to, size, flags=_SAMPLED))

        def nearby(number: int, begun: Array, wanted: Image) -> tuple[Array, float]:
            """Where beside a beginning a later pair has most of what is wanted, and how much."""
            found = cv2.matchTemplate(about(number, begun, half + TUNING.reach_cells), wanted, cv2.TM_CCORR)
            return begun + _CELL_M * (_peak(found) - TUNING.reach_cells), float(found.max())

        shown = [about(0, np.zeros(2), half)]
        moved = [np.zeros(2)]
        # The block about it may be mistaken, and so may its electrodes.
        for number, begun in enumerate(zip(self._motions[plane], told, strict=True), 1):
            block, electrodes = begun
            ways = [nearby(number, way, shown[0] * beside) for way in (block.at(middle), electrodes)]
            moved.append(max(ways, key=lambda way: way[1])[0])
            shown.append(about(number, moved[number], half))
        for _ in range(TUNING.rounds):
            for number in range(1, len(laid)):
                others = np.sum([one for k, one in enumerate(shown) if k != number], axis=0) * beside
                moved[number], _ = nearby(number, moved[number], others)
                shown[number] = about(number, moved[number], half)
        return moved[1:]


def _laid(ring: ShapedRings, grid: EpipolarGrid, plane: Plane) -> Array:
    """(P, 2) columns and rows of one ring's points in a plane's grid, metres."""
    columns, rows = grid.lay(plane, ring.points()[0])
    return np.stack([columns, rows + ring.lifts[0] if plane == "b" else rows], axis=1)


def _middle(curve: Array) -> Array:
    return np.asarray(0.5 * (curve.min(axis=0) + curve.max(axis=0)))


def _values(pair: LaidPair, plane: Plane) -> tuple[Image, Projection]:
    """A plane's grey values, reduced, or their logarithm, and the projection to those."""
    grey, projection = reduced(pair.pair.frames[plane], pair.grid.centre)
    values = grey.astype(np.float32)
    return values if pair.bright else np.asarray(cv2.log(np.maximum(values, np.float32(1.0)))), projection


def _affine(projection: Projection, grid: EpipolarGrid, plane: Plane, place: Array) -> Array:
    """(2, 3) pixels of what lies beside a place (2,) of the grid: by metres along columns and rows from it."""
    step = 1e-3
    places = place + step * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    at, aside, below = projection.project(grid.point(plane, *places.T))
    return np.stack([(aside - at) / step, (below - at) / step, at], axis=1)


def _beside(curve: Array, side: int) -> Image:
    """(S, S) weights of what lies beside a closed curve (P, 2), cells."""
    drawn = np.full((side, side), 255, np.uint8)
    cv2.polylines(drawn, [np.rint(curve).astype(np.int32).reshape(-1, 1, 2)], isClosed=True, color=0)
    away = cv2.distanceTransform(drawn, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(np.exp(-0.5 * (away / TUNING.beside_cells) ** 2), np.float32)


def _peak(found: Image) -> Array:
    """(2,) column and row where an image is highest, to a fraction of a cell."""
    height, width = found.shape
    row, column = divmod(int(found.argmax()), width)
    row, column = min(max(row, 1), height - 2), min(max(column, 1), width - 2)
    before, after = found[[row, row - 1], [column - 1, column]], found[[row, row + 1], [column + 1, column]]
    return np.array([column, row]) + vertex(before, found[row, column], after)
