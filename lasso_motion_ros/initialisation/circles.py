"""Circles in space through what both planes show as electrodes, and what the planes' lines say of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid
from lasso_motion_ros.initialisation.line_maps import CELL_MM, DIRECTIONS, Image, LineMaps

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """Which circles are tried, and how many are refined."""

    spots: int = 100  # of a plane, the most distinct
    row_tolerance_m: float = 1.2e-3  # by which both planes' heights of an electrode may differ
    fastest_m_s: float = 0.03  # of breathing: where plane B is exposed later the ring may have moved up or down by then
    lift_step_m: float = 1.5e-3
    largest_lift_m: float = 5e-3
    smallest_radius_m: float = 6e-3
    largest_radius_m: float = 16.5e-3
    smallest_chord_m: float = 4e-3
    most: int = 24_000  # circles that are looked at
    kept: int = 2_000  # after a first glance at every third point
    points: int = 36
    stronger_share: float = 0.3
    same_centre_m: float = 3e-3
    same_cosine: float = 0.85
    refined: int = 30
    rounds: tuple[float, ...] = (1.0, 0.6, 0.35, 0.2)  # of the steps below, one after another
    tries: int = 40
    step_m: float = 1.2e-3
    step_rad: float = 0.17
    step_log: float = 0.08


TUNING = _Tuning()
_TURN = 2.0 * np.pi * np.arange(TUNING.points) / TUNING.points


@dataclass(frozen=True, eq=False)
class Circles:
    """Some circles in space.

    Attributes:
        centres: (N, 3) m.
        normals: (N, 3) unit vectors.
        radii: (N,) m.
        lifts: (N,) m by which plane B sees each higher than plane A.
        scores: (N,) what both planes show along each; 1.3 at most.
    """

    centres: Array
    normals: Array
    radii: Array
    lifts: Array
    scores: Array

    def __len__(self) -> int:
        return len(self.radii)

    def __getitem__(self, index: npt.NDArray[np.generic] | slice) -> Circles:
        return Circles(
            self.centres[index], self.normals[index], self.radii[index], self.lifts[index], self.scores[index]
        )

    def points(self, turns: Array = _TURN) -> Array:
        """(N, P, 3) points at angles (P,)."""
        return np.asarray(
            self.centres[:, None]
            + self.radii[:, None, None]
            * (np.cos(turns)[:, None] * self._axes[0][:, None] + np.sin(turns)[:, None] * self._axes[1][:, None])
        )

    @property
    def _axes(self) -> tuple[Array, Array]:
        helper = np.where(np.abs(self.normals[:, :1]) < 0.8, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
        first = np.cross(self.normals, helper)
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        return first, np.cross(self.normals, first)


def find_circles(maps: Mapping[Plane, LineMaps], grid: EpipolarGrid, between_s: float) -> Circles:
    """The best circles, refined and distinct, best first.

    Args:
        maps: both planes'.
        grid: on which they are laid out.
        between_s: from plane A's exposure to plane B's.
    """
    lines = {plane: np.stack([_widened(one) for one in maps[plane].responses]) for plane in PLANES}
    random = np.random.default_rng(0)
    spots = {plane: _spots(maps[plane]) for plane in PLANES}
    largest = min(TUNING.largest_lift_m, TUNING.fastest_m_s * abs(between_s))
    count = (
        int(np.ceil((largest - TUNING.row_tolerance_m) / TUNING.lift_step_m)) if largest > TUNING.row_tolerance_m else 0
    )
    lifts = TUNING.lift_step_m * np.arange(-count, count + 1)
    parts = [_through_spots(spots, grid, float(lift), TUNING.most // len(lifts), random) for lift in lifts]
    circles = _joined(parts)
    if not len(circles):
        return circles
    glance = _scored(circles, lines, maps, grid, slice(None, None, 3))
    circles = glance[np.argsort(-glance.scores, kind="stable")[: TUNING.kept]]
    circles = _distinct(_scored(circles, lines, maps, grid), TUNING.refined)
    for size in TUNING.rounds:
        circles = _improved(circles, lines, maps, grid, size, random)
    return _distinct(circles, TUNING.refined)


def _widened(one: Image) -> Image:
    return np.asarray(cv2.dilate(one, np.ones((3, 3), np.uint8)))


def _spots(maps: LineMaps) -> Array:
    """(N, 2) columns and rows, metres, of a plane's most distinct spots."""
    is_peak = (maps.spots >= _widened(maps.spots)) & (maps.spots > 0.3)
    places = np.argwhere(is_peak)
    order = np.argsort(-maps.spots[is_peak], kind="stable")[: TUNING.spots]
    return np.asarray(places[order][:, ::-1] * (1e-3 * CELL_MM) + (maps.left, maps.top))


