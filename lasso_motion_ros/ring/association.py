"""Which of the detections is the ring, and whether any is: probabilities from what the images and the motion say.

Each detection is a hypothesis, "the ring is nowhere in view" one more. Two planes are two witnesses: how the ring looks
in each, how far their rays pass each other there, and how far that is from where the motion so far foretold it, are
likelihood ratios against the best of all else, and are multiplied. What is beside it may be the ring itself, seen a
little off: what is believed of a place is believed of all of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.covariance import largest_sigma, squared_mahalanobis
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.motion.motion_model import Estimate
from lasso_motion_ros.motion.outcome import Outcome
from lasso_motion_ros.motion.respiration import RespiratoryMotion
from lasso_motion_ros.ring.detection import Detection
from lasso_motion_ros.ring.loop_model import LoopModel
from lasso_motion_ros.ring.loop_views import PlaneFit
from lasso_motion_ros.ring.twins import Twins, TwinTuning

Array = npt.NDArray[np.float64]
NO_TWINS = Twins(TwinTuning())

_IDENTITY_3 = np.eye(3)

Way = tuple[float, Callable[[], RespiratoryMotion]]


@dataclass(frozen=True)
class AssociationTuning:
    """What images and motion are worth as evidence."""

    # Log odds that what a plane shows in a place is the ring: what is shown at its electrodes and of the wire between
    # them, how well the template fits, the share of the loop that looks as expected, and how sharply it says where, as
    # a natural logarithm of a standard deviation. By logistic regression (docs/constants.md).
    nothing: float = -5.2
    by_evidence: float = 3.17
    by_wire: float = 6.41
    most_wire: float = 0.35  # what is darker than most rings' wire proves no more: a bare wire is no ring
    by_likeness: float = 2.22
    by_visible: float = 1.45
    by_blur: float = -1.64
    blur_m: float = 1e-4
    sharpest_m: float = 3e-5  # a picture without noise says nothing by being sharp
    plainest: float = 1e-3  # odds against what looks as plain as can be: so no plane makes up for anything in another
    # Of the ring, the planes' rays pass each other by this, and by what moves in between; where there is more to it (a
    # calibration that is off, a heart) by anything up to a limit. Of all else by anything up to another.
    gap_sigma_m: float = 2.5e-4
    gap_else: float = 0.03
    largest_gap_m: float = 6e-3
    clutter_gap_m: float = 2e-3
    clutter_slacks: float = 1.2
    # Where it was foretold, with the tails of a Cauchy distribution: so wide, besides what the filter says.
    foretold_m: float = 4e-3
    by_spread: float = -1.70  # the wider, the more else lies there: likewise a natural logarithm
    anywhere: float = 1e-3  # relative to there: a C-arm that was moved unsaid
    # Its like, a twin or itself slipped along its curve: this share of all else looks as the ring does,
    alike: float = 0.03
    view_m: float = 0.04  # is anywhere within this,
    agreement_m: float = 0.01  # and the two planes agree on it as well as this.
    usual_sigma: float = 0.25  # of the support where the ring is, about what is usual,
    flattery: float = 0.5  # of the seed pair, whose support is all that is known of the usual one at first: likewise
    unlike: float = 0.1  # but for this share, of any support,
    range_support: float = 1.6  # in this range
    surge_probability: float = 0.1  # that a breath has set in unforeseen
    jump_probability: float = 0.02  # that it was moved by hand
    jump_reach_m: float = 0.024  # then it may be anywhere within this
    beside_m: float = 2e-3  # the same place, for what is asked of a pose
    weight_kept: float = 1e-3  # hypotheses of less are dropped
    plainly: float = 3.0  # log odds that either plane shows a ring there, this one or its like: it is one, then
    lives_on: float = 0.5  # chance that what was there, and not believed, is there in the next pair, too
    least_pending: float = 0.02  # probability: what has less is not followed on


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A detection, and what would follow from it.

    Attributes:
        detection: where the ring would be.
        outcome: what it would make of the motion.
        log_odds: for it, against the ring being out of view.
        gap_mm: by which the planes disagree on its place, mm, signed; 0 where one plane is alone.
        slack_mm: what the motion between the planes' exposures may add to that, standard deviation, mm.
        along_mm: how far the ring has gone in the direction of the gap since the seed pair, as both planes have it, mm.
        alike: probability that it is something just like the ring, however plain: such is rare, but lies anywhere.
        looks: log odds that it is a ring, by what the plane shows of it that shows less.
        probability: of it, among all hypotheses.
        believed: probability that the ring is there or right beside it; of the most probable hypothesis only.
    """

    detection: Detection
    outcome: Outcome[RespiratoryMotion]
    log_odds: float
    gap_mm: float
    slack_mm: float
    along_mm: float = 0.0
    alike: float = 0.0
    looks: float = 0.0
    probability: float = 0.0
    believed: float = 0.0

    @property
    def is_whole(self) -> bool:
        """Whether both planes show it."""
        return len(self.detection.planes) == len(PLANES)

    @property
    def motion(self) -> RespiratoryMotion:
        """The filter after it."""
        return self.outcome.motion

    @property
    def at_a(self) -> Estimate:
        """The displacement of the ring's centre since the seed pair, at plane A's exposure."""
        return self.outcome.at_a

    @property
    def displacement(self) -> Array:
        """(3,) of that, metres."""
        return self.at_a.displacement

    def is_beside(self, other: Hypothesis, limit_m: float) -> bool:
        """Whether another one, shown by the same planes, has the ring within so many metres."""
        away = self.displacement - other.displacement
        return self.detection.planes.keys() == other.detection.planes.keys() and math.sqrt(away @ away) < limit_m


