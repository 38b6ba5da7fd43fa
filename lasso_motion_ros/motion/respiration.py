"""The motion of the ring's centre in time: a Gaussian process, filtered exposure by exposure.

Every exposure of a plane measures the centre across its ray, at its own time. A Kalman filter over a
stationary process (`motion_model`) joins them: it brackets plane A's exposure between two of plane B's, carries the
depth over a missing plane, predicts the next pair and gives the covariance of all that.

How far the heartbeat moves the atrium differs tenfold between patients, and which way. Both are learned by filters that
differ only in that, side by side (`heart_bank`). Those of next to no weight are dropped, and taken up anew after a
while: rhythms change.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.motion.exposures import Exposure, ExposureFilter
from lasso_motion_ros.motion.heart_bank import each_filter
from lasso_motion_ros.motion.heartbeat import Beats
from lasso_motion_ros.motion.motion_model import (
    AT_A,
    MEAN,
    ORIGIN_B,
    POSITION,
    TUNING,
    VELOCITY,
    Estimate,
    MotionTuning,
    Observation,
    Spread,
    displacement_at,
    first_states,
    since_b_at,
)
from lasso_motion_ros.motion.outcome import Outcome, Outlook

Array = npt.NDArray[np.float64]

_IDENTITY_3 = np.eye(3)


class RespiratoryMotion(ExposureFilter):
    """Filter for the displacement of the loop's centre; at the seed pair's exposure in plane A it is zero.

    Plane B's first exposure may be later: what the loop had moved until then is a part of the state
    (`ORIGIN_B`), since plane B's shift, and so its every measurement, refers to it.
    """

    def __init__(
        self,
        time_a_s: float,
        time_b_s: float,
        *,
        shape: Array = _IDENTITY_3,
        between: Observation | None = None,
        beats: Beats | None = None,
        tuning: MotionTuning = TUNING,
    ) -> None:
        """Start at the seed pair.

        Args:
            time_a_s: plane A's exposure, seconds.
            time_b_s: plane B's, not earlier.
            shape: (3, 3) covariance of the motion before any has been seen, in units of its variance along the body.
            between: what the seed pair shows of the displacement at plane B's exposure.
            beats: the heart's, by the R peaks known then; None without any.
            tuning: what is expected of breathing and heart.
        """
        self._start_s, self._is_late = time_a_s, time_b_s != time_a_s
        super().__init__(tuning.hearts(time_b_s - time_a_s), Spread(shape, tuning), tuning, time_a_s, beats)
        self._since_all_s = time_a_s
        self._keeps_history = True
        # What holds by definition tells nothing of the heart.
        origin = Exposure(time_b_s, between and between.of_two(), False, ORIGIN_B, is_telling=False)
        self._history: tuple[Exposure, ...] = (origin,)
        self._filter_again()

    def _filter_again(self) -> None:
        """Go through the past from the seed pair on, with the spread known by now."""
        self._time_s = self._start_s
        self._beat_shape = None
        self._weigh(self._hearts.log_odds)
        beats = self._beats_at(self._time_s)
        phase = None if beats is None else beats.phase(self._time_s)
        self._become(*first_states(self.spread, self._hearts.covariances, self._tuning, phase))
        self._take_in(self._history)

    def copy(self) -> RespiratoryMotion:
        """An independent filter in the same state; arrays are never changed in place, so they are shared."""
        twin = RespiratoryMotion.__new__(RespiratoryMotion)  # in a quarter of the time of `copy.copy`
        twin.__dict__.update(self.__dict__)
        return twin

    def hearing(self, beats: Beats | None) -> RespiratoryMotion:
        """The same motion, with the heart's beats as they are known by now; None where no R peaks tell of them.

        The state tells of what repeats from beat to beat from the first exposure on whose phase is known, and until one
        whose phase is not: then that is a part of the random heartbeat.
        """
        if beats == self._beats:
            return self
        twin = self.copy()
        twin._hear(beats)
        return twin

    def later(self, time_s: float) -> RespiratoryMotion:
        """The same motion at a later time, nothing more being seen."""
        later = self.copy()
        later._advance(time_s)
        return later

    def _reached(self, time_s: float) -> RespiratoryMotion:
        """The same; kept, and not to be changed."""
        known = self._later
        if not isinstance(known, RespiratoryMotion) or known._time_s != time_s:
            known = self._later = self.later(time_s)
        return known

    @property
    def mean(self) -> Array:
        """(3,) mean displacement so far, metres."""
        return self._spread.mean.copy()

    def predict(self, time_s: float) -> Estimate:
        """The displacement expected at a later time, nothing being changed; kept, and not to be changed in place."""
        if self._foretold is None or self._foretold[0] != time_s:
            self._foretold = time_s, self._foreseen(displacement_at, time_s)
        return self._foretold[1]

    def sideways_sigmas(self, time_s: float, found: Estimate) -> float:
        """How far a displacement is from what was foretold, in standard deviations, whatever breath was drawn since.

        A breath, a cough or a sigh goes any way along the direction of breathing: of all of them the one is taken that
        explains the displacement best. What is left is sideways, where only a hand takes the ring far at once.

        Args:
            time_s: of the displacement, not before what was last taken in.
            found: the displacement, not taken in yet.
        """
        foretold = self.predict(time_s)
        off, breath = found.displacement - foretold.displacement, self._spread.way
        both = np.stack([off, breath])
        (alone, along), (_, way) = both @ np.linalg.solve(foretold.covariance + found.covariance, both.T)
        return math.sqrt(max(alone - along * along / way, 0.0))

    def foresee(self, time_s: float, time_b_s: float) -> tuple[Estimate, Estimate]:
        """What `predict` gives for plane A's exposure, and `expected_between` for plane B's, at once.

        Args:
            time_s: plane A's, not before what was last taken in.
            time_b_s: plane B's, not before that.
        """
        outlook = self._outlook(time_s, time_b_s)
        if outlook is None:
            return self.predict(time_s), self.expected_between(time_b_s)
        self._foretold = time_s, outlook.at_a
        return outlook.at_a, outlook.between

    def expected_between(self, time_s: float) -> Estimate:
        """How far plane B's origin lies from the displacement at a time: what B measures, in 3-D."""
        return self._foreseen(since_b_at, time_s)

    def _foreseen(self, of_phase: Callable[[float | None], Array], time_s: float) -> Estimate:
        """A function of the state and of the beat's phase, at a later time."""
        if self._tells_of_beats and self._beats_at(time_s) is None:
            return self._reached(time_s)._seen_along(of_phase(None))
        function = of_phase(self._phase(time_s))
        if time_s <= self._time_s:
            return self._seen_along(function)
        # Of the state later on, it is another function of the state now; of what comes in between, only places count.
        passage = self._tuning.passage(time_s - self._time_s)
        seen = self._seen_along(passage.before(function))
        heart = np.tensordot(self.weights, self._random_heart, 1)
        noise = passage.breathing_noise[0, 0] * self.spread + passage.beating_noise[0, 0] * heart
        return Estimate(seen.displacement, seen.covariance + noise)

    @property
    def way(self) -> Array:
        """(3,) unit vector of the direction of breathing, as learned so far."""
        return self._spread.way

    @property
    def heartbeat_sideways(self) -> Array:
        """(3, 3) m² of it across the direction of breathing."""
        across = _IDENTITY_3 - np.outer(self.way, self.way)
        return np.asarray(across @ self.heartbeat @ across)

    def observe(self, time_s: float, *, a: Observation | None = None, b: Observation | None = None) -> float:
        """Take in one exposure's measurements; times must not decrease.

        Plane A's makes its time that of `at_a`, which plane B's, though later, still sharpens.

        Returns:
            How likely the measurements were, given all before.
        """
        steps = () if a is None else (Exposure(time_s, a, False, AT_A),)
        if b is not None:
            steps = (*steps, Exposure(time_s, b, True, None))
        return self._take_in_and_keep(*steps)

    def outcome(
        self, time_s: float, a: Observation | None, time_b_s: float, b: Observation | None
    ) -> Outcome[RespiratoryMotion]:
        """What a pair's measurements would make of the motion; nothing is changed.

        Args:
            time_s: plane A's exposure, or what would have been it, not before what was last taken in.
            a: its measurement, if it has one.
            time_b_s: plane B's, not before that.
            b: likewise.
        """
        steps = [Exposure(time_s, a, False, AT_A)]
        if b is not None:
            steps.append(Exposure(time_b_s, b, True, None))

        def after() -> RespiratoryMotion:
            later = self.copy()
            later._take_in_and_keep(*steps)
            return later

        outlook = self._outlook(time_s, time_b_s)
        if outlook is not None:
            return outlook.outcome(a, b, self._log_weights, self._hearts, self._tuning, after)
        later, between = self._reached(time_s).copy(), None
        likelihood = later._take_in_and_keep(steps[0])
        if b is not None:
            between = later.expected_between(time_b_s) if a is not None else None
            likelihood += later._take_in_and_keep(steps[1])
        return Outcome(likelihood, later.at_a, between, lambda: later)

    def _outlook(self, time_s: float, time_b_s: float) -> Outlook | None:
        """What both planes' exposures will show, kept, since many places are asked about.

        None in plain arithmetic, and where the phase of the heart's beat gets lost until then, or known.
        """
        if self._ahead is not None and self._ahead.times_s == (time_s, time_b_s):
            return self._ahead
        is_known = {self._beats_at(one) is not None for one in (time_s, time_b_s)}
        if not has_kernels() or is_known != {self._tells_of_beats} or not self._time_s <= time_s <= time_b_s:
            return None
        from lasso_motion_ros.motion import kernels

        tuning, intervals_s = self._tuning, (time_s - self._time_s, time_b_s - time_s)
        values, covariance, mean, within = kernels.foreseen(
            self._state,
            self._covariance,
            self._log_weights,
            displacement_at(self._phase(time_s)),
            since_b_at(self._phase(time_b_s)),
            tuning.passage(intervals_s[0]).matrices,
            tuning.passage(intervals_s[1]).matrices,
            self.spread,
            self._random_heart,
        )
        kept = tuning.heart_kept(intervals_s[0]), tuning.heart_kept(intervals_s[1])
        at_a, between = Estimate(mean[:3], within[:3, :3]), Estimate(mean[3:], within[3:, 3:])
        self._ahead = Outlook((time_s, time_b_s), values, covariance, kept, at_a, between)
        return self._ahead

    def mark_a(self, time_s: float) -> None:
        """Make a time that of `at_a`: what would have been plane A's exposure, where it has none."""
        self._take_in_and_keep(Exposure(time_s, None, False, AT_A))

    def _take_in_and_keep(self, *steps: Exposure) -> float:
        """Take in steps that may have to be gone through again; returns how likely they were."""
        if self._keeps_history:
            self._history = (*self._history, *steps)
        return self._take_in(steps)

    @property
    def is_revised_next(self) -> bool:
        """Whether the past is gone through again with the next displacement that is learned, which revises `at_a`."""
        is_due = self._spread.count + 1 in self._tuning.rebuild_at
        return is_due and self._keeps_history and self._is_late

    def learn(self, displacement: Array) -> None:
        """Learn the directions of the motion from one sure displacement (3,) m."""
        is_revised = self.is_revised_next
        self._spread = self._spread.learned(displacement)
        self._forget_foreseen()
        self._spread.way  # noqa: B018 - worked out while no pair waits: the next one asks for it
        if self._time_s - self._since_all_s >= self._tuning.heartbeat_memory_s:
            self._take_up_all()
        if is_revised:
            self._filter_again()
        self._drop_hearts()  # by what the past says with the spread known by now
        if self._keeps_history and self._spread.count >= self._tuning.longest_history:
            self._history, self._keeps_history = (), False

    def _take_up_all(self) -> None:
        """All hearts again: the dropped ones in the state of all the others; what spoke against them has faded."""
        every, old = self._every_heart, self._hearts.number
        against = math.log(self._tuning.heartbeat_kept) * self._tuning.heart_kept(self._time_s - self._since_all_s)
        state, covariance = each_filter(self._mixed(self._state, self._weighted(self._covariance)), len(every))
        log_weights = every.log_odds + (self._log_weights - every.log_odds[old]).max() + against
        state[:, old], covariance[..., old], log_weights[old] = self._state, self._covariance, self._log_weights
        self._hearts, self._since_all_s = every, self._time_s
        self._become(state, covariance)
        self._weigh(log_weights)

    def move(self, displacement: Array) -> None:
        """Take the loop to have been put elsewhere, (3,) m: how it breathes is kept, and it breathes about there."""
        shift = displacement[:, None] - self._displacement @ self._state
        state = self._state.copy()
        state[MEAN] += shift
        self._become(state, self._covariance)
        self._spread = self._spread.moved(shift @ self.weights)
        self._history, self._keeps_history = (), False  # it tells of another place

    def surged(self) -> RespiratoryMotion:
        """The same motion, if a breath has just set in (or a cough) as nothing before foretold.

        It goes where breathing goes, as far as that is known by now.
        """
        surged = self.copy()
        covariance = self._covariance.copy()
        way = self.spread / np.linalg.eigvalsh(self.spread)[-1]
        covariance[VELOCITY, VELOCITY] += (self._tuning.surge_m_s**2 * way)[..., None]
        covariance[POSITION, POSITION] += (self._tuning.surge_m**2 * _IDENTITY_3)[..., None]
        surged._become(self._state, covariance)
        return surged

    def moved_by_hand(self, reach_m: float) -> RespiratoryMotion:
        """The same motion of a ring that somebody may just have put elsewhere, within a reach (standard deviation)."""
        moved = self.copy()
        covariance = self._covariance.copy()
        covariance[MEAN, MEAN] += (reach_m**2 * _IDENTITY_3)[..., None]
        moved._become(self._state, covariance)
        return moved
