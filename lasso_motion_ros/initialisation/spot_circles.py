"""Circles through three electrodes that both planes show, and along how much of a circle both planes show spots."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.initialisation.circles import POINTS, SHARES, Circles, highest, laid
from lasso_motion_ros.initialisation.electrode_spots import ElectrodePoints, Indices, Spots
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid
from lasso_motion_ros.initialisation.laid_image import CELL_M

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.float32]


@dataclass(frozen=True)
class _Tuning:
    """Which triples are tried."""

    faintest: float = 1.8  # of the points
    strong: int = 4000  # of them at most: the strongest
    begun_with: int = 240  # the strongest,
    neighbours: int = 24  # each with the strongest in reach
    nearest_m: float = 2.5e-3  # of two electrodes
    lift_m: float = 0.6e-3  # by which points of one ring differ
    radii_m: tuple[float, float] = (5.5e-3, 17.5e-3)
    thinnest_m2: float = 1e-8  # of the parallelogram that three points span: with less they lie on a line
    # Spots beside a circle, as far as rings go from circles.
    widened_cells: int = 5
    strongest: float = 3.0
    sectors: int = 12
    kept: int = 80
    same_m: float = 3e-3
    same_cosine: float = 0.9


TUNING = _Tuning()


def circles_of_spots(points: ElectrodePoints, spots: Mapping[Plane, Spots], grid: EpipolarGrid) -> Circles:
    """The circles through triples of electrodes along which both planes show most spots, distinct, best first.

    Args:
        points: where both planes show a spot.
        spots: both planes'.
        grid: on which they lie.
    """
    circles = _through_triples(points)
    return spotted(circles, spots, grid).distinct(TUNING.kept, TUNING.same_m, TUNING.same_cosine)


def spotted(circles: Circles, spots: Mapping[Plane, Spots], grid: EpipolarGrid) -> Circles:
    """The circles with what both planes show of spots along them: of each sector the most, mean of all; 3 at most."""
    if has_kernels():
        both = _shown_along(circles, spots, grid)
    else:
        both = np.minimum(*(_shown(circles, spots[plane], plane, grid) for plane in PLANES))
    in_sector = POINTS // TUNING.sectors
    most = np.maximum.reduce([both[:, place::in_sector] for place in range(in_sector)])
    scores = np.asarray(most.mean(axis=1), np.float64)
    return Circles(circles.centres, circles.normals, circles.radii, circles.lifts, scores)


def _shown(circles: Circles, spots: Spots, plane: Plane, grid: EpipolarGrid) -> Image:
    """(N, POINTS) the spots that a plane shows along circles."""
    image, left, top = _spot_map(spots)
    columns, rows = laid(circles, plane, grid)
    x, y = (np.rint((at - start) / (CELL_M)).astype(np.intp) for at, start in ((columns, left), (rows, top)))
    height, width = image.shape
    is_inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
    return np.where(is_inside, image[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)], np.float32(0.0))


def _shown_along(circles: Circles, spots: Mapping[Plane, Spots], grid: EpipolarGrid) -> Image:
    """(N, POINTS) the spots that both planes show along circles, compiled."""
    from lasso_motion_ros.initialisation import spot_kernels

    axes = np.ascontiguousarray(circles.axes)
    both = np.full((len(circles), POINTS), np.float32(np.inf))
    for plane in PLANES:
        lifts = np.ascontiguousarray(circles.lifts) if plane == "b" else np.zeros(len(circles))
        image, left, top = _spot_map(spots[plane])
        seen = grid.asked(plane), SHARES, grid.distance(plane), grid.lever
        spot_kernels.spots_along(axes, lifts, *seen, image, left, top, CELL_M, both)
    return both


def _through_triples(points: ElectrodePoints) -> Circles:
    """The circle through each of the strongest points and two of its neighbours."""
    strong = np.flatnonzero(points.strengths >= TUNING.faintest)
    strong = strong[highest(points.strengths[strong], TUNING.strong)]
    places, lifts = points.places[strong], points.lifts[strong]
    if has_kernels():
        from lasso_motion_ros.initialisation import spot_kernels

        bounds = TUNING.nearest_m**2, (2.0 * TUNING.radii_m[1]) ** 2, TUNING.lift_m, TUNING.thinnest_m2
        begun = min(TUNING.begun_with, len(places))
        found = spot_kernels.through_triples(places, lifts, begun, TUNING.neighbours, *bounds, *TUNING.radii_m)
        return Circles(found[:, :3], found[:, 3:6], found[:, 6], found[:, 7], np.zeros(len(found)))
    first, second, third = _triples(places, lifts)
    u, v = places[second] - places[first], places[third] - places[first]
    middle, normals, is_open = _circumcircles(u, v)
    radii = np.sqrt(np.einsum("ni,ni->n", middle, middle))
    smallest, largest = TUNING.radii_m
    is_ring = is_open & (radii > smallest) & (radii < largest)
    lifted = (lifts[first] + lifts[second] + lifts[third]) / 3.0
    count = int(is_ring.sum())
    return Circles(
        (places[first] + middle)[is_ring], normals[is_ring], radii[is_ring], lifted[is_ring], np.zeros(count)
    )


def _triples(places: Array, lifts: Array) -> Indices:
    """(3, T) which of some points (N, 3), strongest first, can be on a ring together, however large.

    Each of the strongest, and two of the strongest that can be on a ring with it.
    """
    begun = min(TUNING.begun_with, len(places))
    nearest_m2, farthest_m2 = TUNING.nearest_m**2, (2.0 * TUNING.radii_m[1]) ** 2
    found = [np.zeros((3, 0), np.intp)]
    for k in range(begun):
        away = places - places[k]
        squared = np.einsum("ni,ni->n", away, away)
        is_near = (squared > nearest_m2) & (squared < farthest_m2) & (np.abs(lifts - lifts[k]) < TUNING.lift_m)
        near = np.flatnonzero(is_near)[: TUNING.neighbours]
        one, other = np.triu_indices(len(near), 1)
        found.append(np.stack([np.full(len(one), k), near[one], near[other]]))
    triples = np.concatenate(found, axis=1)
    # Two neighbours have to be as far apart, and as like in their lift, as either and the point that was begun with.
    _, second, third = triples
    apart = places[third] - places[second]
    is_triple = np.einsum("ni,ni->n", apart, apart) > nearest_m2
    return triples[:, is_triple & (np.abs(lifts[second] - lifts[third]) < TUNING.lift_m)]


def _circumcircles(u: Array, v: Array) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    """The circles through the origin and two points (N, 3) each: centres, unit normals, and whether there is one."""
    # The two vectors' products give all of it, without a cross product but for the normal.
    uu, vv, uv = (np.einsum("ni,ni->n", one, other) for one, other in ((u, u), (v, v), (u, v)))
    squared = uu * vv - uv * uv  # of the parallelogram's area
    is_open = squared > TUNING.thinnest_m2**2
    squared = np.where(is_open, squared, 1.0)
    share_u, share_v = vv * (uu - uv), uu * (vv - uv)
    middle = (share_u[:, None] * u + share_v[:, None] * v) / (2.0 * squared)[:, None]
    (ux, uy, uz), (vx, vy, vz) = u.T, v.T
    across = np.stack([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx], axis=1)
    return middle, across / np.sqrt(squared)[:, None], is_open


def _spot_map(spots: Spots) -> tuple[Image, float, float]:
    """(H, W) the strongest spot about each cell, 0 where there is none, and the first column and row, metres."""
    if not len(spots.rows):
        return np.zeros((1, 1), np.float32), 0.0, 0.0
    left, top = float(spots.columns.min()), float(spots.rows.min())
    x, y = (np.rint((at - start) / CELL_M).astype(np.intp) for at, start in ((spots.columns, left), (spots.rows, top)))
    image = np.zeros((int(y.max()) + 1, int(x.max()) + 1), np.float32)
    np.maximum.at(image, (y, x), np.minimum(spots.strengths, TUNING.strongest).astype(np.float32))
    around = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (TUNING.widened_cells, TUNING.widened_cells))
    return np.asarray(cv2.dilate(image, around)), left, top
