"""Rings carried from pair to pair: what does not move with one ring is not it.

By how much a ring has moved until another pair its own electrodes tell: each votes for every way to a point there, and
most agree on one. The points of all pairs, moved back, show the ring's shape better than one pair's, and whether it is
one: chance does not repeat itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.initialisation.nearby_points import LEVELS, Nearby, PointCloud
from lasso_motion_ros.initialisation.shaped_rings import ShapedRings

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How far rings are looked for, and how closely."""

    begun_at: int = 96  # points about a ring of one pair
    followed_at: int = 160  # of all pairs
    begun_sigmas_m: tuple[float, ...] = (1.2e-3, 0.9e-3, 0.6e-3, 0.5e-3)
    carried_sigmas_m: tuple[float, ...] = (0.9e-3, 0.6e-3, 0.5e-3, 0.5e-3)
    faintest: float = 1.8  # of the points that are voted for,
    voted_for: int = 800  # and how many of them at most: the strongest
    strongest: float = 3.0  # that a vote counts
    reach_m: float = 0.02  # from pair to pair
    lift_m: float = 3e-3  # by which a ring's lift changes where plane B is exposed later,
    still_lift_m: float = 0.6e-3  # and where not
    cell_m: float = 1.6e-3
    lift_cell_m: float = 0.8e-3
    dense: int = 3  # cells that are looked at more closely, of each of two grids
    near_m: float = 1e-3  # of a way, within which votes agree
    near_lift_m: float = 0.5e-3
    rounds: int = 2
    # Along either plane's view, where a ring is not: beyond its own width, and nearer than other anatomy.
    aside_m: tuple[float, ...] = (-9e-3, -6e-3, 6e-3, 9e-3)


TUNING = _Tuning()
_NEAR_M = np.array([TUNING.near_m] * 3 + [TUNING.near_lift_m])


def begun(rings: ShapedRings, cloud: PointCloud) -> tuple[ShapedRings, Array]:
    """Rings fitted to one pair's points, and the evidence (N,) of each."""
    nearby = _about(rings, cloud, TUNING.begun_at)
    fitted = rings.fitted(nearby, TUNING.begun_sigmas_m)
    still = np.zeros((len(rings), 4))
    return fitted, fitted.support(nearby).evidence(_by_chance(fitted, [cloud], [still]))


@dataclass(frozen=True, eq=False)
class Carried:
    """Rings of the first of some pairs, and where they are in the others.

    Attributes:
        rings: as all pairs together show them.
        moved: per pair, (N, 4) m by which each has moved until then, and by which its lift has grown.
        evidence: (N,) what all pairs say for each.
    """

    rings: ShapedRings
    moved: tuple[Array, ...]
    evidence: Array

    def __getitem__(self, index: npt.NDArray[np.generic] | slice) -> Carried:
        return Carried(self.rings[index], tuple(one[index] for one in self.moved), self.evidence[index])

    def questioned(self, clouds: Sequence[PointCloud], views: Sequence[Array]) -> Carried:
        """The same with the evidence that is left when the ring is asked for where only one plane can show it.

        A long line in one plane meets a spot of the other at every height: wherever a ring lies along the other plane's
        view, as many points are on it. A ring has its electrodes in one place only.

        Args:
            clouds: the pairs' points.
            views: the planes' unit vectors (3,) of their central rays.
        """
        own = self._nearby(self.rings, clouds)
        is_own = self.rings.support(own).is_on
        beside = np.zeros((len(self.rings), len(LEVELS)))
        for view in views:
            counts = []
            for step in TUNING.aside_m:
                aside = replace(self.rings, centres=self.rings.centres + step * view)
                others = self._nearby(aside, clouds).without(own, is_own)
                counts.append(aside.support(others).counts)
            beside = np.maximum(beside, np.mean(counts, axis=0))
        expected = np.maximum(beside, _by_chance(self.rings, clouds, self.moved))
        return replace(self, evidence=self.rings.support(own).evidence(expected))

    def _nearby(self, rings: ShapedRings, clouds: Sequence[PointCloud]) -> Nearby:
        return _of_all(rings, clouds, self.moved)


