"""A pair with both planes on their grid, and what they show of electrodes there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import GeometryError
from lasso_motion_ros.geometry.frames import FramePair, Plane
from lasso_motion_ros.initialisation.electrode_spots import (
    ElectrodePoints,
    Spots,
    electrode_band,
    electrode_spots,
    points_of,
)
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid, largest_lift_m
from lasso_motion_ros.initialisation.laid_image import Image, LaidImage, row_range
from lasso_motion_ros.initialisation.nearby_points import PointCloud

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    smallest_field_m: float = 0.02  # that both planes have in common


TUNING = _Tuning()


@dataclass(frozen=True, eq=False)
class LaidPair:
    """Both planes of one pair on their grid.

    Attributes:
        pair: the images.
        grid: theirs.
        laid: per plane, its image.
        between_s: from plane A's exposure to plane B's.
        bright: whether catheters are brighter than what is behind them.
    """

    pair: FramePair
    grid: EpipolarGrid
    laid: dict[Plane, LaidImage]
    between_s: float
    bright: bool

    @classmethod
    def of(cls, pair: FramePair, *, bright: bool) -> LaidPair:
        """A pair with both planes.

        Args:
            pair: the images.
            bright: whether catheters are brighter than what is behind them. If not, the grey values' logarithm is laid
                out, in which attenuation adds up.

        Raises:
            GeometryError: the planes look from nearly the same direction, or have too little in common.
        """
        frames = pair.frames
        grid = EpipolarGrid.of({plane: frame.projection for plane, frame in frames.items()})
        rows = row_range(frames, grid)
        common_m = rows[1] - rows[0]
        if common_m < TUNING.smallest_field_m:
            raise GeometryError(
                f"the planes have {1e3 * max(common_m, 0.0):.0f} mm of height in common; a ring is only found where it"
                f" is {1e3 * TUNING.smallest_field_m:.0f} mm or more"
            )
        laid = {p: LaidImage.of(frame, p, grid, rows, logarithm=not bright) for p, frame in frames.items()}
        return cls(pair, grid, laid, 1e-9 * (frames["b"].stamp_ns - frames["a"].stamp_ns), bright)

    @property
    def largest_lift_m(self) -> float:
        """By which the planes' heights may differ."""
        return largest_lift_m(self.between_s)

    @cached_property
    def bands(self) -> dict[Plane, Image]:
        """Per plane, (H, W) what it shows of electrodes."""
        return {plane: electrode_band(one, bright=self.bright) for plane, one in self.laid.items()}

    @cached_property
    def spots(self) -> dict[Plane, Spots]:
        """Per plane, its spots."""
        return {plane: electrode_spots(self.laid[plane], band) for plane, band in self.bands.items()}

    @cached_property
    def points(self) -> ElectrodePoints:
        """Where both planes show a spot."""
        return points_of(self.spots, self.grid, self.largest_lift_m)

    @cached_property
    def cloud(self) -> PointCloud:
        """Those, to be asked for the ones about rings."""
        return PointCloud(self.points, self.largest_lift_m)