@dataclass(frozen=True, eq=False)
class Pending:
    """The most probable hypothesis of a pair that was not believed: the next pair may bear it out.

    Attributes:
        motion: the filter after it.
        probability: of it, before the next pair is looked at.
    """

    motion: RespiratoryMotion
    probability: float


@dataclass(frozen=True, eq=False)
class Association:
    """All hypotheses on one pair, most probable first.

    Attributes:
        hypotheses: those that are not negligible.
        absent: probability that the ring is out of view, or hidden.
        rings: all that both planes plainly show to be a ring, this one or its like.
    """

    hypotheses: tuple[Hypothesis, ...]
    absent: float
    rings: tuple[Detection, ...] = ()

    @property
    def best(self) -> Hypothesis | None:
        """The most probable place; None where none shows anything."""
        return self.hypotheses[0] if self.hypotheses else None

    def pending(self, enough: float, tuning: AssociationTuning) -> Pending | None:
        """What the next pair may bear out: the best place of both planes, where it is not believed enough."""
        best = self.best
        if best is None or not best.is_whole or best.believed >= enough or best.probability < tuning.least_pending:
            return None
        return Pending(best.motion, tuning.lives_on * best.probability)

    @property
    def spread(self) -> Array:
        """(3, 3) m² by which the other places spread the best one's displacement."""
        return self.spread_beyond(0.0)

    def spread_beyond(self, limit_m: float) -> Array:
        """(3, 3) m² of that by those other places alone that are further from the best one than a limit."""
        if len(self.hypotheses) < 2:
            return np.zeros((3, 3))
        weights = np.array([one.probability for one in self.hypotheses])
        weights = weights / weights.sum()
        away = np.array([one.displacement for one in self.hypotheses]) - self.hypotheses[0].displacement
        weights = np.where(np.square(away).sum(axis=1) > limit_m**2, weights, 0.0)
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
    pending: Pending | None = None,
    twins: Twins = NO_TWINS,
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
        pending: what the pair before told, if it was not believed; None otherwise.
        twins: what else looks like the ring.
    """
    believed = 0.0 if pending is None else pending.probability
    unmoved = math.log(1.0 - tuning.surge_probability - tuning.jump_probability) + math.log1p(-believed)
    # Each worked out once for all detections.
    ways: list[Way] = [
        (unmoved, lambda: motion),
        (math.log(tuning.surge_probability), cache(motion.surged)),
        (math.log(tuning.jump_probability), cache(lambda: motion.moved_by_hand(tuning.jump_reach_m))),
    ]
    if pending is not None:
        told = pending.motion
        ways.insert(0, (math.log(believed), lambda: told))
    usual_sigma = math.hypot(tuning.usual_sigma, tuning.flattery / (sightings + 1))
    foreseen = motion.predict(time_s)
    hypotheses = [
        _hypothesis(
            detection,
            _usualness(detection.support, usual, usual_sigma, tuning),
            foreseen,
            ways,
            1 if pending is None else 2,
            time_s,
            times,
            model,
            tuning,
        )
        for detection in detections
    ]
    if not hypotheses:
        return Association((), 1.0)
    rings = tuple(one.detection for one in hypotheses if one.is_whole and one.looks >= tuning.plainly)
    if twins.known:
        hypotheses = [
            replace(one, log_odds=one.log_odds + twins.log_odds(one.detection, rings)) if one.is_whole else one
            for one in hypotheses
        ]
    log_odds = np.array([one.log_odds for one in hypotheses])
    probabilities = np.exp(log_odds - np.logaddexp.reduce([0.0, *log_odds]))
    weighed = [replace(one, probability=float(share)) for one, share in zip(hypotheses, probabilities, strict=True)]
    weighed.sort(key=lambda one: -one.probability)
    best, others = weighed[0], [one for one in weighed[1:] if one.probability >= tuning.weight_kept]
    believed = best.probability + sum(one.probability for one in others if best.is_beside(one, tuning.beside_m))
    return Association((replace(best, believed=believed), *others), max(0.0, 1.0 - float(probabilities.sum())), rings)


def _hypothesis(
    detection: Detection,
    usualness: float,
    foreseen: Estimate,
    ways: Sequence[Way],
    least: int,
    time_s: float,
    times: Mapping[Plane, float],
    model: LoopModel,
    tuning: AssociationTuning,
) -> Hypothesis:
    """What a detection is worth, by how it looks and the ways in which the ring may have got there.

    Each way is its log probability, and the motion by it; so many at least are tried.
    """
    clutter = _clutter_density(detection, tuning)
    odds: list[float] = []
    outcomes: list[Outcome[RespiratoryMotion]] = []
    a, b = (detection.observation(plane, model.centre) if plane in detection.planes else None for plane in PLANES)
    for prior, motion in ways:
        outcome = motion().outcome(time_s, a, times.get("b", time_s), b)
        odds.append(prior + outcome.likelihood - clutter)
        outcomes.append(outcome)
        # The first way that explains it will do: more of them add nothing.
        if len(odds) >= least and max(odds) > 0.0:
            break
    motion_odds = float(np.logaddexp.reduce(odds)) if len(odds) > 1 else odds[0]
    outcome = outcomes[odds.index(max(odds))]
    gap_mm, slack_mm, along_mm = _disagreement(detection, outcome.between, model)
    looks = [_look_odds(fit, detection.alignment.likeness[plane], tuning) for plane, fit in detection.planes.items()]
    log_odds = sum(looks) + _place_odds(outcome.at_a.displacement - foreseen.displacement, foreseen.covariance, tuning)
    if len(detection.planes) == len(PLANES):
        log_odds += _gap_odds(1e-3 * gap_mm, 1e-3 * slack_mm, tuning)
    # Which shows whatever the ring does, and anything else.
    alike = tuning.alike / (tuning.alike + usualness * math.exp(motion_odds))
    return Hypothesis(detection, outcome, log_odds, gap_mm, slack_mm, along_mm, alike, min(looks))


def _look_odds(fit: PlaneFit, likeness: float, tuning: AssociationTuning) -> float:
    """Log odds that a plane shows the ring there, by how it looks."""
    wire = min(fit.wire, tuning.most_wire)
    shown = tuning.by_evidence * fit.evidence + tuning.by_wire * wire + tuning.by_visible * fit.visible
    blur = math.log(max(math.sqrt(float(fit.covariance.trace())), tuning.sharpest_m) / tuning.blur_m)
    odds = tuning.nothing + shown + tuning.by_likeness * likeness + tuning.by_blur * blur
    return -math.log(math.exp(-odds) + tuning.plainest)


def _gap_odds(gap_m: float, slack_m: float, tuning: AssociationTuning) -> float:
    """Log odds by how far the planes' rays pass each other, metres, and what the motion may do to that."""
    ring = (1.0 - tuning.gap_else) * _normal(gap_m, 0.0, math.hypot(slack_m, tuning.gap_sigma_m))
    ring += tuning.gap_else / (2.0 * tuning.largest_gap_m)
    return math.log(ring * 2.0 * (tuning.clutter_gap_m + tuning.clutter_slacks * slack_m))


