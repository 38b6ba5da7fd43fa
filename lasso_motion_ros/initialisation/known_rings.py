"""Rings that earlier looks have followed: where they are now, and what those looks said for each.

A look that shows too little of a ring leaves it in doubt, and so may the next. What both say adds up where they share
no pair: noise does not repeat itself. It does not add up in full, since what lies about a ring is the same in both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.ring.electrodes import RingEvidence
from lasso_motion_ros.ring.track import Track
from lasso_motion_ros.ring.tracker import RingTracker

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """Which ring is the same, and what an earlier look is worth."""

    same_m: float = 1.5e-3  # mean distance of its curve
    most: int = 4  # rings that are remembered
    share: float = 0.5  # of an earlier look's log likelihood that a later one adds
    unseen: float = -1.9  # log odds of what is followed, before anything is known of it: of the fit in `judgement`
    bounds: tuple[float, float] = (-1.0, 2.5)  # of what is added


TUNING = _Tuning()


@dataclass(eq=False)
class FollowedRing:
    """A ring that a tracker follows from pair to pair.

    Attributes:
        tracker: that does.
        track: what it knows of the ring.
        begun_ns: stamp of the pair with which it began.
        looks: the last pair's stamp and the log odds of each look that has followed it, the last one last.
        places: per pair's stamp, (3,) m by which the ring had moved until then; of the pairs in which it was seen.
        last_ns: stamp of the last pair that it was followed into, seen there or not.
    """

    tracker: RingTracker
    track: Track
    begun_ns: int
    looks: tuple[tuple[int, float], ...] = ()
    places: dict[int, Array] = field(default_factory=dict)
    last_ns: int = field(init=False)

    def __post_init__(self) -> None:
        self.places[self.begun_ns] = np.zeros(3)
        self.last_ns = self.begun_ns

    @property
    def catheter(self) -> RingEvidence:
        """What the planes show along it by now."""
        return replace(self.track.electrodes, shown=self.track.template.shown)

    @property
    def evidence(self) -> float:
        """Log odds that the last look leaves."""
        return self.looks[-1][1]

    def follow(self, pair: FramePair) -> float:
        """Follow it into the next pair; what the planes show of it there, -1 where nothing.

        Whether a pose rests on that is another question: a heart that moves the ring by 5 mm between the planes'
        exposures forbids one, and hides no ring.
        """
        self.last_ns = pair.stamp_ns
        self.tracker.track(pair)
        if self.track.displacement is not None:
            self.places[pair.stamp_ns] = self.track.displacement
        return self.track.last_support

    def at(self, pair: FramePair) -> Array | None:
        """(L, 3) its curve in a pair that it was followed into, or in a later one; None where it is not seen."""
        if pair.stamp_ns > self.last_ns:
            try:
                self.follow(pair)
            except (LassoMotionError, ValueError, np.linalg.LinAlgError):
                return None
        moved = self.places.get(pair.stamp_ns)
        return None if moved is None else self.track.model.points + moved

    def adds(self, first_ns: int) -> float:
        """What the last look that ended before a stamp adds to the log odds of one that begins there."""
        ended = [log_odds for last_ns, log_odds in self.looks if last_ns < first_ns]
        if not ended:
            return 0.0
        return float(np.clip(TUNING.share * (ended[-1] - TUNING.unseen), *TUNING.bounds))


class KnownRings:
    """Rings of earlier looks as they lie in the first pair of this one.

    Args:
        rings: that were followed.
        pair: the first.
    """

    def __init__(self, rings: Sequence[FollowedRing], pair: FramePair) -> None:
        seen = [(one, one.at(pair)) for one in rings]
        self._there = [(one, curve) for one, curve in seen if curve is not None]

    def of(self, points: Array) -> FollowedRing | None:
        """The one whose curve is about that of a ring (L, 3) m; None where there is none."""
        near = [(_apart(points, curve), one) for one, curve in self._there]
        away, nearest = min(near, key=lambda one: one[0], default=(np.inf, None))
        return nearest if away < TUNING.same_m else None

    def adds(self, points: Array, first_ns: int) -> float:
        """What they add to the log odds of a ring (L, 3) m in a look that begins at a stamp."""
        before = self.of(points)
        return 0.0 if before is None else before.adds(first_ns)

    def remembered(self, followed: Sequence[FollowedRing]) -> list[FollowedRing]:
        """What a next look goes on with, likeliest first: what this one has followed, and what it did not find."""
        found = [one.looks[:-1] for one in followed]
        missed = [one for one, _ in self._there if one.looks not in found]
        return sorted([*followed, *missed], key=lambda one: -one.evidence)[: TUNING.most]


def _apart(one: Array, other: Array) -> float:
    return max(float(distance_to_curve(*ways).mean()) for ways in ((one, other), (other, one)))
