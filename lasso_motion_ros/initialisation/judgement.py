"""Whether a ring that was found is believed: what both planes of several pairs show along its curve.

Any three electrodes lie on a circle, and much in an X-ray image looks like a piece of one. A lasso's ring goes round,
its electrodes are equally far apart along one arc length in both planes, and lie all round it; and later pairs show the
same again, moved by one rigid motion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, auto

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.initialisation.distinctness import Distinctness
from lasso_motion_ros.ring.electrodes import RingEvidence
from lasso_motion_ros.ring.working_image import Image

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """What a ring that is believed must show, and what another must to be its rival (docs/automatic.md)."""

    segments: int = 12  # of the arc
    shown: float = 0.3  # mean of the lesser of both planes' evidence, from which on a segment is one of a ring
    # Less of any of these is shown by no ring that both planes show well.
    smallest_covered: float = 0.5  # share of such segments
    smallest_spread: float = 0.8  # entropy of the electrodes along the arc, of that of an even one
    smallest_agreement: float = 0.15  # correlation of both planes' evidence along the arc, what is slow left out
    smallest_comb: float = 8.0  # score of equally spaced poles
    smallest_roundness: float = 0.7  # nearest by farthest point of the curve from its middle
    smallest_support: float = 1.5
    diameter_mm: tuple[float, float] = (12.5, 33.0)
    largest_line_beyond: float = 0.6
    # What each is worth as evidence (log odds), by logistic regression over the rings and all else that was followed in
    # development; much of one makes up for little of another.
    per_spread: float = 7.4
    per_agreement: float = 2.1
    per_comb: float = 1.55  # of its logarithm
    per_roundness: float = 7.0
    per_worth: float = 4.2
    per_common: float = 0.5  # by which it is rarer by less than
    common: float = 3.0  # once in a thousand times: what leaves half of a ring out is no rarer than chance
    per_small_mm: float = 0.84  # by which it is smaller than most: what else makes a ring is small
    small_mm: float = 16.0
    per_curve: float = 0.39  # standard deviation
    per_poles: float = 0.38  # likewise
    per_lead: float = 3.3
    combs: tuple[float, float] = (3.0, 60.0)  # less, or more, proves no more
    enough_roundness: float = 0.93
    enough_worth: float = 1.2
    nothing: float = 31.8
    believed: float = 2.5
    rival: float = -1.0
    # With all that is not known yet at its best: no ring has everything, so that less of it leaves no hope.
    hope_of_circle: float = 11.0  # before there is a model,
    hope_of_curve: float = 8.5  # before its poles are looked for,
    hope_of_model: float = 2.5  # and before it is followed
    least_lines: float = 9.5  # by which a ring's lines stand out, before there is a model, standard deviations
    most_spread: float = 0.98
    most_agreement: float = 0.8
    most_distinct: tuple[float, float, float] = (18.0, 20.0, 1.2)
    same_place_mm: float = 0.8  # in an image: half an electrode's length and more
    apart_share: float = 0.05  # of the arc, from which on two points are not simply neighbours
    slow_points: float = 10.0  # standard deviation, of some hundred points along the arc
    # Of the lines beside a circle, before a model is made and followed: less than the mean of several pairs shows.
    glance_covered: float = 0.5
    glance_agreement: float = 0.0


TUNING = _Tuning()
MOST_DISTINCT = Distinctness(*TUNING.most_distinct)
SMALLEST_SUPPORT = TUNING.smallest_support


@dataclass(frozen=True)
class Judgement:
    """What both planes show along a ring's curve.

    Attributes:
        covered: share of the arc on which both planes show something of a ring.
        spread: how evenly the electrodes lie along the arc, 1 at most.
        agreement: correlation of what the two planes show.
        comb: score of equally spaced poles.
        roundness: nearest by farthest point of the curve from its middle.
        support: what the planes show of it in later pairs, by the tracker's own measure.
        diameter_mm: of the ring.
        worth: of the ring that it comes from: lines all along it, and the same electrodes in both planes.
        rareness: how seldom chance would put so many of all pairs' electrodes on it (minus the logarithm to base ten).
        line_beyond: how much of a line goes on beyond both its ends in a plane that sees it edge-on.
        distinct: how far it stands out from what lies about it.
        before: log odds that earlier looks add.
    """

    covered: float
    spread: float
    agreement: float
    comb: float
    roundness: float
    support: float
    diameter_mm: float
    worth: float
    rareness: float
    line_beyond: float
    distinct: Distinctness
    before: float = 0.0

    @property
    def evidence(self) -> float:
        """Log odds for a ring, by all of that together."""
        return (
            TUNING.per_spread * self.spread
            + TUNING.per_agreement * self.agreement
            + TUNING.per_comb * float(np.log(np.clip(self.comb, *TUNING.combs)))
            + TUNING.per_roundness * min(self.roundness, TUNING.enough_roundness)
            + TUNING.per_worth * min(self.worth, TUNING.enough_worth)
            - TUNING.per_common * max(0.0, TUNING.common - self.rareness)
            - TUNING.per_small_mm * max(0.0, TUNING.small_mm - self.diameter_mm)
            + TUNING.per_curve * self.distinct.curve
            + TUNING.per_poles * self.distinct.poles
            + TUNING.per_lead * self.distinct.lead
            - TUNING.nothing
            + self.before
        )

    @property
    def is_ring(self) -> bool:
        """Whether it is believed to be a lasso's ring."""
        return not self.doubt

    @property
    def doubt(self) -> str:
        """Why it is not; empty if it is."""
        return self.missing or ("" if self.evidence >= TUNING.believed else "all in all it shows too little of a ring")

    @property
    def missing(self) -> str:
        """Which of the things that every ring shows it does not; empty if it shows all."""
        checks = (
            (has_ring_size(self.diameter_mm), f"{self.diameter_mm:.0f} mm across"),
            (self.roundness >= TUNING.smallest_roundness, f"not round: {self.roundness:.2f}"),
            (self.covered >= TUNING.smallest_covered, f"seen along {100 * self.covered:.0f} % of its arc"),
            (self.spread >= TUNING.smallest_spread, "its electrodes lie on one side"),
            (self.agreement >= TUNING.smallest_agreement, "the planes show different electrodes"),
            (self.support >= TUNING.smallest_support, "faint"),
            (self.line_beyond <= TUNING.largest_line_beyond, "edge-on it is a part of a long line"),
            (self.comb >= TUNING.smallest_comb, "its electrodes are not equally far apart"),
        )
        return next((words for is_met, words in checks if not is_met), "")

    @property
    def is_rival(self) -> bool:
        """Whether it may be a ring, beside one that is: then nothing is started without being asked."""
        return not self.missing and self.evidence >= TUNING.rival


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
    def at(cls, shown: Mapping[Plane, Image], places: Mapping[Plane, Array]) -> Glance:
        """Of what each plane shows (L,) along a closed curve, at its places (L, 2), mm."""
        a, b = (np.asarray(shown[plane], dtype=np.float64) for plane in PLANES)
        lesser = np.maximum(np.minimum(a, b), 0.0)
        means = np.add.reduceat(lesser, _starts(len(lesser))) * (TUNING.segments / len(lesser))
        # A plane that sees it edge-on shows at one place what lies on either side.
        a, b = _without_slow(_doubled(a, places["b"])), _without_slow(_doubled(b, places["a"]))
        scale = float(np.linalg.norm(a) * np.linalg.norm(b))
        return cls(float((means > TUNING.shown).mean()), float(a @ b) / max(scale, 1e-9))


