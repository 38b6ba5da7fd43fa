"""The points about each of many rings, side by side in one array, of one pair or of several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.initialisation.electrode_spots import ElectrodePoints, Indices

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """Which points are a ring's neighbours."""

    reach_m: float = 3e-3  # from a ring's circle
    lift_m: float = 0.8e-3
    surroundings_m: float = 12e-3  # beyond a ring, from which it is told how many points are there by chance
    cells: int = 48  # along each axis; what lies beyond them is in the outermost
    cell_m: float = 5e-3
    levels: tuple[float, ...] = (1.5, 2.0, 2.5, 3.0)  # of strength, at each of which points are counted


TUNING = _Tuning()
_Number = TypeVar("_Number", np.float64, np.intp)
LEVELS = np.array(TUNING.levels)
_BLOCK = 4096  # points that are looked at together
_A_PAIRS_SPOTS = 1 << 24  # more than a plane shows


@dataclass(frozen=True, eq=False)
class Nearby:
    """The points about each of N rings, M of them at most.

    Attributes:
        places: (N, M, 3) world metres.
        lifts: (N, M) m.
        strengths: (N, M); 0 where there is no more point.
        spots: (N, M, 2) which of the planes' spots each is; pairs' spots have numbers of their own.
    """

    places: Array
    lifts: Array
    strengths: Array
    spots: Indices

    @classmethod
    def joined(cls, pairs: Sequence[Nearby]) -> Nearby:
        """The points of several pairs about the same rings."""
        return cls(
            np.concatenate([one.places for one in pairs], axis=1),
            np.concatenate([one.lifts for one in pairs], axis=1),
            np.concatenate([one.strengths for one in pairs], axis=1),
            np.concatenate([one.spots + number * _A_PAIRS_SPOTS for number, one in enumerate(pairs)], axis=1),
        )

    def without(self, own: Nearby, is_own: npt.NDArray[np.bool_]) -> Nearby:
        """The same without the points that two spots of a ring's own make, whichever two.

        Args:
            own: points about the same rings and of the same pairs.
            is_own: (N, M) which of those are the rings' own.
        """
        strengths = self.strengths.copy()
        if has_kernels():
            from lasso_motion_ros.initialisation import point_kernels

            point_kernels.without(self.spots, own.spots, is_own, strengths)
            return replace(self, strengths=strengths)
        for k, which in enumerate(is_own):
            # Compared one by one: a ring has few spots of its own.
            taken = (self.spots[k][:, None] == own.spots[k, which]).any(axis=1)  # (M, 2)
            strengths[k, taken.all(axis=1)] = 0.0
        return replace(self, strengths=strengths)