def carried(
    rings: ShapedRings, clouds: Sequence[PointCloud], *, is_later: bool, check: Callable[[], None] = lambda: None
) -> Carried:
    """Rings of the first pair, fitted to the points of all pairs.

    Args:
        rings: as the first pair shows them.
        clouds: the pairs' points.
        is_later: whether plane B is exposed later.
        check: called again and again; what it raises ends it.
    """
    first = _about(rings, clouds[0], TUNING.begun_at)
    is_on = rings.support(first).is_on
    moved = [np.zeros((len(rings), 4))]
    lift_m = TUNING.lift_m if is_later else TUNING.still_lift_m
    for cloud in clouds[1:]:
        check()
        # From where it was in the pair before: a breath goes on.
        moved.append(_ways(first, is_on, moved[-1], cloud, lift_m))
    nearby = _of_all(rings, clouds, moved)
    fitted = rings.fitted(nearby, TUNING.carried_sigmas_m)
    return Carried(fitted, tuple(moved), fitted.support(nearby).evidence(_by_chance(fitted, clouds, moved)))


def _of_all(rings: ShapedRings, clouds: Sequence[PointCloud], moved: Sequence[Array]) -> Nearby:
    """All pairs' points about rings, moved back."""
    return Nearby.joined(
        [
            cloud.about(rings.centres, rings.radii, rings.lifts, by, TUNING.followed_at)
            for cloud, by in zip(clouds, moved, strict=True)
        ]
    )


def _by_chance(rings: ShapedRings, clouds: Sequence[PointCloud], moved: Sequence[Array]) -> Array:
    """(N, LEVELS) electrodes that would be on rings if points were everywhere as they are all about them."""
    densities = [cloud.density(rings.centres + by[:, :3], rings.radii) for cloud, by in zip(clouds, moved, strict=True)]
    return np.asarray(np.sum(densities, axis=0) * rings.tubes[:, None])


def _about(rings: ShapedRings, cloud: PointCloud, most: int) -> Nearby:
    return cloud.about(rings.centres, rings.radii, rings.lifts, np.zeros((len(rings), 4)), most)


def _ways(nearby: Nearby, is_on: npt.NDArray[np.bool_], expected: Array, cloud: PointCloud, lift_m: float) -> Array:
    """(N, 4) m by which rings have moved until another pair, and their lift has grown; else as of `_way`.

    Args:
        nearby: the points about rings in the first pair.
        is_on: (N, M) which of them are on the rings.
        expected: (N, 4) about which is looked.
        cloud: the other pair's points.
        lift_m: by which the lift may have changed.
    """
    if not has_kernels():
        ways = [_way(nearby, k, which, expected[k], cloud, lift_m) for k, which in enumerate(is_on)]
        return np.array(ways).reshape(len(is_on), 4)
    from lasso_motion_ros.initialisation import point_kernels

    found, points = np.empty((len(is_on), 4)), cloud.points
    bounds, cells, size = _cells(lift_m)
    point_kernels.ways(
        nearby.places,
        nearby.lifts,
        nearby.strengths,
        is_on,
        np.ascontiguousarray(expected),
        points.places,
        points.lifts,
        points.strengths,
        TUNING.faintest,
        TUNING.voted_for,
        TUNING.strongest,
        bounds,
        cells,
        size,
        TUNING.dense,
        _NEAR_M,
        TUNING.rounds,
        found,
    )
    return found


def _cells(lift_m: float) -> tuple[Array, Array, npt.NDArray[np.intp]]:
    """(4,) m within which ways are looked for, (4,) m of a cell of them, and (4,) how many cells there are."""
    bounds = np.array([TUNING.reach_m] * 3 + [lift_m])
    cells = np.array([TUNING.cell_m] * 3 + [TUNING.lift_cell_m])
    return bounds, cells, np.ceil(2.0 * bounds / cells).astype(np.intp) + 2


