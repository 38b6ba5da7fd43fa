"""How what moves in one plane has moved from one image to another, block by block.

Ribs and spine stand still, the heart and the catheters in it move, both in the same place of an image. What stands
still correlates with the later image as it does with itself: with a good half of that taken away, what moves has the
highest peak, wherever it has gone. Noise correlates with itself alone, and its peak is left out of that.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from scipy import fft

from lasso_motion_ros.initialisation.electrode_spots import electrode_contrast
from lasso_motion_ros.initialisation.laid_image import CELL_MM, SMOOTHED_MM, Image, LaidImage
from lasso_motion_ros.ring.search import vertex

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]


@dataclass(frozen=True)
class _Tuning:
    """Which blocks, and how far they are looked for. A block's cell is a millimetre."""

    cells: int = 2  # of an image, that make one of a block
    apart: int = 16  # from block to block
    sigma: float = 12.0  # of a block's weights
    sigma_there: float = 18.0  # of those in the other image: what is near is likelier
    half: int = 24
    reach: int = 20
    size: int = 96  # of the transforms: both halves, and the reach, twice
    range: tuple[float, float] = (-1.0, 3.0)  # of the evidence: what is denser is no better an electrode
    still_share: float = 0.55  # of what a block shows, that is taken to stand still
    # What moves about a block says where it is likelier to have gone.
    about_mm: float = 30.0  # standard deviation
    about_still_share: float = 0.8
    about_sigma: float = 2.0  # of where a block goes, from there
    about_worth: float = 0.4  # of the block's own peak


TUNING = _Tuning()
BLOCK_M = 1e-3 * TUNING.apart
_CELL_M = 1e-3 * CELL_MM * TUNING.cells
_SIDE = 2 * (TUNING.half + TUNING.reach)
_MARGIN = _SIDE  # about an image: blocks near its edge, and later images that reach less far
_ASIDE = np.arange(_SIDE) - 0.5 * (_SIDE - 1)


@dataclass(frozen=True, eq=False)
class BlockMotion:
    """How far what moves in each block of one plane has moved until a later image.

    Attributes:
        places: (N, 2) the blocks' middles, along columns and rows, metres in the grid.
        moved: (N, 2) likewise, from the first image's grid to the later one's.
    """

    places: Array
    moved: Array

    def at(self, place: Array) -> Array:
        """(2,) of the block whose middle is nearest to a place (2,)."""
        away = self.places - place
        return np.asarray(self.moved[int(np.einsum("ni,ni->n", away, away).argmin())])