class PointCloud:
    """All points of one pair, to be asked for those about rings.

    Args:
        points: the pair's.
        largest_lift_m: that they have.

    Attributes:
        points: the same, the strongest first.
    """

    def __init__(self, points: ElectrodePoints, largest_lift_m: float) -> None:
        self.points = points[np.argsort(-points.strengths, kind="stable")]
        self._lifts_m = 2.0 * largest_lift_m

    @cached_property
    def _tree(self) -> cKDTree:
        return _tree_of(self.points.places)

    @cached_property
    def _trees(self) -> list[cKDTree | None]:
        """Of the points as strong as each level."""
        strong = [self.points.places[self.points.strengths >= level] for level in LEVELS]
        return [_tree_of(one) if len(one) else None for one in strong]

    @cached_property
    def _cells(self) -> tuple[Array, float, int, Indices, Indices]:
        """Where the first cell begins, a cell's side, how many there are along each axis, and the points in each."""
        from lasso_motion_ros.initialisation import point_kernels

        places, count = self.points.places, TUNING.cells
        middle = np.median(places, axis=0) if len(places) else np.zeros(3)
        low = np.asarray(middle - 0.5 * count * TUNING.cell_m)
        starts, order = np.empty(count**3 + 1, np.int64), np.empty(len(places), np.int64)
        point_kernels.sorted_into_cells(places, low, TUNING.cell_m, count, starts, order)
        return low, TUNING.cell_m, count, starts, order

    @cached_property
    def _ends(self) -> Indices:
        """(LEVELS,) how many points are as strong as each level."""
        return np.searchsorted(-self.points.strengths, -LEVELS, side="right")

    def within(self, centres: Array, radii: Array) -> list[list[int]]:
        """The points in each of some spheres (N, 3), (N,)."""
        if not len(self.points):
            return [[] for _ in centres]
        return list(self._tree.query_ball_point(centres, radii))

    def strongest_within(self, centre: Array, radius_m: float, *, faintest: float, most: int) -> Indices:
        """The strongest points in a sphere about a place (3,) m, strongest first.

        Args:
            centre: of the sphere.
            radius_m: of it.
            faintest: that a point may be.
            most: how many at most.
        """
        end = int(np.searchsorted(-self.points.strengths, -faintest, side="right"))
        found, count = [np.zeros(0, np.intp)], 0
        for start in range(0, end, _BLOCK):
            away = self.points.places[start : min(start + _BLOCK, end)] - centre
            found.append(start + np.flatnonzero(np.einsum("ni,ni->n", away, away) <= radius_m**2))
            count += len(found[-1])
            if count >= most:
                break
        return np.concatenate(found)[:most]

    def about(self, centres: Array, radii: Array, lifts: Array, moved: Array, most: int) -> Nearby:
        """The points about rings, moved back by as much as the rings have moved until then.

        Args:
            centres: (N, 3) m of the rings before.
            radii: (N,) m.
            lifts: (N,) m before.
            moved: (N, 4) m by which each has moved until then, and by which its lift has grown.
            most: how many of each at most: the strongest.
        """
        if has_kernels():
            return self._about_by_cells(centres, radii, lifts, moved, most)
        points, there, lifted = self.points, centres + moved[:, :3], lifts + moved[:, 3]
        some, ring = self._about(there, radii, lifted)
        column = np.arange(len(ring)) - np.searchsorted(ring, ring)
        some, ring, column = (one[column < most] for one in (some, ring, column))

        def table(values: npt.NDArray[_Number]) -> npt.NDArray[_Number]:
            laid = np.zeros((len(centres), most, *values.shape[1:]), values.dtype)
            laid[ring, column] = values[some]
            return laid

        return Nearby(
            table(points.places) - moved[:, None, :3],
            table(points.lifts) - moved[:, None, 3],
            table(points.strengths),
            table(points.spots),
        )

    def _about_by_cells(self, centres: Array, radii: Array, lifts: Array, moved: Array, most: int) -> Nearby:
        """As `about`, compiled."""
        from lasso_motion_ros.initialisation import point_kernels

        points, shape = self.points, (len(centres), most)
        low, side_m, count, starts, order = self._cells
        nearby = Nearby(
            np.zeros((*shape, 3)), np.zeros(shape), np.zeros(shape), np.zeros((*shape, 2), points.spots.dtype)
        )
        point_kernels.about(
            points.places,
            points.lifts,
            points.strengths,
            points.spots,
            low,
            side_m,
            count,
            starts,
            order,
            np.ascontiguousarray(centres),
            np.ascontiguousarray(radii),
            np.ascontiguousarray(lifts),
            np.ascontiguousarray(moved),
            TUNING.reach_m,
            TUNING.lift_m,
            nearby.places,
            nearby.lifts,
            nearby.strengths,
            nearby.spots,
        )
        return nearby

    def _about(self, there: Array, radii: Array, lifted: Array) -> tuple[Indices, Indices]:
        """Which points are about rings (N, 3), (N,), (N,), ring by ring, the strongest first; and which ring's."""
        points = self.points
        numbers = self.within(there, radii + TUNING.reach_m)
        some = np.concatenate([np.asarray(one, np.intp) for one in (*numbers, [])])
        ring = np.repeat(np.arange(len(there)), [len(one) for one in numbers])
        away = points.places[some] - there[ring]
        squared = np.einsum("ni,ni->n", away, away)
        is_near = (squared > np.square(radii[ring] - TUNING.reach_m)) & (
            np.abs(points.lifts[some] - lifted[ring]) < TUNING.lift_m
        )
        some, ring = some[is_near], ring[is_near]
        order = np.lexsort((some, ring))
        return some[order], ring[order]

    def density(self, centres: Array, radii: Array) -> Array:
        """(N, LEVELS) points per m³ of space and m of lift as strong as each level about rings (N, 3), (N,).

        Of one point at least, since there may be one.
        """
        spheres = radii + TUNING.surroundings_m
        volume = 4.0 / 3.0 * np.pi * spheres**3 * self._lifts_m
        if has_kernels():
            from lasso_motion_ros.initialisation import point_kernels

            number = np.zeros((len(centres), len(LEVELS)), np.int64)
            around = np.ascontiguousarray(centres), np.ascontiguousarray(spheres), number
            point_kernels.counted(self.points.places, self._ends, *self._cells, *around)
            return np.asarray(np.maximum(number, 1.0) / volume[:, None])
        counts = [
            np.ones(len(centres)) if tree is None else tree.query_ball_point(centres, spheres, return_length=True)
            for tree in self._trees
        ]
        return np.asarray(np.maximum(np.stack(counts, axis=1), 1.0) / volume[:, None])


def _tree_of(places: Array) -> cKDTree:
    """A tree of places (M, 3) that is asked a few hundred times: it is made in less than half of the usual time."""
    return cKDTree(places, compact_nodes=False, balanced_tree=False)
