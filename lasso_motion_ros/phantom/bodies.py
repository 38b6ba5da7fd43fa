"""Analytic bodies and the exact length of a ray inside them: ellipsoids, flat-ended elliptic cylinders, unions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import apply

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Rays:
    """The rays from one X-ray source through the pixels of one grid.

    Attributes:
        source: (3,) world metres.
        directions: (3, N) unit vectors, row-major over the grid.
        shape: rows and columns of the grid; N is their product.
    """

    source: Array
    directions: Array
    shape: tuple[int, int]


def pixel_rays(projection: Projection) -> Rays:
    """One ray through the centre of every pixel of an image."""
    rows, columns = np.mgrid[0 : projection.height, 0 : projection.width]
    pixels = np.stack([columns.ravel(), rows.ravel()], axis=-1).astype(np.float64)
    directions = np.ascontiguousarray(projection.rays(pixels).T)
    return Rays(projection.source, directions, (projection.height, projection.width))


def covering_grid(projection: Projection, binning: int) -> Projection:
    """The image binned, its last pixels reaching beyond it where its size is no multiple: all of it is covered."""
    width, height = (-(-size // binning) * binning for size in (projection.width, projection.height))
    return projection.cropped(0, 0, width, height).binned(binning, binning)


@dataclass(frozen=True, eq=False)
class Body:
    """A convex body: the image of the unit sphere, or of the unit cylinder |z| ≤ 1, under an affine map.

    Attributes:
        centre: (3,) world metres.
        axes: (3, 3) columns are the semi-axes in world metres (for a cylinder the third is the half-height).
        cylinder: False for an ellipsoid, True for a flat-ended elliptic cylinder.
    """

    centre: Array
    axes: Array
    cylinder: bool = False

    @property
    def bounding_radius(self) -> float:
        """Radius of a sphere about the centre that holds the body, metres."""
        return float(np.linalg.norm(self.axes))

    def interval(self, rays: Rays) -> tuple[Array, Array]:
        """Where each ray enters and leaves: two (N,) arrays in metres from the source; leave ≤ enter where it misses.

        The quadratic is solved about the point of closest approach: at 0.8 m from the source the usual form
        subtracts two nearly equal large numbers for a body of a few millimetres.
        """
        to_unit = np.linalg.inv(self.axes)
        origin = to_unit @ (rays.source - self.centre)
        direction = to_unit @ rays.directions
        if self.cylinder:
            middle, half = _disc_chord(origin[:2], direction[:2])
            with np.errstate(divide="ignore"):
                first, second = (-1.0 - origin[2]) / direction[2], (1.0 - origin[2]) / direction[2]
            enter = np.maximum(middle - half, np.minimum(first, second))
            leave = np.minimum(middle + half, np.maximum(first, second))
            return enter, np.where(half > 0.0, leave, enter)
        middle, half = _disc_chord(origin, direction)
        return middle - half, middle + half

    def chord(self, rays: Rays) -> Array:
        """(N,) length of each ray inside the body, metres."""
        enter, leave = self.interval(rays)
        return np.maximum(leave - enter, 0.0)

    def moved(self, transform: Array) -> Body:
        """The body after a (4, 4) rigid transform."""
        return replace(self, centre=apply(transform, self.centre), axes=transform[:3, :3] @ self.axes)

    def shifted(self, displacement: Array) -> Body:
        """The body after a translation (3,) in metres."""
        return replace(self, centre=self.centre + displacement)

    def scaled(self, factor: float) -> Body:
        """The body grown about its own centre."""
        return replace(self, axes=self.axes * factor)


def ellipsoid(centre_mm: npt.ArrayLike, semi_axes_mm: npt.ArrayLike, rotation: Array | None = None) -> Body:
    """An ellipsoid from millimetres, its axes turned by a (3, 3) rotation."""
    axes = np.diag(np.asarray(semi_axes_mm, dtype=np.float64) * 1e-3)
    return Body(np.asarray(centre_mm, dtype=np.float64) * 1e-3, axes if rotation is None else rotation @ axes)


def cylinder(centre_mm: npt.ArrayLike, semi_axes_mm: npt.ArrayLike, rotation: Array | None = None) -> Body:
    """A flat-ended elliptic cylinder along its third axis, from millimetres."""
    return replace(ellipsoid(centre_mm, semi_axes_mm, rotation), cylinder=True)


def union_length(container: Body, contents: list[Body], rays: Rays) -> tuple[Array, Array]:
    """Length of each ray inside a container, and the part of it inside the union of other bodies.

    Intervals of convex bodies are clipped to the container's, sorted by their start and swept once, so that
    overlapping contents count once.

    Returns:
        Two (N,) arrays, metres.
    """
    enter, leave = container.interval(rays)
    total = np.maximum(leave - enter, 0.0)
    covered = np.zeros_like(total)
    hit = np.flatnonzero(total)
    if not contents or hit.size == 0:
        return total, covered
    inside = Rays(rays.source, np.ascontiguousarray(rays.directions[:, hit]), (1, hit.size))
    enter, leave = enter[hit], leave[hit]
    # Most rays meet few of the bodies: intervals are collected ray by ray, in the order of their starts.
    found: list[tuple[Indices, Array, Array]] = []
    for body in contents:
        near = rays_near(body, inside)
        start, end = body.interval(Rays(inside.source, inside.directions[:, near], (1, near.size)))
        start, end = np.maximum(start, enter[near]), np.minimum(end, leave[near])
        meets = end > start
        found.append((near[meets], start[meets], end[meets]))
    ray, start, end = (np.concatenate(part) for part in zip(*found, strict=True))
    order = np.lexsort((start, ray))
    ray, start, end = ray[order], start[order], end[order]
    first = np.flatnonzero(np.diff(ray, prepend=-1))
    count = np.diff(first, append=ray.size)
    reached, length = enter.copy(), np.zeros(hit.size)
    for rank in range(int(count.max(initial=0))):
        at = first[count > rank] + rank
        of = ray[at]
        length[of] += np.maximum(end[at] - np.maximum(start[at], reached[of]), 0.0)
        reached[of] = np.maximum(reached[of], end[at])
    covered[hit] = length
    return total, covered


def rays_near(body: Body, rays: Rays) -> Indices:
    """Numbers of the rays in the cone round a body's bounding sphere; no other one can meet it."""
    towards = body.centre - rays.source
    distance = float(np.linalg.norm(towards))
    sine = min(1.0, body.bounding_radius / distance)
    return np.flatnonzero(towards @ rays.directions >= distance * np.sqrt(1.0 - sine * sine)).astype(np.int64)


def _disc_chord(origin: Array, direction: Array) -> tuple[Array, Array]:
    """Middle and half length of the chords origin + t·direction through the unit ball; half = 0 for a miss."""
    squared = np.einsum("in,in->n", direction, direction)
    squared = np.where(squared > 0.0, squared, 1e-30)
    middle = -(origin @ direction) / squared
    nearest = direction * middle
    nearest += origin[:, None]
    outside = np.einsum("in,in->n", nearest, nearest)
    return middle, np.sqrt(np.maximum(1.0 - outside, 0.0) / squared)
