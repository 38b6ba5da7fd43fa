"""Circles in space, many at a time, and where the planes' grids show them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.directions import axes_across
from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.initialisation.direction_maps import tangents
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

POINTS = 36  # along a circle: 2 mm apart, as long as a line filter
_BLOCK = 128
NARROW_M = 3e-3  # from the middle to either side, of a circle as a plane shows it
TURN = 2.0 * np.pi * np.arange(POINTS) / POINTS
SHARES = np.stack([np.ones(POINTS), np.cos(TURN), np.sin(TURN)])  # of the centre and two axes in a circle's points


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
        return Circles(*(getattr(self, one.name)[index] for one in fields(self)))

    @classmethod
    def joined(cls, parts: Sequence[Circles]) -> Circles:
        """All circles of some parts, one after another."""
        return cls(*(np.concatenate([getattr(part, one.name) for part in parts]) for one in fields(cls)))

    def points(self, turns: Array = TURN) -> Array:
        """(N, P, 3) points at angles (P,)."""
        return np.asarray(self.centres[:, None] + self.radii[:, None, None] * self.spokes(turns))

    @property
    def axes(self) -> Array:
        """(N, 3, 3) each one's centre, and two radii across each other: `SHARES` of them are its points."""
        first, second = axes_across(self.normals)
        radii = self.radii[:, None]
        return np.stack([self.centres, radii * first, radii * second], axis=1)

    def spokes(self, turns: Array = TURN) -> Array:
        """(N, P, 3) unit vectors from the centre to the points at angles (P,)."""
        first, second = (axis[:, None] for axis in axes_across(self.normals))
        return np.asarray(np.cos(turns)[:, None] * first + np.sin(turns)[:, None] * second)

    def better_of(self, other: Circles) -> Circles:
        """Of each pair of circles the one that scores better."""
        return Circles.joined([self, other])[np.arange(len(self)) + len(self) * (other.scores > self.scores)]

    def distinct(self, count: int, same_m: float, same_cosine: float) -> Circles:
        """The best that are not about the same, best first; arguments as of `distinct_numbers`."""
        return self[self.distinct_numbers(count, same_m, same_cosine)]

    def distinct_numbers(self, count: int, same_m: float, same_cosine: float) -> npt.NDArray[np.intp]:
        """(K,) which are the best that are not about the same, best first.

        Args:
            count: how many at most.
            same_m: circles whose centres are closer are the same,
            same_cosine: if the cosine of the angle between them is larger.
        """
        order = np.argsort(-self.scores, kind="stable")
        chosen = np.zeros(0, np.intp)
        # Block by block: most are worse than those that are chosen, and are never compared.
        for start in range(0, len(order), _BLOCK):
            block = order[start : start + _BLOCK]
            block = block[~self._are_same(block, chosen, same_m, same_cosine).any(axis=1)]
            is_other = ~self._are_same(block, block, same_m, same_cosine)
            is_left, first = np.ones(len(block), dtype=bool), []
            for k in range(len(block)):
                if is_left[k]:
                    first.append(k)
                    is_left &= is_other[k]
            chosen = np.concatenate([chosen, block[first]])[:count]
            if len(chosen) == count:
                break
        return chosen

    def _are_same(self, some: Indices, others: Indices, same_m: float, same_cosine: float) -> npt.NDArray[np.bool_]:
        """(S, O) which of some are about the same as which of others; arguments as of `distinct_numbers`."""
        away = self.centres[some][:, None] - self.centres[others]
        is_near = np.einsum("soi,soi->so", away, away) < same_m**2
        return np.asarray(is_near & (np.abs(self.normals[some] @ self.normals[others].T) > same_cosine))


def is_narrow(circles: Circles, plane: Plane, grid: EpipolarGrid) -> npt.NDArray[np.bool_]:
    """(N,) whether a plane sees circles so nearly edge-on that what lies inside is their own other half."""
    return np.asarray(circles.radii * np.abs(circles.normals @ grid.view[plane]) < NARROW_M)


def outward(columns: Array, rows: Array) -> tuple[Array, Array]:
    """(N, P) unit vectors across closed convex curves, away from their inside, along columns and rows."""
    along, down, _ = tangents(columns, rows)
    area = (columns * np.roll(rows, -1, axis=1) - rows * np.roll(columns, -1, axis=1)).sum(axis=1, keepdims=True)
    way = np.where(area < 0.0, -1.0, 1.0)
    return way * down, -way * along


def laid(circles: Circles, plane: Plane, grid: EpipolarGrid) -> tuple[Array, Array]:
    """(N, POINTS) columns and rows, metres, of points along circles in a plane's grid."""
    columns, rows = grid.lay_along(plane, circles.axes, SHARES)
    return columns, rows + circles.lifts[:, None] if plane == "b" else rows


def highest(scores: Array, count: int) -> Indices:
    """(K,) which of some scores (N,) are the highest, highest first."""
    if len(scores) > count:
        some = np.flatnonzero(scores >= np.partition(scores, -count)[-count])
        return np.asarray(some[np.argsort(-scores[some], kind="stable")][:count])
    return np.argsort(-scores, kind="stable")
