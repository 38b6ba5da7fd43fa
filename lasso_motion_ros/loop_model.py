"""The 3-D model of the loop, built from the clicks on one pair."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.configuration import TrackerConfig
from lasso_motion_ros.curves import resample
from lasso_motion_ros.frames import PLANES, FramePair, Plane, Seed
from lasso_motion_ros.reconstruction import reconstruct_ellipse
from lasso_motion_ros.seeding import is_bright, outlines, require_both_planes

Array = npt.NDArray[np.float64]

POINTS = 160


@dataclass(frozen=True, eq=False)
class LoopModel:
    """The loop at the reference.

    Attributes:
        points: (L, 3) along the loop, evenly spaced, world metres.
        centre: (3,) mean of the points, world metres.
        bright: True where the catheter is brighter than its background.
        shifts: per plane, (2,) pixels by which its images lie off its calibration.
    """

    points: Array
    centre: Array
    bright: bool
    shifts: dict[Plane, Array]

    @property
    def arms(self) -> Array:
        """(L, 3) the points about the centre, metres."""
        return self.points - self.centre

    @property
    def radius_mm(self) -> float:
        """Largest distance of a point from the centre, mm."""
        return 1e3 * float(np.linalg.norm(self.arms, axis=1).max())


def build_loop_model(pair: FramePair, seed: Seed, config: TrackerConfig) -> LoopModel:
    """The loop's curve from the clicks.

    Raises:
        SeedError: clicks that are too few or outside the image, or a pair that lacks a plane.
        ReconstructionError: no 3-D loop explains the clicks.
    """
    projections = require_both_planes(pair)
    bright = is_bright(pair, seed, config)
    paths = outlines(pair, seed, config, bright=bright)
    ellipse = reconstruct_ellipse(projections, paths).chosen.ellipse.points(400)
    points = resample(np.vstack([ellipse, ellipse[:1]]), POINTS)
    return LoopModel(points, points.mean(axis=0), bright, {plane: np.zeros(2) for plane in PLANES})