class Known(Enum):
    """What is known of a ring that may be believed in the end."""

    CIRCLE = auto()  # judged by `at_most`
    CURVE = auto()
    POLES = auto()


_LEAST_HOPE = {
    Known.CIRCLE: TUNING.hope_of_circle,
    Known.CURVE: TUNING.hope_of_curve,
    Known.POLES: TUNING.hope_of_model,
}


def hope(best: Judgement, known: Known) -> float:
    """How much more evidence there may be than a ring that is believed in the end has at least; less than 0: no hope.

    Args:
        best: of what is known, as of `at_best`.
        known: what that is.
    """
    return -np.inf if best.missing else best.evidence - _LEAST_HOPE[known]


def hope_of_lines(best: Judgement, stand_out: float) -> float:
    """The same before there is a model, by how far a ring's lines stand out (`lines_elsewhere`).

    Args:
        best: of what is known besides, as of `at_most`.
        stand_out: standard deviations.
    """
    if hope(best, Known.CIRCLE) < 0.0:
        return -np.inf
    return TUNING.per_curve * (stand_out - TUNING.least_lines) + best.before


def at_best(
    *,
    roundness: float,
    diameter_mm: float,
    worth: float,
    rareness: float,
    line_beyond: float,
    comb: float = np.inf,
    distinct: Distinctness = MOST_DISTINCT,
    before: float = 0.0,
) -> Judgement:
    """The judgement of a ring that shows all that one can show once it is followed; arguments as of `Judgement`."""
    spread, agreement = TUNING.most_spread, TUNING.most_agreement
    return Judgement(
        1.0, spread, agreement, comb, roundness, np.inf, diameter_mm, worth, rareness, line_beyond, distinct, before
    )


