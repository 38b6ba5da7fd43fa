"""What else in view looks like the ring and moves with the heart, a second lasso say: how it lies to the ring.

Two lassos in neighbouring veins look alike, and with the breath one goes where the other was. But they keep their
distance: who of the two is the ring follows from where the other one lies.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.triangulation import nearest_to_rays
from lasso_motion_ros.ring.detection import Detection

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class TwinTuning:
    """What is taken for a twin, and what it tells."""

    nearest_m: float = 8e-3  # what lies nearer may be the ring itself, slipped along its own curve
    same_m: float = 3e-3  # by so much the distance changes, as the heart turns
    most: int = 4  # that are kept: the oldest goes first
    remembered: int = 8  # sightings
    # It moves with the heart where the ring went so far between two sightings, and its distance changed by less than
    # this share of that.
    moved_m: float = 1e-3
    kept_share: float = 0.5
    # What a twin tells that is where it belongs, or a ring where the twin's ring would be: a share of this, the larger
    # the oftener it was seen; and all of them together no more.
    log_odds: float = 5.0


@dataclass(frozen=True, eq=False)
class Twin:
    """One of them.

    Attributes:
        offset: (3,) from the ring's centre to where the ring would be if it were the twin, metres.
        first: likewise when both were seen first,
        ring: and where the ring was then, (3,) world metres.
        sightings: pairs in which both were seen.
        moves: whether it is known to move with the ring: what lies still tells nothing.
    """

    offset: Array
    first: Array
    ring: Array
    sightings: int = 1
    moves: bool = False

    def seen(self, offset: Array, ring: Array, tuning: TwinTuning) -> Twin:
        """With one more sighting: its offset, and where the ring was, (3,) m."""
        count = min(self.sightings + 1, tuning.remembered)
        went_m, changed_m = float(np.linalg.norm(ring - self.ring)), float(np.linalg.norm(offset - self.first))
        moves = self.moves or (went_m >= tuning.moved_m and changed_m < tuning.kept_share * went_m)
        return replace(self, offset=self.offset + (offset - self.offset) / count, sightings=count, moves=moves)


@dataclass(frozen=True, eq=False)
class Twins:
    """All that are known.

    Attributes:
        tuning: what is taken for one.
        known: the oldest first.
    """

    tuning: TwinTuning
    known: tuple[Twin, ...] = ()

    def after(self, ring: Detection, rings: Sequence[Detection]) -> Twins:
        """What is known after a pair in which the ring was surely seen.

        Args:
            ring: where it was.
            rings: all that plainly look like it in both planes, by themselves.
        """
        if all(one is ring for one in rings):  # as nearly always
            return self
        twins, place = list(self.known), _place(ring)
        for detection in rings:
            offset = _place(detection) - place
            if np.linalg.norm(offset) < self.tuning.nearest_m:
                continue
            number = next((n for n, twin in enumerate(twins) if self._is_same(twin.offset - offset)), None)
            if number is None:
                twins.append(Twin(offset, offset, place))
            else:
                twins[number] = twins[number].seen(offset, place, self.tuning)
        return replace(self, known=tuple(twins[max(len(twins) - self.tuning.most, 0) :]))

    def log_odds(self, detection: Detection, rings: Sequence[Detection]) -> float:
        """What the twins tell of a whole detection's being the ring, as a natural logarithm of the odds."""
        moving = [twin for twin in self.known if twin.moves]
        if not moving:
            return 0.0
        told, place = 0.0, _place(detection)
        offsets = [_place(other) - place for other in rings]
        for twin in moving:
            is_there = any(self._is_same(offset - twin.offset) for offset in offsets)
            is_behind = any(self._is_same(offset + twin.offset) for offset in offsets)
            share = twin.sightings / (twin.sightings + 1.0)
            told += (is_there - is_behind) * share * self.tuning.log_odds
        return float(np.clip(told, -self.tuning.log_odds, self.tuning.log_odds))

    def _is_same(self, away: Array) -> bool:
        return float(np.linalg.norm(away)) < self.tuning.same_m


def _place(detection: Detection) -> Array:
    """(3,) world metres: where the planes' rays pass each other most closely."""
    fits = detection.planes.values()
    return nearest_to_rays(np.array([fit.centre for fit in fits]), np.array([fit.ray for fit in fits]))