@dataclass(frozen=True, eq=False)
class Blocks:
    """One plane's image, ready to be compared with others of that plane.

    Attributes:
        left: of the first column of blocks' cells, metres in the grid.
        top: of the first row, metres in the grid.
        centres: (N, 2) cells of the blocks' middles, column and row.
        spectra: (N, S, F) complex64 of the blocks.
        itself: (N, D, D) float32 how each correlates with its own surroundings.
    """

    left: float
    top: float
    centres: Indices
    spectra: npt.NDArray[np.complex64]
    itself: Image

    @classmethod
    def of(cls, laid: LaidImage, band: Image) -> Blocks:
        """A plane's image in blocks.

        Args:
            laid: the image.
            band: (H, W) what it shows of electrodes.
        """
        shown = _shown(laid, band)
        height, width = (side - 2 * _MARGIN for side in shown.shape)
        rows, columns = (np.arange(TUNING.apart // 2, max(one, TUNING.apart), TUNING.apart) for one in (height, width))
        centres = np.stack(np.meshgrid(columns, rows), axis=2).reshape(-1, 2)
        patches = _patches(shown, centres)
        spectra = _spectra(patches * _HERE).conj()
        return cls(laid.left, laid.top, centres, spectra, _correlation(spectra * _spectra(patches * _THERE)))

    @property
    def places(self) -> Array:
        """(N, 2) the blocks' middles, along columns and rows, metres in the grid."""
        # A cell's middle lies between those of the image's that make it.
        middle = 0.5 * (TUNING.cells - 1) * 1e-3 * CELL_MM
        return np.array([self.left, self.top]) + middle + _CELL_M * self.centres

    def until(self, laid: LaidImage, band: Image) -> BlockMotion:
        """How they have moved until a later image.

        Args:
            laid: the later image.
            band: (H, W) what it shows of electrodes.
        """
        # The later image's cells lie elsewhere if its grid does.
        here, there = (np.array([one.left, one.top]) for one in (self, laid))
        offset = np.rint((here - there) / _CELL_M).astype(np.intp)
        patches = _patches(_shown(laid, band), self.centres + offset)
        correlation = _correlation(self.spectra * _spectra(patches * _THERE))
        noise = np.maximum(self.itself[:, TUNING.reach, TUNING.reach] - correlation.max(axis=(1, 2)), 0.0)
        still = self.itself - noise[:, None, None] * _NOISE
        moving = correlation - np.float32(TUNING.still_share) * still
        moving += self._likelier(correlation - np.float32(TUNING.about_still_share) * still, moving)
        return BlockMotion(self.places, _CELL_M * (_peaks(moving) + offset) + there - here)

    def _likelier(self, clearly: Image, moving: Image) -> Image:
        """(N, D, D) what is added to a block's own correlation where all about it has gone.

        Args:
            clearly: (N, D, D) what moves in each, less surely but without what stands still.
            moving: (N, D, D) what moves in each.
        """
        positive = np.maximum(clearly, 0.0)
        share = positive / np.maximum(positive.max(axis=(1, 2), keepdims=True), np.float32(1e-9))
        away = np.square(self.places[:, None] - self.places).sum(axis=2)
        weights = np.exp(-0.5 * away / (1e-3 * TUNING.about_mm) ** 2).astype(np.float32)
        weights /= weights.sum(axis=1, keepdims=True)
        count, side = len(share), share.shape[1]
        about = (weights @ share.reshape(count, -1)).reshape(share.shape)
        gone = np.rint(_peaks(np.stack([cv2.GaussianBlur(one, (0, 0), 1.0) for one in about]))) + TUNING.reach
        one = np.arange(side)
        column, row = (np.exp(-0.5 * ((one - gone[:, k : k + 1]) / TUNING.about_sigma) ** 2) for k in range(2))
        likelier = TUNING.about_worth * moving.max(axis=(1, 2))[:, None, None] * row[:, :, None] * column[:, None, :]
        return np.asarray(likelier, np.float32)


def _window(sigma: float, half: int) -> Image:
    one = np.exp(-0.5 * (_ASIDE / sigma) ** 2) * (np.abs(_ASIDE) < half)
    return np.asarray(np.outer(one, one), np.float32)


_HERE = _window(TUNING.sigma, TUNING.half)
_THERE = _window(TUNING.sigma_there, _SIDE)


def _shown(laid: LaidImage, band: Image) -> Image:
    """(H, W) what an image shows of electrodes, a cell each, within a margin of nothing."""
    clipped = np.clip(band, *TUNING.range) * laid.inside
    return np.pad(_in_cells(clipped), _MARGIN)


def _in_cells(values: Image) -> Image:
    height, width = (side // TUNING.cells for side in values.shape)
    whole = values[: height * TUNING.cells, : width * TUNING.cells]
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), np.float32)


def _patches(shown: Image, centres: Indices) -> Image:
    """(N, S, S) what is about some cells (N, 2); those far outside show nothing."""
    height, width = shown.shape
    windows = np.lib.stride_tricks.sliding_window_view(shown, (_SIDE, _SIDE))
    column = np.clip(centres[:, 0] + _MARGIN - _SIDE // 2, 0, width - _SIDE)
    row = np.clip(centres[:, 1] + _MARGIN - _SIDE // 2, 0, height - _SIDE)
    return np.asarray(windows[row, column])


def _spectra(patches: Image) -> npt.NDArray[np.complex64]:
    return np.asarray(fft.rfft2(patches, (TUNING.size, TUNING.size)), np.complex64)


def _correlation(spectra: npt.NDArray[np.complex64]) -> Image:
    """(N, D, D) by displacement, from minus the reach to plus the reach."""
    whole = fft.irfft2(spectra, (TUNING.size, TUNING.size))
    halves = slice(-TUNING.reach, None), slice(TUNING.reach + 1)
    rows = [np.concatenate([whole[:, below, beside] for beside in halves], axis=2) for below in halves]
    return np.asarray(np.concatenate(rows, axis=1), np.float32)


def _peaks(correlation: Image) -> Array:
    """(N, 2) where each of some (N, D, D) is highest, cells along columns and rows, to a fraction of one."""
    count, side, _ = correlation.shape
    inner = correlation[:, 1:-1, 1:-1].reshape(count, -1)
    row, column = np.unravel_index(inner.argmax(axis=1), (side - 2, side - 2))
    row, column, k = row + 1, column + 1, np.arange(count)
    on = correlation[k, row, column]
    across = vertex(correlation[k, row, column - 1], on, correlation[k, row, column + 1])
    down = vertex(correlation[k, row - 1, column], on, correlation[k, row + 1, column])
    return np.stack([column + across, row + down], axis=1) - TUNING.reach


def _noise() -> Image:
    """(D, D) how white noise correlates with itself once it is shown in cells; 1 without displacement."""
    side = TUNING.cells * TUNING.size
    impulse = np.zeros((side, side), np.float32)
    impulse[side // 2, side // 2] = 1.0
    smoothed = np.asarray(cv2.GaussianBlur(impulse, (0, 0), SMOOTHED_MM / CELL_MM), np.float32)
    cells = _in_cells(electrode_contrast(smoothed))
    itself = _correlation((np.abs(fft.rfft2(cells)) ** 2)[None])[0]
    return np.asarray(itself / itself.max(), np.float32)


_NOISE = _noise()
