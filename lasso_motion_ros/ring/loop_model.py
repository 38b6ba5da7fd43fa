"""The 3-D model of the loop: a curve in space, and by how much each plane's images lie off its calibration.

A real loop is no ellipse: it is open or overlaps itself, is slightly helical and bulges.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.motion.motion_model import Observation

Array = npt.NDArray[np.float64]

# Of what others show of the motion between the planes' exposures: mostly the calibration's error.
BETWEEN_SIGMA_M = 0.0005


@dataclass(frozen=True, eq=False)
class LoopModel:
    """The loop at the seed pair.

    Attributes:
        points: (L, 3) along the loop from end to end, evenly spaced, world metres.
        centre: (3,) centre of the circle nearest to the points, world metres: where the ring tilts and stretches
            about. (The points' mean lies nearer to where an overlapping loop is double.)
        bright: True where the catheter is brighter than its background.
        offsets: per plane, (2,) metres at the ring, along the image's rows and columns, by which it lies off its
            calibration (and, where plane B is exposed later, off plane A's phase): a place of source and detector, so
            that it stays what it is when the gantry turns or the read-out changes.
        between: what the pair shows of the loop's motion between the planes' exposures; None if exposed together.
        depth_directions: (3,) unit vector of plane A's ray through the centre, along which only plane B sees, and
            (3,) the unit vector along which plane B measures it, across its own ray and the epipolar plane's normal.
        normal: (3,) unit normal of the epipolar plane through the centre.
    """

    points: Array
    centre: Array
    bright: bool
    offsets: dict[Plane, Array]
    between: Observation | None
    depth_directions: tuple[Array, Array]
    normal: Array
    # By plane, the last calibration that was asked for, and the shift: most C-arms stand still.
    _shifts: dict[Plane, tuple[Projection, Array]] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def arms(self) -> Array:
        """(L, 3) the points about the centre, metres."""
        return self.points - self.centre

    def shift(self, plane: Plane, projection: Projection) -> Array:
        """(2,) pixels by which a plane's images lie off a calibration of its: project, then add."""
        known = self._shifts.get(plane)
        if known is None or known[0] is not projection:
            shift = np.asarray(self.offsets[plane] * _pixels_per_metre(projection, self.centre))
            shift.flags.writeable = False
            known = self._shifts[plane] = projection, shift
        return known[1]

    @cached_property
    def radius_mm(self) -> float:
        """Largest distance of a point from the centre, mm."""
        return 1e3 * float(np.linalg.norm(self.arms, axis=1).max())

    @property
    def roundness(self) -> float:
        """Smallest by largest distance of a point from the centre, in the points' plane of least squares."""
        _, _, directions = np.linalg.svd(self.points - self.points.mean(axis=0), full_matrices=False)
        distances = np.linalg.norm(self.arms @ directions[:2].T, axis=1)
        return float(distances.min() / distances.max())

    @cached_property
    def axis(self) -> Array:
        """(3,) unit vector of the ring's axis."""
        return np.asarray(np.linalg.svd(self.arms, full_matrices=False)[2][2])

    @property
    def diameter_mm(self) -> float:
        """Twice the mean distance of the points from the centre, mm."""
        return 2e3 * float(np.linalg.norm(self.arms, axis=1).mean())


def model_along(
    points: Array,
    bright: bool,
    shifts: dict[Plane, Array],
    projections: dict[Plane, Projection],
    *,
    simultaneous: bool,
) -> LoopModel:
    """The model of a curve (L, 3) and the planes' shifts, pixels."""
    views = shifted(projections, shifts)
    centre = circle_centre(points)
    ray_a, ray_b, normal = epipolar_directions(views, centre)
    lateral = np.cross(normal, ray_b)
    between = None if simultaneous else _between(normal, shifts["b"], projections["b"].jacobian(centre))
    offsets = offsets_of(shifts, projections, centre)
    return LoopModel(points, centre, bright, offsets, between, (ray_a, lateral), normal)


def epipolar_directions(projections: Mapping[Plane, Projection], point: Array) -> tuple[Array, Array, Array]:
    """(3,) unit vectors at a world point (3,) m: both planes' rays, A's first, and the epipolar plane's normal."""
    ray_a, ray_b = (point - projections[plane].source for plane in PLANES)
    ray_a, ray_b = ray_a / np.linalg.norm(ray_a), ray_b / np.linalg.norm(ray_b)
    normal = np.cross(ray_a, ray_b)
    return ray_a, ray_b, normal / np.linalg.norm(normal)


def offsets_of(
    shifts: Mapping[Plane, Array], projections: Mapping[Plane, Projection], centre: Array
) -> dict[Plane, Array]:
    """Shifts in pixels of each plane's images as metres at a world point (3,) m."""
    return {plane: shift / _pixels_per_metre(projections[plane], centre) for plane, shift in shifts.items()}


def _pixels_per_metre(projection: Projection, centre: Array) -> Array:
    """(2,) along the image's rows and columns; with unequal binning they differ."""
    return np.array([math.hypot(*row) for row in projection.jacobian(centre).tolist()])


def _between(normal: Array, shift: Array, jacobian: Array) -> Observation:
    """What plane B's shift (2,) px tells of the motion since plane A's exposure: its part along the epipolar normal."""
    px_per_m = jacobian @ normal  # (2,)
    moved_m = shift @ px_per_m / (px_per_m @ px_per_m)
    return Observation(normal[None], np.array([moved_m]), np.array([[BETWEEN_SIGMA_M**2]]))


def circle_centre(points: Array) -> Array:
    """(3,) centre of the circle through points (N, 3), in their plane of least squares (Kåsa's fit)."""
    mean = points.mean(axis=0)
    _, _, directions = np.linalg.svd(points - mean, full_matrices=False)
    flat = (points - mean) @ directions[:2].T
    design = np.column_stack([2.0 * flat, np.ones(len(flat))])
    solution, *_ = np.linalg.lstsq(design, (flat**2).sum(axis=1), rcond=None)
    return np.asarray(mean + solution[:2] @ directions[:2])


def shifted(projections: dict[Plane, Projection], shifts: dict[Plane, Array]) -> dict[Plane, Projection]:
    """Projections as they would have shown images that lie off by shifts, per plane (2,) pixels."""
    return {p: projection.shifted(*shifts[p]) for p, projection in projections.items()}