def _through_spots(
    spots: Mapping[Plane, Array], grid: EpipolarGrid, lift: float, most: int, random: np.random.Generator
) -> Circles:
    """Circles through three electrodes each, of spots that both planes show at one height."""
    a, b = spots["a"], spots["b"]
    i, j = np.nonzero(np.abs(a[:, None, 1] - b[None, :, 1] + lift) < TUNING.row_tolerance_m)
    if len(i) < 3:
        return _none()
    points = grid.places({"a": a[i, 0], "b": b[j, 0]}, 0.5 * (a[i, 1] + b[j, 1] - lift))
    distance = np.linalg.norm(points[:, None] - points, axis=2)
    near = (distance < 2.0 * TUNING.largest_radius_m) & (distance > TUNING.smallest_chord_m)
    # One spot is one electrode.
    near &= (i[:, None] != i) & (j[:, None] != j)
    near = np.triu(near)
    triples = []
    for first in range(len(points)):
        beside = np.flatnonzero(near[first])
        second, third = np.nonzero(near[np.ix_(beside, beside)])
        triples.append(np.stack([np.full(len(second), first), beside[second], beside[third]], axis=1))
    chosen = np.concatenate(triples)
    if len(chosen) > 4 * most:
        chosen = chosen[random.permutation(len(chosen))[: 4 * most]]
    first, second, third = (points[chosen[:, k]] for k in range(3))
    u, v = second - first, third - first
    across = np.cross(u, v)
    square = np.maximum((across**2).sum(axis=1, keepdims=True), 1e-20)
    towards = (u**2).sum(axis=1, keepdims=True) * v - (v**2).sum(axis=1, keepdims=True) * u
    arms = np.cross(towards, across) / (2.0 * square)
    radii = np.linalg.norm(arms, axis=1)
    good = np.flatnonzero((radii > TUNING.smallest_radius_m) & (radii < TUNING.largest_radius_m))[:most]
    return Circles(
        (first + arms)[good],
        (across / np.sqrt(square))[good],
        radii[good],
        np.full(len(good), lift),
        np.zeros(len(good)),
    )


def _scored(
    circles: Circles,
    lines: Mapping[Plane, Image],
    maps: Mapping[Plane, LineMaps],
    grid: EpipolarGrid,
    part: slice = slice(None),
) -> Circles:
    """The circles with the mean response to lines along them: the weaker plane's above all."""
    points = circles.points()
    means = []
    for plane in PLANES:
        columns, rows = grid.lay(plane, points)
        if plane == "b":
            rows = rows + circles.lifts[:, None]
        slopes = (
            np.roll(rows, -1, axis=1) - np.roll(rows, 1, axis=1),
            np.roll(columns, -1, axis=1) - np.roll(columns, 1, axis=1),
        )
        direction = np.rint(np.arctan2(*slopes) * (DIRECTIONS / np.pi)).astype(np.intp)[:, part] % DIRECTIONS
        x = np.rint((columns[:, part] - maps[plane].left) / (1e-3 * CELL_MM)).astype(np.intp)
        y = np.rint((rows[:, part] - maps[plane].top) / (1e-3 * CELL_MM)).astype(np.intp)
        _, height, width = lines[plane].shape
        inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
        values = lines[plane][direction, np.where(inside, y, 0), np.where(inside, x, 0)]
        means.append(np.where(inside, values, 0.0).mean(axis=1))
    scores = np.minimum(*means) + TUNING.stronger_share * np.maximum(*means)
    return Circles(circles.centres, circles.normals, circles.radii, circles.lifts, np.asarray(scores, np.float64))


def _improved(
    circles: Circles,
    lines: Mapping[Plane, Image],
    maps: Mapping[Plane, LineMaps],
    grid: EpipolarGrid,
    size: float,
    random: np.random.Generator,
) -> Circles:
    """Each circle, or the best of some about it."""
    count, tries = len(circles), TUNING.tries
    step = size * random.standard_normal((count, tries, 8))
    step[:, 0] = 0.0
    normals = circles.normals[:, None] + TUNING.step_rad * step[..., 3:6]
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    lifts = circles.lifts[:, None] + 0.5 * TUNING.step_m * step[..., 7]
    about = Circles(
        (circles.centres[:, None] + TUNING.step_m * step[..., :3]).reshape(-1, 3),
        normals.reshape(-1, 3),
        np.clip(
            circles.radii[:, None] * np.exp(TUNING.step_log * step[..., 6]),
            TUNING.smallest_radius_m,
            TUNING.largest_radius_m,
        ).reshape(-1),
        np.clip(lifts, -TUNING.largest_lift_m, TUNING.largest_lift_m).reshape(-1),
        np.zeros(count * tries),
    )
    about = _scored(about, lines, maps, grid)
    best = about.scores.reshape(count, tries).argmax(axis=1) + tries * np.arange(count)
    return about[best]


def _distinct(circles: Circles, count: int) -> Circles:
    """The best that are not about the same, best first."""
    chosen: list[int] = []
    for k in np.argsort(-circles.scores, kind="stable"):
        if chosen:
            near = np.linalg.norm(circles.centres[chosen] - circles.centres[k], axis=1) < TUNING.same_centre_m
            if (near & (np.abs(circles.normals[chosen] @ circles.normals[k]) > TUNING.same_cosine)).any():
                continue
        chosen.append(int(k))
        if len(chosen) == count:
            break
    return circles[np.array(chosen, dtype=np.intp)]


def _joined(parts: list[Circles]) -> Circles:
    return Circles(
        np.concatenate([one.centres for one in parts]),
        np.concatenate([one.normals for one in parts]),
        np.concatenate([one.radii for one in parts]),
        np.concatenate([one.lifts for one in parts]),
        np.concatenate([one.scores for one in parts]),
    )


def _none() -> Circles:
    return Circles(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0))
