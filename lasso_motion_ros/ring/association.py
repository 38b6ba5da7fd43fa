"""Which of the detections is the ring, and whether any is: probabilities from what the images and the motion say.

Each detection is a hypothesis, "the ring is nowhere in view" one more. A hypothesis is worth what the images show there
(log odds against the best that anything else shows, from the simulator and real video) and how well the motion so far
foretold it; a ring that was moved by hand is foretold by nothing, which has a probability of its own. Two questions are
asked: which of the places is the ring's, if one is, and whether it is the ring that shows there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.motion.respiration import RespiratoryMotion
from lasso_motion_ros.ring.detection import Detection
from lasso_motion_ros.ring.loop_model import LoopModel

Array = npt.NDArray[np.float64]


SMALLEST_DENSITY = 1e-30  # where nothing else ever shows as much

Way = tuple[float, Callable[[], RespiratoryMotion]]


@dataclass(frozen=True)
class AssociationTuning:
    """What images and motion are worth as evidence."""

    # The best of all else that looks like the ring (clutter) is about normal; what shows at the ring may be anything
    # over a range.
    clutter_support: float = 1.0
    clutter_sigma: float = 0.15
    view_m: float = 0.04  # something else is found anywhere within this,
    agreement_m: float = 0.01  # and the two planes agree on it as well as this
    range_support: float = 1.6
    # Slipped along itself, or a twin: this share of all else looks as the ring does, whatever that is.
    alike: float = 0.03
    usual_sigma: float = 0.25  # of the support where the ring is, about what is usual,
    flattery: float = 0.5  # of the seed pair, whose support is all that is known of the usual one at first: likewise
    unlike: float = 0.1  # but for this share, of any support
    # Being where it was foretold proves so much (log odds) and no more, nor more than what the images show there: what
    # looks like the ring is often right beside it. Where there are several, it tells more of which of them is the ring.
    foretold: float = 2.0
    foretold_of_several: float = 8.0
    anywhere_of_several: float = -3.0  # at least: a C-arm that was moved unsaid shows it anywhere
    surge_probability: float = 0.1  # that a breath has set in unforeseen
    jump_probability: float = 0.02  # that it was moved by hand
    jump_reach_m: float = 0.024  # then it may be anywhere within this
    weight_kept: float = 1e-3  # hypotheses of less are dropped


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A detection, and what would follow from it.

    Attributes:
        detection: where the ring would be.
        motion: the filter after it.
        log_odds: for it, against the ring being out of view.
        gap_mm: by which the planes disagree on its place, mm, signed; 0 where one plane is alone.
        slack_mm: what the motion between the planes' exposures may add to that, standard deviation, mm.
        claim: the same among several places, of which the ring is one.
        alike: probability that it is something just like the ring, however plain: such is rare, but lies anywhere.
        probability: of it, among all hypotheses.
    """

    detection: Detection
    motion: RespiratoryMotion
    log_odds: float
    gap_mm: float
    slack_mm: float
    claim: float = 0.0
    alike: float = 0.0
    probability: float = 0.0

    @property
    def is_whole(self) -> bool:
        """Whether both planes show it."""
        return len(self.detection.planes) == len(PLANES)

    @property
    def displacement(self) -> Array:
        """(3,) of the ring's centre since the seed pair, metres."""
        return self.motion.at_a.displacement


@dataclass(frozen=True, eq=False)
class Association:
    """All hypotheses on one pair, most probable first.

    Attributes:
        hypotheses: those that are not negligible.
        absent: probability that the ring is out of view, or hidden.
    """

    hypotheses: tuple[Hypothesis, ...]
    absent: float

    @property
    def best(self) -> Hypothesis | None:
        """The most probable place; None where none shows anything."""
        return self.hypotheses[0] if self.hypotheses else None

    @property
    def spread(self) -> Array:
        """(3, 3) m² by which the other places spread the best one's displacement."""
        if len(self.hypotheses) < 2:
            return np.zeros((3, 3))
        weights = np.array([one.probability for one in self.hypotheses])
        weights = weights / weights.sum()
        away = np.array([one.displacement for one in self.hypotheses]) - self.hypotheses[0].displacement
        return np.asarray((weights[:, None] * away).T @ away)


