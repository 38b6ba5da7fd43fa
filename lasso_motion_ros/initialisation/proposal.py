"""A ring that is proposed, and which others may be one beside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.geometry.frames import FramePair, Seed
from lasso_motion_ros.initialisation.judgement import Judgement

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """Which rings are the same."""

    same_m: float = 8e-3  # rings whose centres are closer share much of what they rest on: only the better is one
    touching_m: float = 2e-3  # two curves where they are no farther apart,
    largest_touching_share: float = 0.25  # and how much of one does so at most
    same_ring_m: float = 1.5e-3  # mean distance of two curves of one ring
    same_outline_mm: float = 1.0  # mean distance of two rings' clicks in a plane, below which it shows one outline


TUNING = _Tuning()
SAME_M = TUNING.same_m


@dataclass(frozen=True, eq=False)
class Proposal:
    """A ring that is proposed.

    Attributes:
        pair: the one of its clicks.
        seed: clicks along it there.
        points: (L, 3) its curve there, world metres.
        judgement: what speaks for it.
        rivals: other rings that fit nearly as well.
        text: what is known of the catheter, for people.
    """

    pair: FramePair
    seed: Seed
    points: Array
    judgement: Judgement
    rivals: int
    text: str

    @property
    def centre(self) -> Array:
        """(3,) middle of the curve, world metres."""
        return np.asarray(self.points.mean(axis=0))

    def is_at(self, centre: Array) -> bool:
        """Whether the ring at a centre (3,) m is about the same."""
        return float(np.linalg.norm(self.centre - centre)) < TUNING.same_m

    def is_of(self, other: Proposal) -> bool:
        """Whether another's curve is that of the same ring."""
        return _apart(self.points, other.points) < TUNING.same_ring_m

    def can_be_beside(self, other: Proposal) -> bool:
        """Whether it may be a ring as well as another: elsewhere, and no plane shows both in the same place.

        One ring's outline in one plane and another ring's in the other make a third, where there is none; and so do an
        arc of a ring and what lies beside it.
        """
        if self.is_at(other.centre) or self._shares_an_arc_with(other):
            return False
        return not any(
            frame.projection.millimetres_per_pixel(self.centre)
            * _outlines_apart(self.seed.points(plane), other.seed.points(plane))
            < TUNING.same_outline_mm
            for plane, frame in self.pair.frames.items()
        )

    def _shares_an_arc_with(self, other: Proposal) -> bool:
        """Whether more of their curves lies together than where two rings touch."""
        ways = ((self.points, other.points), (other.points, self.points))
        shares = (float((distance_to_curve(*way) < TUNING.touching_m).mean()) for way in ways)
        return max(shares) > TUNING.largest_touching_share


def _outlines_apart(one: Array, other: Array) -> float:
    """Mean distance of two closed curves' points (N, 2), (M, 2), of whichever lies farther from the other."""
    return _apart(*(np.vstack([curve, curve[:1]]) for curve in (one, other)))


def _apart(one: Array, other: Array) -> float:
    """Mean distance of two curves' points (N, D), (M, D), of whichever lies farther from the other."""
    return max(float(distance_to_curve(*ways).mean()) for ways in ((one, other), (other, one)))
