"""All that is known of one ring from its seed on, whole from the first line."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import FramePair, Plane
from lasso_motion_ros.motion.breathing_depth import BreathingDepth
from lasso_motion_ros.motion.breathing_rotation import BreathingRotation
from lasso_motion_ros.motion.heartbeat import Beats
from lasso_motion_ros.motion.motion_model import Estimate
from lasso_motion_ros.motion.respiration import RespiratoryMotion
from lasso_motion_ros.ring.association import Hypothesis, Pending
from lasso_motion_ros.ring.breathing_curve import BreathingCurve
from lasso_motion_ros.ring.companion_slide import CompanionSlide, CompanionSlideTuning
from lasso_motion_ros.ring.companions import Companions
from lasso_motion_ros.ring.detector import RingDetector
from lasso_motion_ros.ring.display_chain import DisplayChain
from lasso_motion_ros.ring.electrodes import RingEvidence
from lasso_motion_ros.ring.looks import Look, Looks
from lasso_motion_ros.ring.loop_model import LoopModel
from lasso_motion_ros.ring.own_turn import OwnTurn
from lasso_motion_ros.ring.plane_contradiction import PlaneContradiction
from lasso_motion_ros.ring.refined_model import refined_model
from lasso_motion_ros.ring.seat import Seat, SeatTuning
from lasso_motion_ros.ring.seed_agreement import SeedAgreement
from lasso_motion_ros.ring.seed_template import SeedView
from lasso_motion_ros.ring.slide import Slide
from lasso_motion_ros.ring.template import RingTemplate
from lasso_motion_ros.ring.track_state import TrackBelief
from lasso_motion_ros.ring.twins import Twins
from lasso_motion_ros.ring.withdrawal import Withdrawal

Array = npt.NDArray[np.float64]

USUAL_SHARE = 0.1  # at least, of the newest pair, in what is usual: at first it is their mean
SMALLEST_CONTRAST = 1e-6
# Pairs after which the electrodes, and the seed pair, are looked at anew: each time some twice as many.
LOOKED_AT_AFTER = (2, 4, 10, 24)


@dataclass(eq=False)
class Track:
    """One ring.

    Attributes:
        model: the ring at the seed pair.
        seed: that pair, about the ring.
        template: what it looks like.
        detector: finds it.
        display: undoes the display's filter over time.
        motion: of its centre, filtered.
        curve: where breathing has taken it.
        start_ns: stamp of the seed pair.
        agreement: of the planes at the seed: what the calibration is worth.
        companions: what moves with the heart beside it.
        contradiction: of the planes since: whether one of them shows something else.
        twins: what else looks like it, and where.
        withdrawal: whether a part of it is gone, in both planes the same.
        electrodes: what both planes show along its curve.
        own_turn: how far it turns by itself.
        usual_support: what they show of it now.
        sightings: pairs in which it was believed to be seen.
        last_support: what the planes showed at the best place in the last pair; -1 where none was found.
        contrast: per plane, of the ring when last seen, as a share of the grey behind it.
        depth: how its depth follows from where one plane has it.
        seat: how far it goes to and fro in its place.
        rotation: the part of its turning that follows the breath.
        belief: whether it is in its place, elsewhere, or out of view.
        slide: whether it has slid off its place by the last pair, as its own past tells.
        joined_slide: how far it has slid from its companions by the last pair, its own past considered where they tell.
        was_told_away: they have told that it was displaced since it was in its place last.
        last_s: time of the last pair, seconds since the seed pair.
        interval_s: between the last two pairs, seconds.
        displacement: (3,) m of its centre in the last pair, in its place or displaced; None where it is not believed.
        alone: (3, 3) m² of that displacement where one plane alone showed it; None where both did, or none.
        seen_before: (3,) m, the displacement in the last pair before it in which the ring was believed to be seen.
        seen_before_s: time of that pair, seconds since the seed pair.
        turn: (3,) rotation vector, rad, to start the next alignment from.
        stretch: logarithm of its size, likewise.
        last_turn: (3,) rotation vector of the ring when last seen, rad.
        home_turn: (3,) rotation vector of the ring as it belongs, rad.
        last_stretch: logarithm of its size when last seen.
        home_stretch: likewise as it belongs.
        home: (3,) displacement at which it belongs, metres: zero until it was said to belong elsewhere.
        reference: (3,) displacement at the reference pair, metres.
        reference_ns: stamp of the reference pair.
        reference_covariance: (3, 3) m² of the reference's displacement.
        looks: at it, from which its model is made anew; None where it is known as well as it will be.
        is_followed: whether the prediction is worth a look about it.
        pending: where it may have been in the last pair, which did not show it surely enough; None where it did.
        unlearned: where it was seen last, whose looks are to be learned before the next pair; None where they are.
        unlearned_turn: likewise, (3,) rad, how it was turned by `turn_of`, refused for that or not: later pairs are
            judged by it.
        unlearned_motion: likewise whose motion is, and the time of that pair, seconds since the seed pair.
    """

    model: LoopModel
    seed: SeedView
    template: RingTemplate
    detector: RingDetector
    display: DisplayChain
    motion: RespiratoryMotion
    curve: BreathingCurve
    start_ns: int
    agreement: SeedAgreement
    companions: Companions
    contradiction: PlaneContradiction
    twins: Twins
    withdrawal: Withdrawal
    electrodes: RingEvidence
    own_turn: OwnTurn
    usual_support: float
    contrast: dict[Plane, float]
    depth: BreathingDepth = field(default_factory=lambda: BreathingDepth.first(0.0, np.zeros(3)))
    seat: Seat = field(default_factory=lambda: Seat.first(SeatTuning()))
    rotation: BreathingRotation = field(default_factory=BreathingRotation)
    belief: TrackBelief = field(default_factory=TrackBelief)
    slide: Slide = field(default_factory=Slide)
    joined_slide: CompanionSlide = field(default_factory=lambda: CompanionSlide.first(CompanionSlideTuning()))
    was_told_away: bool = False
    sightings: int = 0
    last_support: float = -1.0
    last_s: float = 0.0
    interval_s: float = 0.0
    displacement: Array | None = field(default_factory=lambda: np.zeros(3))
    alone: Array | None = None
    seen_before: Array = field(default_factory=lambda: np.zeros(3))
    seen_before_s: float = 0.0
    turn: Array = field(default_factory=lambda: np.zeros(3))
    stretch: float = 0.0
    last_turn: Array = field(default_factory=lambda: np.zeros(3))
    home_turn: Array = field(default_factory=lambda: np.zeros(3))
    last_stretch: float = 0.0
    home_stretch: float = 0.0
    home: Array = field(default_factory=lambda: np.zeros(3))
    reference: Array = field(default_factory=lambda: np.zeros(3))
    reference_ns: int = 0
    reference_covariance: Array = field(default_factory=lambda: np.zeros((3, 3)))
    looks: Looks | None = None
    is_followed: bool = True
    pending: Pending | None = None
    unlearned: tuple[FramePair, Hypothesis] | None = None
    unlearned_turn: Array | None = None
    unlearned_motion: tuple[Hypothesis, float] | None = None

    def begin(self, stamp_ns: int) -> float:
        """Go on to the next pair; returns its time, seconds since the seed pair."""
        time_s = self.detector.seconds(stamp_ns)
        if self.displacement is not None:
            self.seen_before, self.seen_before_s = self.displacement, self.last_s
        self.interval_s, self.last_s, self.displacement = time_s - self.last_s, time_s, None
        self.alone = None
        self.last_support, self.slide, self.joined_slide = -1.0, Slide(), self.companions.slide
        return time_s

    def hear(self, beats: Beats | None) -> None:
        """Take note of the heart's beats as they are known with a pair."""
        self.motion = self.motion.hearing(beats)
        if self.pending is not None:
            self.pending = replace(self.pending, motion=self.pending.motion.hearing(beats))

    def way(self, displacement: Array) -> Array:
        """(3,) m that the ring has come since the last pair; where that did not show it, its share of the way by time.

        Args:
            displacement: (3,) m of the ring now.
        """
        since_s = self.last_s - self.seen_before_s
        return np.asarray((displacement - self.seen_before) * (self.interval_s / since_s if since_s > 0.0 else 1.0))

    def turn_of(self, best: Hypothesis) -> Array:
        """(3,) rotation vector by which a detection is turned from how the ring belongs, rad.

        Not what comes of its being wider or narrower: the wire comes from the shaft, and electrodes keep their
        distances along it. On a turn of wire that is longer by a share s they lie behind by s times their way, by π s
        on average, as if it had spun about its axis; which way hangs on how it is wound.
        """
        own, axis = best.detection.alignment.turn - self.home_turn, self.model.axis
        drawn_rad = math.pi * abs(best.detection.alignment.stretch - self.home_stretch)
        spin_rad = float(axis @ own)
        return np.asarray(own - min(max(spin_rad, -drawn_rad), drawn_rad) * axis)

    def see(self, best: Hypothesis) -> None:
        """Take note of how a ring looks that is believed to be this one, wherever it lies."""
        self.sightings += 1
        share = max(USUAL_SHARE, 1.0 / (self.sightings + 1.0))
        self.usual_support += share * (best.detection.support - self.usual_support)
        self.last_turn, self.last_stretch = best.detection.alignment.turn, best.detection.alignment.stretch
        self.remember_contrast(best)

    def remember_contrast(self, best: Hypothesis) -> None:
        """Take the contrast of what was detected for that of the ring when last seen.

        Not what is usual: a trace in a filter over time fades from pair to pair, another window of the images stays.
        """
        for plane, fit in best.detection.planes.items():
            self.contrast[plane] = max(fit.contrast, SMALLEST_CONTRAST)

    def take_alone(self, best: Hypothesis, time_s: float) -> Array:
        """Take in where one plane alone shows it, with the depth that its breathing tells; (3, 3) m² of that place."""
        (fit,) = best.detection.planes.values()
        self.motion = best.motion
        place = self.depth.with_depth(time_s, self.motion.at_a, fit.ray, self.motion.way, self.motion.heartbeat)
        self.displacement, self.depth = place.displacement, self.depth.passed(time_s, place.displacement)
        self.curve.see(time_s, place.displacement, is_whole=False)
        self.alone = place.covariance
        return place.covariance

    def learn_motion(self, best: Hypothesis, time_s: float) -> None:
        """Learn how it breathes, and lies: at once where that revises the displacement, else with how it looked.

        Between two late phases nothing changes by the revision: the reference is revised alike.
        """
        if not self.motion.is_revised_next:
            self.unlearned_motion = best, time_s
            return
        before = self.motion.at_a.displacement
        self._take_for_breathing(best, time_s)
        revised = self.motion.at_a.displacement
        if self.reference_ns != self.start_ns:
            self.reference = self.reference + revised - before
        self.displacement = revised

    def _take_for_breathing(self, best: Hypothesis, time_s: float) -> None:
        self.curve.accept(time_s, best.displacement)
        self.depth = self.depth.seen(time_s, best.at_a)
        noise = best.at_a.covariance + self.motion.heartbeat
        self.seat = self.seat.seen(time_s, best.displacement, noise, self.motion.way)
        self.motion.learn(best.displacement)
        # Half of what the heartbeat did to it is the best guess for the next pair.
        self.turn, self.stretch = 0.5 * best.detection.alignment.turn, 0.5 * best.detection.alignment.stretch

    def learn_late(self) -> None:
        """Learn how it moved and looked last, if that is not done yet: that pair's answer does not wait for it."""
        turn, self.unlearned_turn = self.unlearned_turn, None
        if turn is not None:
            self.own_turn = self.own_turn.seen(turn, self.home_turn)
        moved, self.unlearned_motion = self.unlearned_motion, None
        if moved is not None:
            self._take_for_breathing(*moved)
        self.companions.learn(self.model)  # by the model with which it was found
        self._learn_template()

    def _learn_template(self) -> None:
        seen, self.unlearned = self.unlearned, None
        if seen is None:
            return
        pair, best = seen
        fits = best.detection.planes
        is_renewed = self.template.learn(
            {plane: fit.strip for plane, fit in fits.items()},
            {plane: fit.shown for plane, fit in fits.items()},
            {plane: fit.correlation for plane, fit in fits.items()},
        )
        if is_renewed and self.looks is not None:
            self.looks = self.looks.after(Look.later(pair, self.model, best.detection.alignment))
        if not is_renewed or self.template.count not in LOOKED_AT_AFTER:
            return
        self._refine_model()
        self.electrodes = replace(self.electrodes, shown=self.template.shown)
        if self.reference_ns == self.start_ns:
            at_seed = self.seed.displacement(self.template)
            self.reference, self.reference_covariance = at_seed.displacement, at_seed.covariance

    def _refine_model(self) -> None:
        if self.looks is None:
            return
        refined = refined_model(self.model, self.looks, self.template.tuning, self.seed.worth)
        if refined is not None:
            before = self.model.centre
            self.seed, self.template = refined
            self.model = self.seed.model
            self.companions.take_centre(self.model.centre - before)
            self.detector = self.detector.looking_for(self.model, self.template)
            self.electrodes = replace(self.electrodes, points=self.model.points, diameter_mm=self.model.diameter_mm)
        if self.template.is_fixed:
            self.looks = None

    def learn_rotation(self, best: Hypothesis, time_s: float) -> None:
        """Learn whether it turns with the breath."""
        alignment = best.detection.alignment
        self.rotation.learn(time_s, self.seen_at - self.home, alignment.turn, alignment.stretch)

    def refer_to_now(self) -> None:
        """Make the last pair the reference."""
        self.reference, self.reference_ns = self.seen_at, self.start_ns + round(self.last_s * 1e9)
        self.reference_covariance = self.motion.at_a.covariance if self.alone is None else self.alone

    def settle(self, curve: BreathingCurve) -> None:
        """Take it that the ring belongs where, and as, it lies now.

        Args:
            curve: of its breathing there.
        """
        self.home, self.home_turn, self.home_stretch = self.seen_at, self.last_turn, self.last_stretch
        self.turn = 0.5 * self.last_turn
        foretold = self.motion.predict(self.last_s)
        depth = self.depth.moved(self.seen_at - foretold.displacement, foretold.covariance)
        depth = depth.passed(self.seen_before_s, self.seen_before)
        self.depth = depth.seen(self.last_s, Estimate(self.seen_at, np.zeros((3, 3))))
        self.motion.move(self.seen_at)
        self.rotation, self.belief, self.curve, self.is_followed = BreathingRotation(), TrackBelief(), curve, True
        self.seat, self.contradiction = self.seat.anew(), self.contradiction.anew()
        self.companions, self.was_told_away = self.companions.anew(self.last_s), False
        self.twins = Twins(self.twins.tuning)

    @property
    def seen_at(self) -> Array:
        """(3,) the displacement in the last pair, metres; zero where the ring was not believed to be seen."""
        return np.zeros(3) if self.displacement is None else self.displacement

    @property
    def depth_correction(self) -> Array:
        """(3,) from the model to where the ring was at plane A's first exposure, metres.

        The model's depth came from plane B's first exposure: what the ring had moved until then put it off.
        """
        ray_a, lateral = self.model.depth_directions
        return np.asarray(-float(lateral @ self.motion.origin_b.displacement) / float(lateral @ ray_a) * ray_a)

    @property
    def centre(self) -> Array:
        """(3,) the ring's centre at plane A's first exposure, world metres."""
        return np.asarray(self.model.centre + self.depth_correction)