def associate(
    detections: Sequence[Detection],
    motion: RespiratoryMotion,
    time_s: float,
    times: Mapping[Plane, float],
    model: LoopModel,
    usual: float,
    sightings: int,
    tuning: AssociationTuning,
) -> Association:
    """Weigh the detections of one pair.

    Args:
        detections: of the pair.
        motion: the filter before it; not changed.
        time_s: of the pair: plane A's exposure, or what would have been it, seconds since the seed pair.
        times: of the exposures, seconds.
        model: the ring at the seed pair.
        usual: support where the ring is seen.
        sightings: pairs that tell of it, besides the seed pair.
        tuning: what images and motion are worth.
    """
    unmoved = math.log(1.0 - tuning.surge_probability - tuning.jump_probability)
    ways: list[Way] = [
        (unmoved, lambda: motion),
        (math.log(tuning.surge_probability), cache(motion.surged)),
        (math.log(tuning.jump_probability), cache(partial(motion.moved_by_hand, tuning.jump_reach_m))),
    ]
    usual_sigma = math.hypot(tuning.usual_sigma, tuning.flattery / (sightings + 1))
    looks = [_looks(detection.support, usual, usual_sigma, tuning) for detection in detections]
    hypotheses = [
        _hypothesis(detection, look, ways, time_s, times, model, tuning)
        for detection, look in zip(detections, looks, strict=True)
    ]
    if not hypotheses:
        return Association((), 1.0)
    # Which of them, if one is; and for itself, whether it is the ring.
    claims = np.array([one.claim for one in hypotheses])
    shares = np.exp(claims - np.logaddexp.reduce(claims))
    probabilities = shares * np.exp(-np.logaddexp(0.0, -np.array([one.log_odds for one in hypotheses])))
    absent = max(0.0, 1.0 - float(probabilities.sum()))
    weighed = [
        replace(one, probability=float(probability)) for one, probability in zip(hypotheses, probabilities, strict=True)
    ]
    weighed.sort(key=lambda one: -one.probability)
    return Association(
        tuple(one for one in weighed if one is weighed[0] or one.probability >= tuning.weight_kept), absent
    )


def _hypothesis(
    detection: Detection,
    looks: _Looks,
    ways: Sequence[Way],
    time_s: float,
    times: Mapping[Plane, float],
    model: LoopModel,
    tuning: AssociationTuning,
) -> Hypothesis:
    """What a detection is worth, by how it looks and the ways in which the ring may have got there.

    Each way is its log probability, and the motion by it.
    """
    clutter = _clutter_density(detection, tuning)
    odds: list[float] = []
    outcomes: list[RespiratoryMotion] = []
    by_a: list[RespiratoryMotion] = []
    for prior, motion in ways:
        after_a, likelihood_a = _observed_by_a(detection, motion(), times, model)
        after, likelihood = _observed_by_b(detection, after_a, time_s, times, model)
        likelihood += likelihood_a
        by_a.append(after_a)
        odds.append(prior + likelihood - clutter)
        outcomes.append(after)
        if max(odds) > 0.0:  # the first way that explains it will do: more of them add nothing
            break
    motion_odds = float(np.logaddexp.reduce(odds))
    after = outcomes[int(np.argmax(odds))]
    shown = _shown(detection.support, tuning)
    log_odds = looks.odds + min(motion_odds, tuning.foretold, shown)
    claim = looks.odds_with_alike + max(min(motion_odds, tuning.foretold_of_several, shown), tuning.anywhere_of_several)
    # Which shows whatever the ring does, and anything else.
    alike = tuning.alike / (tuning.alike + looks.usual * math.exp(motion_odds))
    gap_mm, slack_mm = _disagreement(detection, by_a[0], times, model)
    return Hypothesis(detection, after, log_odds, gap_mm, slack_mm, claim, alike)


