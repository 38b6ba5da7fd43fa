"""From a circle in space to a ring's model, and from that to clicks, as a person would set them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, Plane, Seed
from lasso_motion_ros.initialisation.circles import Circles
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid
from lasso_motion_ros.ring.loop_model import LoopModel, model_beside
from lasso_motion_ros.ring.seed_images import SeedImages
from lasso_motion_ros.seeding.cones import Ellipse3D

Array = npt.NDArray[np.float64]

CLICKS = 20


def model_of(circle: Circles, images: SeedImages, grid: EpipolarGrid) -> LoopModel:
    """The ring whose curve follows the lines beside one circle in both planes.

    Args:
        circle: one.
        images: of the pair.
        grid: of the two planes.

    Raises:
        ReconstructionError: there is none.
    """
    centre, points = circle.centres[0], circle.points(np.array([0.0, 0.5 * np.pi]))[0]
    lift, share_of_a = grid.upward * circle.lifts[0], images.share_of_a
    shares: dict[Plane, float] = {"a": -share_of_a, "b": 1.0 - share_of_a}
    shifts = {plane: share * (images.projections[plane].jacobian(centre) @ lift) for plane, share in shares.items()}
    return model_beside(Ellipse3D(centre, points[0] - centre, points[1] - centre), images, shifts)


def clicks_along(model: LoopModel, images: SeedImages) -> Seed:
    """Clicks along a ring in both planes."""
    places = np.linspace(0, len(model.points) - 1, CLICKS + 1).astype(int)[:-1]
    a, b = (
        images.projections[plane].project(model.points[places]) + model.shift(plane, images.projections[plane])
        for plane in PLANES
    )
    return Seed(a, b)


def places_along(model: LoopModel, images: SeedImages) -> dict[Plane, Array]:
    """Per plane, (L, 2) where a ring's curve lies in the image, mm at the ring."""
    return {
        plane: view.project(model.points) * view.millimetres_per_pixel(model.centre)
        for plane, view in images.projections.items()
    }