def _place_odds(away: Array, covariance: Array, tuning: AssociationTuning) -> float:
    """Log odds by how far (3,) m it is from where it was foretold, with (3, 3) m² of that: 0 at best.

    Being there proves nothing: what looks like the ring is often right beside it.
    """
    spread = covariance + tuning.foretold_m**2 * _IDENTITY_3
    distance = squared_mahalanobis(away, spread)
    widening = math.log(largest_sigma(spread) / tuning.foretold_m)
    return math.log((1.0 + distance) ** -2 + tuning.anywhere) + tuning.by_spread * widening


def _usualness(support: float, usual: float, usual_sigma: float, tuning: AssociationTuning) -> float:
    """Density of a support of the ring, relative to that of what is usual.

    Far less than usual is seldom the ring's, however little else shows as much: a ring that is half drawn into its
    sheath looks like a ring, too.
    """

    def density(value: float) -> float:
        likely = _normal(value, usual, usual_sigma)
        return (1.0 - tuning.unlike) * likely + tuning.unlike / tuning.range_support

    return density(support) / density(usual)


def _disagreement(detection: Detection, between: Estimate | None, model: LoopModel) -> tuple[float, float, float]:
    """How far the planes' rays pass each other, what the motion between their exposures may do to that, mm.

    Args:
        detection: seen by both.
        between: where plane B should have it by plane A; None where one plane is alone.
        model: the ring at the seed pair.

    Returns:
        These, and how far the ring has gone in that direction as both planes have it; zeros where one is alone.
    """
    if between is None:
        return 0.0, 0.0, 0.0
    gap, across = detection.gap(model.centre + between.displacement)
    middle = 0.5 * (detection.planes["a"].centre + detection.planes["b"].centre)
    along = float(across @ (middle - model.centre))
    return 1e3 * gap, 1e3 * math.sqrt(across @ between.covariance @ across), 1e3 * along


def _clutter_density(detection: Detection, tuning: AssociationTuning) -> float:
    """Log probability density of finding something else there: anywhere in view, the planes nearly agreeing."""
    reach, gap = math.log(tuning.view_m), math.log(tuning.agreement_m)
    return -2.0 * reach if len(detection.planes) == 1 else -3.0 * reach - gap


def _normal(value: float, mean: float, sigma: float) -> float:
    return math.exp(-0.5 * ((value - mean) / sigma) ** 2) / (math.sqrt(2.0 * math.pi) * sigma)