def _disagreement(
    detection: Detection, after_a: RespiratoryMotion, times: Mapping[Plane, float], model: LoopModel
) -> tuple[float, float]:
    """How far the planes' rays pass each other, and what the motion between their exposures may do to that, mm."""
    if len(detection.planes) < len(PLANES):
        return 0.0, 0.0
    between = after_a.expected_between(times["b"])
    gap, across = detection.gap(model.centre + between.displacement)
    return 1e3 * gap, 1e3 * float(np.sqrt(across @ between.covariance @ across))


def _clutter_density(detection: Detection, tuning: AssociationTuning) -> float:
    """Log probability density of finding something else there: anywhere in view, the planes nearly agreeing."""
    reach, gap = math.log(tuning.view_m), math.log(tuning.agreement_m)
    return -2.0 * reach if len(detection.planes) == 1 else -3.0 * reach - gap


def _shown(support: float, tuning: AssociationTuning) -> float:
    """By how much a support exceeds what else shows that: logarithm of how rare it would be there; 0 or more."""
    return 0.5 * (max(support - tuning.clutter_support, 0.0) / tuning.clutter_sigma) ** 2


@dataclass(frozen=True)
class _Looks:
    """How a support tells the ring, as it usually shows, from all else.

    Attributes:
        odds: logarithm of how much likelier it is of the ring than of anything else that is seen.
        odds_with_alike: the same, with what looks just like a ring among the rest.
        usual: its density, of the ring, relative to that of what is usual. Far less than usual is seldom the ring's,
            however little else shows as much: a ring that is half drawn into its sheath looks like a ring, too.
    """

    odds: float
    odds_with_alike: float
    usual: float


def _looks(support: float, usual: float, usual_sigma: float, tuning: AssociationTuning) -> _Looks:
    any_support = 1.0 / tuning.range_support

    def of_ring(value: float) -> float:
        return (1.0 - tuning.unlike) * _normal(value, usual, usual_sigma) + tuning.unlike * any_support

    def of_clutter(value: float) -> float:
        return _normal(value, tuning.clutter_support, tuning.clutter_sigma)

    ring = of_ring(support)
    # Less than all else mostly shows speaks for nothing.
    least = max(of_clutter(max(support, tuning.clutter_support)), SMALLEST_DENSITY)
    rest = (1.0 - tuning.alike) * of_clutter(support) + tuning.alike * any_support
    return _Looks(math.log(ring / least), math.log(ring / rest), ring / of_ring(usual))


def _normal(value: float, mean: float, sigma: float) -> float:
    return math.exp(-0.5 * ((value - mean) / sigma) ** 2) / (math.sqrt(2.0 * math.pi) * sigma)


def _observed_by_a(
    detection: Detection, motion: RespiratoryMotion, times: Mapping[Plane, float], model: LoopModel
) -> tuple[RespiratoryMotion, float]:
    """The motion after what plane A shows of a detection, and how likely that was."""
    after, likelihood = motion.copy(), 0.0
    if "a" in detection.planes:
        likelihood += after.observe(times["a"], a=detection.observation("a", model.centre))
    return after, likelihood


def _observed_by_b(
    detection: Detection, motion: RespiratoryMotion, time_s: float, times: Mapping[Plane, float], model: LoopModel
) -> tuple[RespiratoryMotion, float]:
    """The motion after what plane B shows, at its own time, and how likely that was."""
    after, likelihood = motion.copy(), 0.0
    after.mark_a(time_s)
    if "b" in detection.planes:
        likelihood += after.observe(times["b"], b=detection.observation("b", model.centre))
    return after, likelihood