def _way(
    nearby: Nearby, ring: int, which: npt.NDArray[np.bool_], expected: Array, cloud: PointCloud, lift_m: float
) -> Array:
    """(4,) m by which a ring has moved until another pair, and its lift has grown; as expected where nothing tells.

    Args:
        nearby: the points about rings in the first pair.
        ring: which of them.
        which: (M,) of the points, those on the ring.
        expected: about which is looked.
        cloud: the other pair's points.
        lift_m: by which the lift may have changed.
    """
    places, lifts = nearby.places[ring][which], nearby.lifts[ring][which]
    strengths = np.minimum(nearby.strengths[ring][which], TUNING.strongest)
    if not len(lifts):
        return expected
    middle = places.mean(axis=0)
    reach = TUNING.reach_m + float(np.linalg.norm(places - middle, axis=1).max())
    near = cloud.strongest_within(middle + expected[:3], reach, faintest=TUNING.faintest, most=TUNING.voted_for)
    there = np.concatenate([cloud.points.places[near], cloud.points.lifts[near, None]], axis=1)
    here = np.concatenate([places, lifts[:, None]], axis=1)
    ways = (there[:, None] - here).reshape(-1, 4) - expected
    votes = np.minimum(cloud.points.strengths[near][:, None], strengths).reshape(-1)
    bounds, cells, size = _cells(lift_m)
    is_possible = np.logical_and.reduce([np.abs(way) < bound for way, bound in zip(ways.T, bounds, strict=True)])
    ways, votes = ways[is_possible], votes[is_possible]
    if not len(votes):
        return expected
    electrode = np.tile(np.arange(len(lifts)), len(near))[is_possible]
    found, agreed = _refined(_dense_ways(ways, votes, bounds, cells, size), ways, votes, electrode)
    return np.asarray(expected + found[int(agreed.argmax())])


def _dense_ways(ways: Array, votes: Array, bounds: Array, cells: Array, size: npt.NDArray[np.intp]) -> Array:
    """(K, 4) about where most votes (N,) for ways (N, 4) lie close together; the rest as of `_cells`."""
    found = []
    for shift in (0.0, 0.5):  # what lies on the border of one cell lies within another
        at = ((ways + bounds) / cells + shift).astype(np.intp)
        used, of_cell = np.unique(np.ravel_multi_index(tuple(at.T), tuple(size)), return_inverse=True)
        counts = np.bincount(of_cell, weights=votes)
        for cell in used[np.argsort(-counts, kind="stable")[: TUNING.dense]]:
            place = np.array(np.unravel_index(int(cell), size), np.float64)
            found.append((place + 0.5 - shift) * cells - bounds)
    return np.array(found)


def _refined(found: Array, ways: Array, votes: Array, electrode: npt.NDArray[np.intp]) -> tuple[Array, Array]:
    """(K, 4) some ways as the votes about each have it, and (K,) how much those are, each electrode's most only."""
    ways, found = ways / _NEAR_M, found / _NEAR_M
    squared = np.einsum("ni,ni->n", ways, ways)

    def is_near() -> npt.NDArray[np.bool_]:  # (N, K)
        away = squared[:, None] - 2.0 * (ways @ found.T) + np.einsum("ki,ki->k", found, found)
        return np.asarray(away < 1.0)

    for _ in range(TUNING.rounds):
        weights = is_near() * votes[:, None]
        total = weights.sum(axis=0)[:, None]
        found = np.where(total > 0.0, (weights.T @ ways) / np.maximum(total, 1e-9), found)
    most = np.zeros((len(found), int(electrode.max()) + 1))
    vote, which = np.nonzero(is_near())
    np.maximum.at(most, (which, electrode[vote]), votes[vote])
    return found * _NEAR_M, most.sum(axis=1)
