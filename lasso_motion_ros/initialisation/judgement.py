"""Whether a ring that was found is believed: what both planes of several pairs show along its curve.

Any three electrodes lie on a circle, and much in an X-ray image looks like a piece of one. A lasso's ring goes round,
its electrodes are equally far apart along one arc length in both planes, and lie all round it; and later pairs show the
same again, moved by one rigid motion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.ring.electrodes import RingEvidence
from lasso_motion_ros.ring.working_image import Image

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """What a ring that is believed must show, and what another must to be its rival (docs/automatic.md)."""

    segments: int = 12  # of the arc
    shown: float = 0.3  # mean of the lesser of both planes' evidence, from which on a segment is one of a ring
    smallest_covered: float = 0.7  # share of such segments
    smallest_spread: float = 0.84  # entropy of the electrodes along the arc, of that of an even one
    smallest_agreement: float = 0.3  # correlation of both planes' evidence along the arc, what is slow left out
    smallest_comb: float = 16.0  # score of equally spaced poles
    smallest_roundness: float = 0.8  # nearest by farthest point of the curve from its middle
    smallest_support: float = 1.9
    rival_share: float = 0.5  # of the better ring's score
    rival_covered: float = 0.6
    rival_roundness: float = 0.65
    diameter_mm: tuple[float, float] = (12.5, 33.0)
    slow_points: float = 10.0  # standard deviation, of some hundred points along the arc
    # Of the lines beside a circle, before a model is made and followed: less than the mean of several pairs shows.
    glance_covered: float = 0.6
    glance_agreement: float = 0.1


TUNING = _Tuning()


@dataclass(frozen=True)
class Judgement:
    """What both planes show along a ring's curve.

    Attributes:
        covered: share of the arc on which both planes show something of a ring.
        spread: how evenly the electrodes lie along the arc, 1 at most.
        agreement: correlation of what the two planes show.
        comb: score of equally spaced poles.
        roundness: nearest by farthest point of the curve from its middle.
        support: what the planes usually show of it, by the tracker's own measure.
        diameter_mm: of the ring.
        followed: whether every later pair showed it, too.
    """

    covered: float
    spread: float
    agreement: float
    comb: float
    roundness: float
    support: float
    diameter_mm: float
    followed: bool

    @property
    def is_ring(self) -> bool:
        """Whether it is believed to be a lasso's ring."""
        return not self.doubt

    @property
    def doubt(self) -> str:
        """Why it is not; empty if it is."""
        low, high = TUNING.diameter_mm
        checks = (
            (self.followed, "later pairs do not show it"),
            (low <= self.diameter_mm <= high, f"{self.diameter_mm:.0f} mm across"),
            (self.roundness >= TUNING.smallest_roundness, f"not round: {self.roundness:.2f}"),
            (self.covered >= TUNING.smallest_covered, f"seen along {100 * self.covered:.0f} % of its arc"),
            (self.spread >= TUNING.smallest_spread, "its electrodes lie on one side"),
            (self.agreement >= TUNING.smallest_agreement, "the planes show different electrodes"),
            (self.comb >= TUNING.smallest_comb, "its electrodes are not equally far apart"),
            (self.support >= TUNING.smallest_support, "faint"),
        )
        return next((words for is_met, words in checks if not is_met), "")

    def is_rival_of(self, other: Judgement) -> bool:
        """Whether it fits nearly as well as a better one: then nothing is started without being asked."""
        return self.is_ring or (
            self.followed
            and self.comb >= TUNING.rival_share * other.comb
            and self.covered >= TUNING.rival_covered
            and self.roundness >= TUNING.rival_roundness
        )


@dataclass(frozen=True)
class Glance:
    """What both planes have in common along a curve.

    Attributes:
        covered: see `Judgement`.
        agreement: likewise.
    """

    covered: float
    agreement: float

    @property
    def is_worth_following(self) -> bool:
        """Whether it may be a ring's, by one pair."""
        return self.covered >= TUNING.glance_covered and self.agreement >= TUNING.glance_agreement

    @classmethod
    def at(cls, shown: Mapping[Plane, Image]) -> Glance:
        """Of what each plane shows (L,) along a curve."""
        a, b = (np.asarray(shown[plane], dtype=np.float64) for plane in PLANES)
        lesser = np.maximum(np.minimum(a, b), 0.0)
        means = np.add.reduceat(lesser, _starts(len(lesser))) * (TUNING.segments / len(lesser))
        a, b = _without_slow(a), _without_slow(b)
        scale = float(np.linalg.norm(a) * np.linalg.norm(b))
        return cls(float((means > TUNING.shown).mean()), float(a @ b) / max(scale, 1e-9))


def judge(evidence: RingEvidence, weights: Array, *, roundness: float, support: float, followed: bool) -> Judgement:
    """Judge a ring by what the planes show along its curve.

    Args:
        evidence: of both planes, mean of the pairs.
        weights: (L,) where the electrodes are, of sum 1.
        roundness: of its curve.
        support: what the planes usually show of it.
        followed: whether every later pair showed it.
    """
    glance = Glance.at(evidence.shown)
    shares = np.add.reduceat(weights, _starts(len(weights)))
    spread = -float((shares * np.log(np.maximum(shares, 1e-9))).sum()) / float(np.log(TUNING.segments))
    comb = evidence.comb
    return Judgement(
        covered=glance.covered,
        spread=spread,
        agreement=glance.agreement,
        comb=0.0 if comb is None else comb.score,
        roundness=roundness,
        support=support,
        diameter_mm=evidence.diameter_mm,
        followed=followed,
    )


def _starts(length: int) -> npt.NDArray[np.intp]:
    """Where each segment of an arc of some points begins."""
    return np.arange(TUNING.segments) * length // TUNING.segments


def _without_slow(values: Array) -> Array:
    """(L,) without what changes slowly along the arc."""
    reach = int(3.0 * TUNING.slow_points)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / TUNING.slow_points) ** 2)
    padded = np.pad(values, reach, mode="reflect")
    return np.asarray(values - np.convolve(padded, kernel / kernel.sum(), mode="valid"))
