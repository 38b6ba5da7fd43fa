"""From a circle to clicks: the lines beside it in both planes, as a person would click them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, Frame, Plane, Seed
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.initialisation.circles import Circles
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid
from lasso_motion_ros.ring.line_map import LineMap
from lasso_motion_ros.ring.loop_curve import CurveFit, snap
from lasso_motion_ros.seeding.cones import Ellipse3D

Array = npt.NDArray[np.float64]

ROUNDS = 3
CLICKS = 20
ALONG = np.linspace(0.0, 2.0 * np.pi, 96)


@dataclass(frozen=True, eq=False)
class Outline:
    """The lines beside a circle.

    Attributes:
        curve: (L, 3) in space, along which both planes show them, world metres.
        lift: (3,) metres by which plane B sees it moved.
    """

    curve: Array
    lift: Array

    def pixels(self, plane: Plane, projection: Projection) -> Array:
        """(L, 2) where a plane's image shows it."""
        return projection.project(self.curve + self.lift if plane == "b" else self.curve)

    def seed(self, frames: dict[Plane, Frame]) -> Seed:
        """Clicks along it."""
        places = np.linspace(0, len(self.curve) - 1, CLICKS + 1).astype(int)[:-1]
        a, b = (self.pixels(plane, frames[plane].projection)[places] for plane in PLANES)
        return Seed(a, b)


def outline_of(
    circle: Circles, frames: dict[Plane, Frame], grid: EpipolarGrid, *, bright: bool, line_sigma_mm: float
) -> Outline:
    """The lines beside one circle.

    Args:
        circle: one.
        frames: of both planes.
        grid: of the two planes.
        bright: whether the catheter is brighter than its background.
        line_sigma_mm: scale of the line filter.
    """
    centre, points = circle.centres[0], circle.points(np.array([0.0, 0.5 * np.pi]))[0]
    ellipse = Ellipse3D(centre, points[0] - centre, points[1] - centre)
    projections = {plane: frames[plane].projection for plane in PLANES}
    lift = grid.upward * circle.lifts[0]
    projections["b"] = projections["b"].shifted(*(projections["b"].jacobian(centre) @ lift))
    lines = {plane: LineMap(frames[plane], bright=bright, sigma_mm=line_sigma_mm) for plane in PLANES}
    fit, curve = CurveFit(ellipse, ALONG), circle.points(ALONG)[0]
    for _ in range(ROUNDS):
        curve = fit(projections, snap(curve, lines, projections)).points
    return Outline(curve, lift)
