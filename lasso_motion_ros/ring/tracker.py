"""Our method: predict, detect, associate, validate, update, report."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.catheters import named
from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import SeedError, TrackingError
from lasso_motion_ros.geometry.covariance import largest_sigma
from lasso_motion_ros.geometry.frames import Frame, FramePair, Seed
from lasso_motion_ros.motion.breathing_prior import breathing_shape
from lasso_motion_ros.motion.heartbeat import Beats
from lasso_motion_ros.motion.motion_model import Estimate
from lasso_motion_ros.motion.respiration import RespiratoryMotion
from lasso_motion_ros.ring.association import Association, Hypothesis, associate
from lasso_motion_ros.ring.breathing_curve import BreathingCurve
from lasso_motion_ros.ring.companions import Companions
from lasso_motion_ros.ring.detector import Expectation, RingDetector
from lasso_motion_ros.ring.display_chain import DisplayChain
from lasso_motion_ros.ring.electrodes import RingEvidence
from lasso_motion_ros.ring.looks import Look, Looks
from lasso_motion_ros.ring.loop_model import LoopModel
from lasso_motion_ros.ring.own_turn import OwnTurn
from lasso_motion_ros.ring.plane_contradiction import PlaneContradiction
from lasso_motion_ros.ring.ring_options import RingOptions
from lasso_motion_ros.ring.seed_agreement import seed_agreement
from lasso_motion_ros.ring.seed_curves import build_loop_model
from lasso_motion_ros.ring.seed_place import require_clicked_place
from lasso_motion_ros.ring.seed_shape import require_loop_of_clicks, shape_doubt
from lasso_motion_ros.ring.seed_template import seed_template
from lasso_motion_ros.ring.slide import Slide
from lasso_motion_ros.ring.track import Track
from lasso_motion_ros.ring.track_result import covariance_since_reference, with_curve, with_pose, without_pose
from lasso_motion_ros.ring.twins import Twins
from lasso_motion_ros.ring.validation import (
    contradiction,
    drawn_in,
    fading,
    left_behind,
    misleading,
    out_of_place,
    quality,
    refusal,
    shows_looks,
    unforeseen,
)
from lasso_motion_ros.ring.withdrawal import Withdrawal
from lasso_motion_ros.ring.working_image import WholeImages
from lasso_motion_ros.tracking.stages import Stages, no_stages
from lasso_motion_ros.tracking.tracker import TrackerState, TrackResult

Array = npt.NDArray[np.float64]


class RingTracker:
    """Follows one ring; publishes nothing that is not believed.

    Args:
        config: the parameters.
        stages: told of each stage of the work on a pair.
        options: what an ablation changes.
    """

    def __init__(self, config: TrackerConfig, stages: Stages = no_stages, options: RingOptions | None = None) -> None:
        self._config = config
        self._stages, self._options = stages, options or RingOptions()
        self._track: Track | None = None

    def initialise(self, pair: FramePair, seed: Seed) -> TrackResult:
        """Build model and template from the clicks on `pair`; its motion is the identity.

        Raises:
            SeedError: clicks that are too few or outside the image, a pair that lacks a plane, planes that disagree by
                more than any usable calibration, or a ring of no lasso's size or shape.
            ReconstructionError: no 3-D loop explains the clicks.
        """
        whole = WholeImages(pair.frames)
        model = build_loop_model(pair, seed, self._config, self._options.points, whole)
        require_loop_of_clicks(seed)
        # Nothing is kept until all has succeeded: a refused seed leaves the tracker as it was.
        self._track, result = self._started(pair, whole, model)
        return result

    def begin(
        self,
        pair: FramePair,
        model: LoopModel,
        whole: WholeImages | None = None,
        *,
        least_support: float = -math.inf,
    ) -> Track:
        """Begin with a ring whose curve is known, on `pair`, as `initialise` does.

        Args:
            pair: both planes.
            model: the curve.
            whole: the pair's working images, where others ask for them, too.
            least_support: what the pair has to show of it.

        Returns:
            What is known of the ring; it is what `known` gives until another seed.

        Raises:
            SeedError: less support, planes that disagree by more than any usable calibration, or a ring of no lasso's
                shape.
        """
        self._track, _ = self._started(pair, whole or WholeImages(pair.frames), model, least_support)
        return self._track

    def _started(
        self, pair: FramePair, whole: WholeImages, model: LoopModel, least_support: float = -math.inf
    ) -> tuple[Track, TrackResult]:
        """A track of a model, begun on the seed pair."""
        options, frames, catheter = self._options, pair.frames, named(self._config.catheter)
        view, template, seen = seed_template(model, whole, options.template, options.detection)
        if seen.support < least_support:
            raise SeedError(f"the pair shows {seen.support:.2f} of the ring, expected at least {least_support:.2f}")
        model, at_seed = view.model, view.displacement(template)
        agreement = seed_agreement(model, pair, self._config.judgement).doubted(shape_doubt(model, catheter))
        detector = RingDetector(model, template, pair.stamp_ns, options.detector, options.detection, self._stages)
        projections = {plane: frame.projection for plane, frame in frames.items()}
        motion = RespiratoryMotion(
            0.0,
            max(0.0, detector.seconds(frames["b"].stamp_ns)),
            shape=breathing_shape(projections, self._config.posture),
            between=model.between,
            beats=_beats(pair, detector),
        )
        anywhere = Expectation(motion, np.zeros(3), 0.0, seen.support, is_followed=False)
        require_clicked_place(detector.detect(pair, anywhere, self._config, whole), model)
        track = Track(
            model=model,
            seed=view,
            template=template,
            detector=detector,
            looks=Looks(Look.first(pair, model)) if options.refined else None,
            display=DisplayChain(options.display),
            motion=motion,
            curve=BreathingCurve(np.zeros(3), 0.0, options.curve),
            start_ns=pair.stamp_ns,
            agreement=agreement,
            companions=Companions(options.companions),
            contradiction=PlaneContradiction.first(options.contradiction),
            twins=Twins(options.twins),
            withdrawal=Withdrawal.first(options.withdrawal),
            electrodes=RingEvidence(model.points, template.shown, model.diameter_mm, catheter),
            own_turn=OwnTurn.expected(np.radians(self._config.ring.turn_deg)),
            usual_support=seen.support,
            contrast={plane: fit.contrast for plane, fit in seen.alignment.planes.items()},
            reference_ns=pair.stamp_ns,
            reference_covariance=at_seed.covariance,
        )
        track.companions.find(pair, model, dict.fromkeys(frames, model.centre))
        track.display.undone(pair)  # the seed pair is used as it is: its filter's state before is not there
        state = TrackerState.DEGRADED if agreement.doubt else TrackerState.TRACKING
        result = without_pose(track, pair, state, agreement.doubt)
        result = with_pose(result, track, covariance_since_reference(track, track.motion.at_a.covariance, None))
        return track, result.with_loop(track.model.points + track.depth_correction)

    def track(self, pair: FramePair) -> TrackResult:
        """Find the ring in the next pair.

        Raises:
            TrackingError: no model yet.
        """
        track, options, config = self._require_track(), self._options, self._config
        self._learn_late(track)
        time_s = track.begin(pair.stamp_ns)
        track.hear(_beats(pair, track.detector))
        pending, track.pending = track.pending, None  # of the last pair, and no other one
        with self._stages("display filter"):
            pair = track.display.undone(pair)
        if planes := track.display.too_strong:
            names = " and ".join(plane.upper() for plane in planes)
            return self._lost(track, pair, f"too strong a filter over time in plane {names}: the images show what was")
        # Predict, and detect all places that show something like the ring.
        with self._stages("detection"):
            detections = track.detector.detect(pair, _expectation(track), config)
        # Associate: which of them is the ring, if any?
        with self._stages("filter"):
            times = track.detector.exposures(pair)
            association = associate(
                detections,
                track.motion,
                time_s,
                times,
                track.model,
                track.usual_support,
                track.sightings,
                options.association,
                pending,
                track.twins,
            )
        # Validate: is it believed, and is it in its place?
        with self._stages("judgement"):
            departure = self._believe(track, pair, association, time_s)
            reason = refusal(track, association, pair, config.judgement, options.validation, options.state)
        best = association.best
        track.pending = association.pending(options.state.pose, options.association)
        if best is not None and best.is_whole and best.believed >= options.state.pose:
            track.unlearned_turn = track.home_turn + track.turn_of(best)
        if best is not None and shows_looks(track, best, config.judgement, options.validation, options.state):
            track.unlearned = pair, best
            track.twins = track.twins.after(best.detection, association.rings)
        track.last_support = -1.0 if best is None else best.detection.support
        if best is None or reason:
            return self._lost(track, pair, reason)
        if reason := fading(track, best, options.validation):
            track.remember_contrast(best)
            return self._lost(track, pair, reason)
        track.see(best)
        if track.belief.elsewhere > options.state.displaced:
            return self._displaced(track, pair, best, departure)
        if track.belief.in_place < options.state.pose:
            track.curve.see_aside(time_s, best.displacement, is_whole=best.is_whole)
            return self._lost(track, pair, out_of_place(track, departure, options.state))
        if reason := unforeseen(best, config.judgement, options.validation, options.state):
            return self._lost(track, pair, reason)
        # Update.
        with self._stages("judgement"):
            state, reason = quality(track, best, pair, config.judgement, options.validation, options.state)
        with self._stages("learning"):
            position = self._update(track, best, association, time_s, state)
            position = position + track.display.covariance(track.way(track.seen_at))
        # Report.
        with self._stages("report"):
            position = covariance_since_reference(track, position, best)
            misleads, doubt = misleading(track, position, association, best, options.state)
            denied = contradiction(track, options.state) or drawn_in(track, options.state)
            if denied or misleads > options.state.misleads_pose:
                # It is seen, and followed and learned on; only no pose rests on it.
                track.displacement = None
                return without_pose(track, pair, TrackerState.LOST, denied or doubt)
            if misleads > options.state.misleads_tracking and not reason:
                state, reason = TrackerState.DEGRADED, doubt
            result = with_curve(track, pair, state, reason, best, np.radians(config.ring.turn_deg))
            return with_pose(result, track, position)

    def prepare(self, frame: Frame) -> None:
        """Undo, predict and search in plane A's frame, before plane B's has come: see `Tracker.prepare`."""
        if self._track is not None:
            self._learn_late(self._track)
            undone = self._track.display.undone_ahead("a", frame)
            self._track.detector.prepare(undone, _expectation(self._track), self._config)

    def learn(self) -> None:
        """Learn from the last pair what its answer did not wait for: see `Tracker.learn`."""
        if self._track is not None:
            self._learn_late(self._track)

    def leave_out(self, pair: FramePair) -> None:
        """Take note of a pair for which there is no time: the display's filter holds of it what the next one shows."""
        if self._track is not None:
            self._track.display.undone(pair)

    def _believe(self, track: Track, pair: FramePair, association: Association, time_s: float) -> float:
        """Renew the belief; returns how far from breathing the best place is, in standard deviations."""
        best, states, departure, denied, slid = association.best, self._options.state, 0.0, 0.0, 0.0
        is_back, turned = False, 0.0
        if best is not None:
            covariance = best.at_a.covariance + association.spread
            sigma_m = largest_sigma(covariance + track.motion.heartbeat_sideways)
            is_away = track.belief.away > states.displaced
            is_believed = best.believed >= states.pose
            foretold = track.model.centre + track.motion.predict(time_s).displacement
            denied = track.companions.look(time_s, pair, best.detection, foretold, is_believed=is_believed)
            companions = track.companions.slide
            # Where they told that it was displaced and now that it is back, its own past, full of where it was, need
            # not tell.
            is_back = track.was_told_away and track.belief.in_place < states.pose and companions.is_known
            track.slide = Slide() if is_back else track.curve.slide(time_s, best.displacement)
            # Once they are gone, what they told holds undoubted: nothing tells that the ring is back.
            track.joined_slide = companions.joined(track.slide) if companions.is_told else companions
            slid = math.sqrt(2.0 * max(track.joined_slide.log_odds(states.misleading_m), 0.0))
            alone = Slide() if companions.is_told else track.slide
            departure = track.curve.departure_sigmas(time_s, best.displacement, sigma_m, alone, is_away=is_away)
            sideways = track.motion.sideways_sigmas(time_s, Estimate(best.displacement, covariance))
            departure = max(departure, sideways / states.surprise(time_s, is_complete=track.curve.is_complete))
            if best.is_whole:
                if is_believed:
                    shown = {plane: fit.shown for plane, fit in best.detection.planes.items()}
                    track.withdrawal = track.withdrawal.after(shown, track.template.shown)
                turned = track.own_turn.log_odds_of_a_hand(track.home_turn + track.turn_of(best), track.home_turn)
                if not is_away and is_believed:
                    track.contradiction = track.contradiction.after(time_s, best.gap_mm, best.slack_mm, best.along_mm)
            elif is_away:  # that a displaced ring is back, both planes have to show
                departure = max(departure, states.elsewhere_sigmas)
        seen = 1.0 - association.absent
        track.belief = track.belief.after(track.interval_s, seen, max(departure, slid), states, denied, turned)
        if track.belief.in_place >= states.pose:
            if is_back:
                track.curve.forget_aside()
            track.was_told_away = False
        elif track.joined_slide.beyond(states.misleading_m) > 0.5:
            track.was_told_away = True
        return departure

    def _update(
        self, track: Track, best: Hypothesis, association: Association, time_s: float, state: TrackerState
    ) -> Array:
        """Take in what was seen, and learn from it where both planes show it; (3, 3) m² of the displacement."""
        track.is_followed = True
        if not best.is_whole:
            return track.take_alone(best, time_s) + association.spread
        track.motion, track.displacement = best.motion, best.displacement
        track.learn_motion(best, time_s)
        track.companions.accept()
        if state is TrackerState.TRACKING and self._options.rotation:
            track.learn_rotation(best, time_s)
        return np.asarray(track.motion.at_a.covariance + association.spread)

    def _learn_late(self, track: Track) -> None:
        with self._stages("learning"):
            track.learn_late()

    def _lost(self, track: Track, pair: FramePair, reason: str) -> TrackResult:
        track.is_followed = False
        return without_pose(track, pair, TrackerState.LOST, reason)

    def _displaced(self, track: Track, pair: FramePair, best: Hypothesis, departure: float) -> TrackResult:
        track.is_followed, track.displacement = False, best.displacement
        track.curve.see_aside(track.last_s, best.displacement, is_whole=best.is_whole)
        far = f"it has left its breathing: {departure:.0f} times as far as breaths are apart"
        reason = left_behind(track, departure, self._options.state) or far
        prior_rad = float(np.radians(self._config.ring.turn_deg))
        return with_curve(track, pair, TrackerState.DISPLACED, reason, best, prior_rad)

    def reset(self) -> None:
        """Forget model and motion."""
        self._track = None

    def reconfigure(self, config: TrackerConfig) -> None:
        """Go on with other tuning parameters; the model is kept."""
        self._config = config

    def set_reference(self) -> None:
        """Make the present phase the reference; a ring that was moved is taken to be where it belongs.

        Raises:
            TrackingError: no model yet, or the lasso is not seen.
        """
        track = self._require_track()
        if track.displacement is None:
            raise TrackingError("the lasso is not being tracked: there is no present phase to refer to")
        self._learn_late(track)
        track.refer_to_now()
        if track.belief.elsewhere > self._options.state.displaced:
            # It belongs where and as it lies now; what was learned of the breathing, but not of its place, still holds.
            track.settle(BreathingCurve(track.displacement, track.last_s, self._options.curve))

    @property
    def known(self) -> Track | None:
        """All that is known of the ring; None without a model."""
        return self._track

    def _require_track(self) -> Track:
        if self._track is None:
            raise TrackingError("there is no model to track: seed the tracker first")
        return self._track


def _beats(pair: FramePair, detector: RingDetector) -> Beats | None:
    """The heart's beats by the R peaks known with a pair; None where too few are."""
    return Beats.of([detector.seconds(peak) for peak in pair.r_peaks_ns])


def _expectation(track: Track) -> Expectation:
    """What is known before the next pair is looked at."""
    twins = np.array([twin.offset for twin in track.twins.known]).reshape(-1, 3)
    return Expectation(track.motion, track.turn, track.stretch, track.usual_support, track.is_followed, twins)
