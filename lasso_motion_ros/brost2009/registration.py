"""Registration of the published method: eq. (3), minimised by a best-neighbour search."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.brost2009.features import DistanceMap
from lasso_motion_ros.config.brost2009 import REFERENCE_WIDTH_PX, RegistrationConfig
from lasso_motion_ros.geometry.curves import quarter_turn, unit_tangents
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import rigid

Array = npt.NDArray[np.float64]

LARGEST_NUMBER_OF_MOVES = 500  # a bound only; a search takes some tens


@dataclass(frozen=True, eq=False)
class PlaneDistances:
    """The distance map of one plane's image, and the projection into that image.

    Attributes:
        projection: world metres to pixels.
        distances: distance map about the expected place.
    """

    projection: Projection
    distances: DistanceMap


def normal_search_cost(
    model: Array, motions: Array, plane: PlaneDistances, normal_search_px: int, tie_break: float = 0.0
) -> Array:
    """Equation (3) of Brost et al. (2009) in one plane, for several motions at once.

    Every projected model point takes the smallest distance within ± `normal_search_px` pixels along the normal of the
    projected curve, since real loops are not exact ellipses. The cost is therefore level wherever each point has a line
    within reach, over a millimetre or so, and a search for less stops at the rim of that level; the distance at the
    point itself, added at a small weight, leads to its middle.

    Args:
        model: (L, 3) points along the closed model curve, world metres.
        motions: (K, 4, 4) rigid transforms to try.
        plane: the plane.
        normal_search_px: reach of the search, in pixels of a 1024-pixel-wide detector.
        tie_break: weight of the distance at the point itself; 0 is eq. (3).

    Returns:
        (K,) mean distance over the model's points, pixels of this image.
    """
    moved = model @ motions[:, :3, :3].transpose(0, 2, 1) + motions[:, None, :3, 3]
    pixels = plane.projection.project(moved)
    normals = quarter_turn(unit_tangents(pixels, closed=True)[0]).reshape(-1, 2)
    reach = normal_search_px * plane.projection.detector_width / REFERENCE_WIDTH_PX
    offsets = np.linspace(-reach, reach, 2 * max(1, round(reach)) + 1) if reach > 0 else np.zeros(1)
    flat = pixels.reshape(-1, 2)
    samples = np.empty((len(flat), len(offsets), 2), dtype=np.float32)
    samples[..., 0] = flat[:, :1] + np.outer(normals[:, 0], offsets)
    samples[..., 1] = flat[:, 1:] + np.outer(normals[:, 1], offsets)
    distances = plane.distances.sample(samples)
    smallest = distances.min(axis=1) + tie_break * distances[:, len(offsets) // 2]
    return np.asarray(smallest.reshape(pixels.shape[:2]).mean(axis=1), dtype=np.float64)


def register(
    model: Array, start: Array, planes: Sequence[PlaneDistances], config: RegistrationConfig
) -> tuple[Array, tuple[float, ...]]:
    """Rigid motion that brings the model onto the lines in all planes: translation first, then all six.

    Args:
        model: (L, 3) model points at the reference, world metres.
        start: (4, 4) motion of the pair before.
        planes: the planes.
        config: steps, reach and tie-break.

    Returns:
        The motion (4, 4) and, per plane, eq. (3)'s mean distance there in pixels.
    """
    centre = model.mean(axis=0) @ start[:3, :3].T + start[:3, 3]

    def motions(parameters: Array) -> Array:
        return np.stack([rigid(p[3:], p[:3], centre) @ start for p in parameters])

    def cost(parameters: Array) -> Array:
        candidates = motions(parameters)
        reach, tie_break = config.normal_search_px, config.tie_break
        costs = [normal_search_cost(model, candidates, plane, reach, tie_break) for plane in planes]
        return np.asarray(np.sum(costs, axis=0))

    steps = np.array([config.translation_step_mm * 1e-3] * 3 + [np.radians(config.rotation_step_deg)] * 3)
    parameters = best_neighbour(cost, np.zeros(6), steps, config.smallest_step, free=3)
    parameters = best_neighbour(cost, parameters, steps, config.smallest_step, free=6)
    motion = motions(parameters[None])
    residuals = tuple(float(normal_search_cost(model, motion, p, config.normal_search_px)[0]) for p in planes)
    return np.asarray(motion[0]), residuals


def best_neighbour(
    cost: Callable[[Array], Array], start: Array, steps: Array, smallest_step: float, free: int
) -> Array:
    """Move to the best of the neighbours one step away along each free parameter; halve the steps when none is better.

    Args:
        cost: function of (K, n) parameters giving (K,) costs.
        start: (n,) first parameters.
        steps: (n,) first step of each parameter.
        smallest_step: the search ends once the steps are below this fraction of the first.
        free: only the first `free` parameters move.
    """
    directions = np.vstack([np.diag(steps)[:free], -np.diag(steps)[:free]])
    best, fraction = start, 1.0
    best_cost = float(cost(best[None])[0])
    for _ in range(LARGEST_NUMBER_OF_MOVES):
        if fraction < smallest_step:
            break
        neighbours = best + fraction * directions
        costs = cost(neighbours)
        lowest = int(np.argmin(costs))
        if costs[lowest] < best_cost:
            best, best_cost = neighbours[lowest], float(costs[lowest])
        else:
            fraction /= 2.0
    return best
