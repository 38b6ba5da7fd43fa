"""From a ring in space to a ring's model, and from that to clicks, as a person would set them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, Plane, Seed
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid
from lasso_motion_ros.initialisation.shaped_rings import ShapedRings
from lasso_motion_ros.ring.loop_model import LoopModel
from lasso_motion_ros.ring.seed_curves import model_beside
from lasso_motion_ros.ring.seed_images import SeedImages
from lasso_motion_ros.seeding.loop_outline import TURN, angles_between

Array = npt.NDArray[np.float64]

CLICKS = 20
# Of so many places along a found ring, from the wire. What a ring is off by, all of them are off by together: they say
# as much as one place or two that are half a millimetre off by themselves.
RING_SIGMA_MM = 2.0


def model_of(ring: ShapedRings, images: SeedImages, grid: EpipolarGrid) -> LoopModel:
    """The ring whose curve follows the lines beside one ring in both planes.

    Args:
        ring: one.
        images: of the pair.
        grid: of the two planes.

    Raises:
        ReconstructionError: there is none.
    """
    ellipse = ring.ellipse(0)
    lift, share_of_a = grid.upward * ring.lifts[0], images.share_of_a
    shares: dict[Plane, float] = {"a": -share_of_a, "b": 1.0 - share_of_a}
    jacobians = {plane: view.jacobian(ellipse.centre) for plane, view in images.projections.items()}
    shifts = {plane: share * (jacobians[plane] @ lift) for plane, share in shares.items()}
    # Between the heights at which the planes see it, as far as plane A's images are taken to be off, too.
    between = share_of_a * lift
    around = ring.beside_ellipse(0, angles_between(0.0, TURN)) + between
    # Not where the curve begins and ends: which of both is nearer, rounding would tell.
    places = around[np.linspace(0, len(around) - 1, 2 * CLICKS + 1).astype(np.intp)[1::2]]
    a, b = (images.projections[plane].project(places) + shifts[plane] for plane in PLANES)
    return model_beside(around, images, shifts, Seed(a, b), RING_SIGMA_MM)[0]


def clicks_along(model: LoopModel, projections: Mapping[Plane, Projection]) -> Seed:
    """Clicks along a ring in both planes, by their projections."""
    places = model.points[_evenly(len(model.points))]
    a, b = (projections[plane].project(places) + model.shift(plane, projections[plane]) for plane in PLANES)
    return Seed(a, b)


def places_along(model: LoopModel, images: SeedImages) -> dict[Plane, Array]:
    """Per plane, (L, 2) where a ring's curve lies in the image, mm at the ring."""
    return {
        plane: view.project(model.points) * view.millimetres_per_pixel(model.centre)
        for plane, view in images.projections.items()
    }


def _evenly(count: int) -> npt.NDArray[np.intp]:
    """(CLICKS,) of so many points along a loop."""
    return np.asarray(np.linspace(0, count - 1, CLICKS + 1).astype(np.intp)[:-1])
