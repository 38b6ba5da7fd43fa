"""Our method: the loop is found by its appearance in both planes, its motion filtered in time, and judged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import TrackingError
from lasso_motion_ros.geometry.covariance import at_world_origin
from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane, Seed
from lasso_motion_ros.geometry.transforms import rotation_from_vector
from lasso_motion_ros.motion.breathing_prior import breathing_shape
from lasso_motion_ros.motion.breathing_rotation import BreathingRotation, Rotation
from lasso_motion_ros.motion.respiration import RespiratoryMotion
from lasso_motion_ros.ring.alignment import Alignment
from lasso_motion_ros.ring.appearance import Appearance, strip_along
from lasso_motion_ros.ring.finding import Finding, observe
from lasso_motion_ros.ring.foresight import Foresight, Trial, surprise_of
from lasso_motion_ros.ring.judgement import BreathingEnvelope
from lasso_motion_ros.ring.loop_finder import LoopFinder
from lasso_motion_ros.ring.loop_model import POINTS, LoopModel, build_loop_model
from lasso_motion_ros.ring.ring_lay import RingLay
from lasso_motion_ros.ring.uncertainty import calibration_covariance, pivot_covariance
from lasso_motion_ros.ring.verdict import refusal_of, state_of
from lasso_motion_ros.ring.working_image import working_image
from lasso_motion_ros.tracking.stages import Stages, no_stages
from lasso_motion_ros.tracking.tracker import RingMotion, TrackerState, TrackResult

Array = npt.NDArray[np.float64]

# A pose that rests on one plane is not published where its depth may be this far off (standard deviation).
LARGEST_ONE_PLANE_SIGMA_MM = 1.8
# Two planes that are exposed one after the other know the depth as badly at first; then the state is DEGRADED.
LARGEST_SURE_SIGMA_MM = 1.5
LARGEST_SIGMA_MM = 4.0  # and no pose is published, though all is learnt from the pair that such a pair tells
# What is found again after a loss is the lasso only if both planes together show it not much worse than they used to.
FOUND_AGAIN_SHARE = 0.75
GHOST_CONTRAST = 0.55  # of when it was last seen: what remains of a lasso that has gone, in a filter over time
MET_LIKENESS = 0.8  # down to this a fit is weaker and less alike since it did not meet the loop quite where it lies
RESOLVED_SHARE = 0.5  # of the prior's standard deviation: the images tell more than was known before


class AppearanceTracker:
    """Find the loop anywhere, align it to sub-pixel, filter, judge; publish nothing that is not believed.

    Args:
        config: the parameters.
        stages: told of each stage of the work on a pair.
        points: of the model's curve.
    """

    def __init__(self, config: TrackerConfig, stages: Stages = no_stages, *, points: int = POINTS) -> None:
        self._config = config
        self._stages, self._points = stages, points
        self._model: LoopModel | None = None

    def initialise(self, pair: FramePair, seed: Seed) -> TrackResult:
        """Build model and appearance from the clicks on `pair`; its motion is the identity.

        Raises:
            SeedError: clicks that are too few or outside the image, or a pair that lacks a plane.
            ReconstructionError: no 3-D loop explains the clicks.
        """
        model = build_loop_model(pair, seed, self._config, self._points)
        frames = pair.frames
        appearances = {}
        for plane, frame in frames.items():
            image = working_image(frame, model.centre, bright=model.bright, shift=model.shifts[plane])
            strip = strip_along(model.points, image.projection)
            appearances[plane] = Appearance(strip.sample(image), image.contrast_unit(model.centre))
        # Nothing is kept until all has succeeded: a refused seed leaves the tracker as it was.
        self._model = model
        self._axis = np.linalg.svd(model.arms, full_matrices=False)[2][2]  # (3,) of the ring
        self._appearances = appearances
        self._start_ns = pair.stamp_ns
        self._finder = LoopFinder(model, appearances, pair.stamp_ns, self._stages)
        self._respiration = RespiratoryMotion(
            0.0,
            max(0.0, self._seconds(frames["b"].stamp_ns)),
            shape=breathing_shape({plane: frame.projection for plane, frame in frames.items()}, self._config.posture),
            between=model.between,
        )
        self._envelope = BreathingEnvelope(self._config.judgement)
        self._foresight = Foresight()
        self._rotation = BreathingRotation()
        self._reference = np.zeros(3)
        self._reference_stamp_ns = self._last_stamp_ns = pair.stamp_ns
        self._displacement: Array | None = np.zeros(3)
        self._turn, self._stretch = np.zeros(3), 0.0  # to start the next alignment from
        self._lay = RingLay()
        self._home = np.zeros(3)
        self._reference_covariance = np.zeros((3, 3))
        self._displaced = ""
        # Time, displacement and correlations when last seen there.
        self._displaced_place: tuple[float, Array, dict[Plane, float]] = 0.0, np.zeros(3), {}
        self._lost = False
        self._followed = True  # what was found in the pair before was believed
        self._doubt = 1.0
        self._both_seen_s = 0.0
        return self._result(pair, TrackerState.TRACKING, "", model.points + self._depth_correction)

    def track(self, pair: FramePair) -> TrackResult:
        """Find the loop in the next pair.

        Raises:
            TrackingError: no model yet.
        """
        self._require_model()
        time_s = self._seconds(pair.stamp_ns)
        self._last_stamp_ns, self._displacement = pair.stamp_ns, None
        followed, self._followed, self._doubt = self._followed, False, 1.0
        # Where it was not found last time, what the prediction says is worth little: look everywhere at once.
        finding = self._finder.find(
            pair,
            self._respiration,
            config=self._config,
            turn=self._turn,
            stretch=self._stretch,
            near_first=not self._lost,
        )
        self._lost = finding is None or not finding.seen
        if finding is None or not finding.seen:
            return self._result(pair, TrackerState.LOST, "the lasso is not seen", None)
        if refusal := refusal_of(finding, pair, followed=followed):
            return self._result(pair, TrackerState.LOST, refusal, None)
        trial = self._most_plausible(pair, finding, time_s)
        finding, displacement, departure = trial.finding, trial.displacement, trial.departure
        contrast_left = self._contrast_left(finding)
        if contrast_left < GHOST_CONTRAST:
            text = f"only {100 * contrast_left:.0f} % of its contrast is left"
            text += ": gone, and still in the images' filter over time?"
            return self._result(pair, TrackerState.LOST, text, None)
        state, reason = state_of(
            finding,
            pair,
            self._config.judgement,
            alone_s=time_s - self._both_seen_s,
            turned_deg=self._lay.turned_deg(finding.alignment.turn),
        )
        # Where the planes agree, no C-arm has moved unsaid: what lies otherwise, and elsewhere, is a moved lasso.
        agree = len(finding.seen) == 2 and finding.gap_mm <= finding.degraded_gap_mm
        if state is TrackerState.LOST and not (departure and agree):
            return self._result(pair, state, reason, None)
        if not departure and not self._is_back(finding, displacement, time_s):
            departure = self._displaced
        if departure:
            return self._departed(pair, finding, displacement, departure)
        if refusal := self._foresight.refusal(trial):
            if self._foresight.is_sure and 1e3 * np.linalg.norm(trial.unforeseen) > self._config.judgement.displaced_mm:
                return self._departed(pair, finding, displacement, refusal)
            return self._result(pair, TrackerState.LOST, refusal, None)
        if not followed and (refusal := self._return_refusal(finding)):
            return self._result(pair, TrackerState.LOST, refusal, None)
        self._displaced, self._followed = "", True
        self._foresight.accept(trial)
        if len(finding.seen) == 1:
            return self._go_on_with_one(pair, trial, state, reason)
        return self._go_on(pair, trial, state, reason)

    def _contrast_left(self, finding: Finding) -> float:
        """What was found, relative in contrast to what was seen last; from now on this is what was seen last.

        Not relative to what is usual: a trace fades from pair to pair, another window of the images stays.
        """
        shares = []
        for plane in finding.seen:
            appearance, fit = self._appearances[plane], finding.alignment.planes[plane]
            contrast = max(fit.contrast / float(np.clip(fit.likeness, MET_LIKENESS, 1.0)), 1e-6)
            shares.append(contrast / appearance.contrast)
            appearance.contrast = contrast
        return float(np.mean(shares))

    def _return_refusal(self, finding: Finding) -> str:
        """Why what was found after a loss is not yet believed to be the lasso in its place; empty if it is."""
        if refusal := self._lay.return_refusal(finding.alignment.turn):
            return refusal
        if (share := self._share_of_usual(finding, finding.seen)) < FOUND_AGAIN_SHARE:
            return f"what is seen correlates only {100 * share:.0f} % as well as the lasso used to"
        return ""

    def _departed(self, pair: FramePair, finding: Finding, displacement: Array, reason: str) -> TrackResult:
        """DISPLACED, and remembered as such; LOST where too little is seen to condemn it."""
        # One plane alone cannot tell a lasso that was moved from a bad depth, and something else shows less.
        if len(finding.seen) < 2 or self._share_of_usual(finding, PLANES) < FOUND_AGAIN_SHARE:
            return self._result(pair, TrackerState.LOST, reason, None)
        correlations = {plane: fit.correlation for plane, fit in finding.alignment.planes.items()}
        self._displaced_place = self._seconds(pair.stamp_ns), displacement, correlations
        self._displaced, self._both_seen_s = reason, self._seconds(pair.stamp_ns)
        self._displacement, self._lay.last = displacement, finding.alignment.turn
        loop = self._loop(finding.alignment, displacement)
        return self._result(pair, TrackerState.DISPLACED, reason, loop, finding.alignment)

    def _go_on_with_one(self, pair: FramePair, trial: Trial, state: TrackerState, reason: str) -> TrackResult:
        """Believe what one plane shows, as far as the depth is known; nothing is learned from it."""
        # It is not lost: where the depth is known again it goes on.
        self._respiration, displacement, alignment = trial.respiration, trial.displacement, trial.finding.alignment
        self._doubt = self._respiration.doubt(displacement)
        if (sigma_mm := self._sigma_mm) > LARGEST_ONE_PLANE_SIGMA_MM:
            text = f"one plane alone tells the depth to {sigma_mm:.1f} mm only"
            return self._result(pair, TrackerState.LOST, text, None)
        self._displacement = displacement
        return self._result(pair, state, reason, self._loop(alignment, displacement), alignment)

    def _go_on(self, pair: FramePair, trial: Trial, state: TrackerState, reason: str) -> TrackResult:
        """Believe what both planes show, and learn from it."""
        finding, displacement = trial.finding, trial.displacement
        self._respiration = trial.respiration
        self._displacement, sigma_mm = displacement, self._sigma_mm
        self._learn(finding, displacement, self._seconds(pair.stamp_ns), surely=state is TrackerState.TRACKING)
        if sigma_mm > LARGEST_SURE_SIGMA_MM:
            # What was said before, edge-on in both planes say, is why.
            reason = reason or f"planes exposed so far apart in time tell the depth to {sigma_mm:.1f} mm only, as yet"
            if sigma_mm > LARGEST_SIGMA_MM:
                return self._result(pair, TrackerState.LOST, reason, None)
            state = TrackerState.DEGRADED
        loop = self._loop(finding.alignment, self._displacement)
        return self._result(pair, state, reason, loop, finding.alignment)

    def _learn(self, finding: Finding, displacement: Array, time_s: float, *, surely: bool) -> None:
        """Learn how it breathes and lies; where it is surely tracked, how it looks and turns as well."""
        turn, stretch = finding.alignment.turn, finding.alignment.stretch
        self._both_seen_s = time_s
        with self._stages("judgement"):
            self._envelope.accept(time_s, displacement)
        with self._stages("filter"):
            self._respiration.learn(displacement)
        self._revise(self._respiration.at_a.displacement)
        self._lay.accept(turn)
        self._turn, self._stretch = 0.5 * turn, 0.5 * stretch
        if surely:
            for plane in finding.seen:
                fit = finding.alignment.planes[plane]
                self._appearances[plane].update(fit.strip, fit.correlation)
            self._rotation.learn(time_s, displacement - self._home, turn, stretch)

    @property
    def _sigma_mm(self) -> float:
        """Standard deviation of the displacement, mm."""
        return 1e3 * float(np.sqrt(self._doubt * np.trace(self._respiration.at_a.covariance)))

    def _most_plausible(self, pair: FramePair, finding: Finding, time_s: float) -> Trial:
        """Of the finding and its rivals, which the images do not tell apart, the one that motion and planes prefer."""
        trials = [self._trial(pair, candidate, time_s) for candidate in (finding, *finding.rivals)]
        return min(trials, key=lambda trial: trial.implausibility)

    def _trial(self, pair: FramePair, finding: Finding, time_s: float) -> Trial:
        with self._stages("filter"):
            respiration, predicted = self._respiration.copy(), self._respiration.predict(time_s)
            observe(respiration, finding, time_s, self._finder.exposures(pair), self._require_model())
        displacement = respiration.at_a.displacement
        with self._stages("judgement"):
            departure = self._envelope.departure(time_s, displacement, predicted.displacement)
        unforeseen = displacement - predicted.displacement
        return Trial(finding, respiration, departure, unforeseen, surprise_of(unforeseen, predicted))

    def _share_of_usual(self, finding: Finding, planes: tuple[Plane, ...]) -> float:
        """Correlation in some of the planes, relative to what it usually is."""
        usual = sum(self._appearances[plane].usual for plane in planes)
        return sum(finding.alignment.planes[plane].correlation for plane in planes) / usual

    def _is_back(self, finding: Finding, displacement: Array, time_s: float) -> bool:
        """Whether what was taken for a moved lasso was something else, now that it shows better and far from there.

        True as well where nothing was taken for a moved lasso.
        """
        if not self._displaced:
            return True
        config = self._config.judgement
        since_s, place, correlations = self._displaced_place
        possible_mm = config.largest_speed_mm_s * (time_s - since_s) + config.jump_allowance_mm
        moved_mm = 1e3 * float(np.linalg.norm(displacement - place))
        return len(finding.seen) == 2 and moved_mm > possible_mm and finding.rank[1] > sum(correlations.values())

    def _revise(self, displacement: Array) -> None:
        """Take what was learned since for the displacement (3,) m; between two late phases nothing changes by it."""
        if self._reference_stamp_ns != self._start_ns and self._displacement is not None:
            self._reference = self._reference + displacement - self._displacement
        self._displacement = displacement

    def reset(self) -> None:
        """Forget model and motion."""
        self._model = None

    def reconfigure(self, config: TrackerConfig) -> None:
        """Go on with other tuning parameters; the model is kept."""
        self._config = config
        if self._model is not None:
            self._envelope.reconfigure(config.judgement)

    def set_reference(self) -> None:
        """Make the present phase the reference; a lasso that was moved is taken to be where it belongs.

        Raises:
            TrackingError: no model yet, or the lasso is not seen.
        """
        self._require_model()
        if self._displacement is None:
            raise TrackingError("the lasso is not being tracked: there is no present phase to refer to")
        self._reference, self._reference_stamp_ns = self._displacement, self._last_stamp_ns
        self._reference_covariance = self._respiration.at_a.covariance
        if self._displaced:
            # It belongs where and as it lies now; what was learnt of the breathing, but not of its place, still holds.
            self._displaced = ""
            self._home = self._displacement
            self._lay.settle()
            self._turn, self._followed = 0.5 * self._lay.last, True
            for plane, correlation in self._displaced_place[2].items():
                self._appearances[plane].expect(correlation)
            self._rotation, self._foresight = BreathingRotation(), Foresight()
            self._respiration.move(self._displacement)
            self._envelope = BreathingEnvelope(
                self._config.judgement, self._displacement, self._seconds(self._last_stamp_ns)
            )

    def _require_model(self) -> LoopModel:
        if self._model is None:
            raise TrackingError("there is no model to track: seed the tracker first")
        return self._model

    def _seconds(self, stamp_ns: int) -> float:
        return self._finder.seconds(stamp_ns)

    def _loop(self, alignment: Alignment, displacement: Array) -> Array:
        """(L, 3) the loop's curve at a displacement, world metres."""
        model = self._require_model()
        rotation = rotation_from_vector(alignment.turn) * np.exp(alignment.stretch)
        return np.asarray(model.centre + self._depth_correction + displacement + model.arms @ rotation.T)

    @property
    def _depth_correction(self) -> Array:
        """(3,) from the model to where the loop was at plane A's first exposure, metres.

        The model's depth came from plane B's first exposure: what the loop had moved until then put it off.
        """
        ray_a, lateral = self._require_model().depth_directions
        return np.asarray(-float(lateral @ self._respiration.origin_b.displacement) / float(lateral @ ray_a) * ray_a)

    def _ring(self, alignment: Alignment) -> RingMotion:
        """What the ring has done by itself since the seed pair."""
        moved = np.zeros(3) if self._displacement is None else self._displacement
        own = alignment.turn - self._rotation.between(self._home, moved).vector
        axis = self._axis
        spin = float(axis @ own)
        prior = float(np.radians(self._config.ring.turn_deg))
        is_resolved = float(axis @ alignment.turn_covariance @ axis) < (RESOLVED_SHARE * prior) ** 2
        return RingMotion(
            tilt_rad=float(np.linalg.norm(own - spin * axis)),
            spin_rad=spin if is_resolved else None,
            size=float(np.exp(alignment.stretch)),
        )

    def _result(
        self,
        pair: FramePair,
        state: TrackerState,
        reason: str,
        loop: Array | None,
        alignment: Alignment | None = None,
    ) -> TrackResult:
        result = TrackResult(
            stamp_ns=pair.stamp_ns,
            state=state,
            reason=reason,
            motion=None,
            covariance=None,
            loop=loop,
            reference_stamp_ns=self._reference_stamp_ns,
        )
        if alignment is not None:
            residual_px = {
                plane: fit.residual_mm / frame.projection.millimetres_per_pixel(fit.centre)
                for plane, fit in alignment.planes.items()
                if (frame := pair.frame(plane)) is not None
            }
            result = replace(result, residual_px=residual_px, ring=self._ring(alignment))
        if not state.has_pose or self._displacement is None:
            return result
        rotation = self._rotation.between(self._reference, self._displacement)
        motion = np.eye(4)
        motion[:3, :3] = rotation_from_vector(rotation.vector)
        # About the ring's centre at the reference, which goes where the ring's centre has gone.
        centre = self._require_model().centre + self._depth_correction + self._reference
        motion[:3, 3] = centre + self._displacement - self._reference - motion[:3, :3] @ centre
        return replace(result, motion=motion, covariance=self._covariance(rotation, alignment))

    def _covariance(self, rotation: Rotation, alignment: Alignment | None) -> Array:
        """(6, 6) of the motion at the world origin; an alignment that turned the ring adds what its pivot is off."""
        moved = np.zeros(3) if self._displacement is None else self._displacement
        position = self._doubt * self._respiration.at_a.covariance + self._reference_covariance
        position = position + calibration_covariance(moved - self._reference)
        if alignment is not None:
            position = position + pivot_covariance(alignment.turn, alignment.stretch)
        centre = self._require_model().centre + self._depth_correction + moved
        return at_world_origin(centre, position, rotation.covariance)
