"""Spots as large as an electrode in both planes, and the points in space that both show.

An electrode is a spot in each plane, at one height of the grid. Noise makes a thousand spots in an image, but two of
them seldom lie at one height and on one ring: a ring's ten electrodes stand out among the points in space.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid
from lasso_motion_ros.initialisation.laid_image import CELL_MM, SMOOTHED_MM, Image, LaidImage
from lasso_motion_ros.ring.search import vertex

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]


@dataclass(frozen=True)
class _Tuning:
    """What a spot is."""

    # As wide as an electrode; the evidence of the ring's model is made with the same widths (ring/working_image.py).
    fine_mm: float = 0.45
    coarse_mm: float = 1.35
    window_cells: int = 33  # of the root mean square about it
    faintest: float = 1.5  # in units of it
    edge_cells: int = 2


TUNING = _Tuning()


@dataclass(frozen=True, eq=False)
class Spots:
    """What one plane shows of things as large as an electrode.

    Attributes:
        columns: (S,) metres in the grid.
        rows: (S,) likewise.
        strengths: (S,) in units of the local root mean square.
    """

    columns: Array
    rows: Array
    strengths: Array


def electrode_spots(laid: LaidImage, shown: Image) -> Spots:
    """The spots of one plane, to a fraction of a cell.

    Args:
        laid: the plane's image.
        shown: (H, W) from `electrode_band`.
    """
    edge = TUNING.edge_cells
    is_peak = (cv2.dilate(shown, np.ones((3, 3), np.uint8)) == shown) & (shown > TUNING.faintest)
    is_peak[:edge], is_peak[-edge:], is_peak[:, :edge], is_peak[:, -edge:] = False, False, False, False
    y, x = np.nonzero(is_peak)
    on = shown[y, x]
    aside, below = vertex(shown[y, x - 1], on, shown[y, x + 1]), vertex(shown[y - 1, x], on, shown[y + 1, x])
    cell_m = 1e-3 * CELL_MM
    return Spots(laid.left + cell_m * (x + aside), laid.top + cell_m * (y + below), on.astype(np.float64))


def electrode_band(laid: LaidImage, *, bright: bool) -> Image:
    """(H, W) differences of Gaussians as wide as an electrode, relative to their local root mean square.

    Args:
        laid: a plane's image.
        bright: whether electrodes are brighter than what is behind them.
    """
    band = electrode_contrast(laid.values) * (laid.inside if bright else -laid.inside)
    window = (TUNING.window_cells, TUNING.window_cells)
    power = cv2.blur(band * band, window) / np.maximum(cv2.blur(laid.inside, window), np.float32(0.05))
    # A constant area has no noise to divide by and shows nothing.
    return np.asarray(band / np.sqrt(np.maximum(power, np.float32(1e-9))), np.float32)


def electrode_contrast(values: Image) -> Image:
    """(H, W) differences of Gaussians as wide as an electrode of a laid image's values, positive where it is bright."""
    sigmas = (np.sqrt(sigma**2 - SMOOTHED_MM**2) / CELL_MM for sigma in (TUNING.fine_mm, TUNING.coarse_mm))
    fine, coarse = (cv2.GaussianBlur(values, (0, 0), sigma) for sigma in sigmas)
    return np.asarray(fine - coarse)


@dataclass(frozen=True, eq=False)
class ElectrodePoints:
    """Points in space where both planes show a spot.

    Attributes:
        places: (M, 3) world metres, at plane A's height.
        lifts: (M,) m by which plane B sees each higher than plane A.
        strengths: (M,) of the fainter spot.
        spots: (M, 2) which of plane A's spots and of plane B's each is.
    """

    places: Array
    lifts: Array
    strengths: Array
    spots: Indices

    def __len__(self) -> int:
        return len(self.lifts)

    def __getitem__(self, index: npt.NDArray[np.generic] | slice) -> ElectrodePoints:
        return ElectrodePoints(*(getattr(self, one.name)[index] for one in fields(self)))


def points_of(spots: Mapping[Plane, Spots], grid: EpipolarGrid, largest_lift_m: float) -> ElectrodePoints:
    """All points where the planes' spots can be one electrode.

    Args:
        spots: both planes'.
        grid: on which they lie.
        largest_lift_m: by which the planes' heights may differ: calibrations are off, and B may be exposed later.
    """
    a, b = (spots[plane] for plane in PLANES)
    order = np.argsort(b.rows)
    first, last = (np.searchsorted(b.rows[order], a.rows + way * largest_lift_m) for way in (-1.0, 1.0))
    count = last - first
    of_a = np.repeat(np.arange(len(count)), count)
    of_b = order[np.arange(len(of_a)) - np.repeat(np.cumsum(count) - count, count) + first[of_a]]
    places = grid.places({"a": a.columns[of_a], "b": b.columns[of_b]}, a.rows[of_a])
    lifts = b.rows[of_b] - a.rows[of_a]
    return ElectrodePoints(
        places, lifts, np.minimum(a.strengths[of_a], b.strengths[of_b]), np.stack([of_a, of_b], axis=1)
    )