def at_most(*, worth: float, rareness: float, line_beyond: float, before: float = 0.0) -> Judgement:
    """The same before there is a model: as round as can be, and of any size."""
    return at_best(
        roundness=1.0,
        diameter_mm=float(np.mean(TUNING.diameter_mm)),
        worth=worth,
        rareness=rareness,
        line_beyond=line_beyond,
        before=before,
    )


def has_ring_size(diameter_mm: float) -> bool:
    """Whether a ring is as large as a lasso's."""
    low, high = TUNING.diameter_mm
    return low <= diameter_mm <= high


def judge(
    evidence: RingEvidence,
    places: Mapping[Plane, Array],
    weights: Array,
    *,
    roundness: float,
    support: float,
    worth: float,
    rareness: float,
    line_beyond: float,
    comb: float,
    distinct: Distinctness,
    before: float = 0.0,
) -> Judgement:
    """Judge a ring by what the planes show along its curve.

    Args:
        evidence: of both planes, mean of the pairs.
        places: per plane, (L, 2) where its curve lies in the image, mm.
        weights: (L,) where the electrodes are, of sum 1.
        roundness: of its curve.
        support: what later pairs show of it.
        worth: of the ring that it comes from.
        rareness: likewise.
        line_beyond: likewise.
        comb: likewise.
        distinct: likewise.
        before: log odds that earlier looks add.
    """
    glance = Glance.at(evidence.shown, places)
    shares = np.add.reduceat(weights, _starts(len(weights)))
    spread = -float((shares * np.log(np.maximum(shares, 1e-9))).sum()) / float(np.log(TUNING.segments))
    return Judgement(
        covered=glance.covered,
        spread=spread,
        agreement=glance.agreement,
        comb=comb,
        roundness=roundness,
        support=support,
        diameter_mm=evidence.diameter_mm,
        worth=worth,
        rareness=rareness,
        line_beyond=line_beyond,
        distinct=distinct,
        before=before,
    )


def _doubled(values: Array, places: Array) -> Array:
    """(L,) along a closed curve, the larger of what is at a point and at another that lies in the same place (L, 2)."""
    length = len(values)
    along = np.abs(np.arange(length)[:, None] - np.arange(length))
    apart = np.minimum(along, length - along) >= TUNING.apart_share * length
    squared = sum(np.square(one[:, None] - one) for one in places.T)
    is_same = apart & (squared < TUNING.same_place_mm**2)
    return np.asarray(np.maximum(values, np.where(is_same, values, -np.inf).max(axis=1)))


def _starts(length: int) -> npt.NDArray[np.intp]:
    """Where each segment of an arc of some points begins."""
    return np.arange(TUNING.segments) * length // TUNING.segments


def _without_slow(values: Array) -> Array:
    """(L,) without what changes slowly along the arc."""
    reach = int(3.0 * TUNING.slow_points)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / TUNING.slow_points) ** 2)
    padded = np.pad(values, reach, mode="reflect")
    return np.asarray(values - np.convolve(padded, kernel / kernel.sum(), mode="valid"))
