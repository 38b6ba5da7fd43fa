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
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.motion.heart_bank import HeartBank, each_filter
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
    first_covariance,
    moved_on,
    since_b_at,
)

Array = npt.NDArray[np.float64]

_IDENTITY_3 = np.eye(3)


@dataclass(frozen=True, eq=False)
class _Exposure:
    """Something that was taken in: measurements, or (`is_mark`) the time of plane A's exposure."""

    time_s: float
    a: Observation | None
    b: Observation | None
    is_mark: bool


class RespiratoryMotion(HeartBank):
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
        self._start_s = time_a_s, time_b_s
        super().__init__(tuning.hearts(time_b_s - time_a_s), tuning, time_a_s, beats)
        self._between = between
        self._spread = Spread(shape, tuning)
        self._since_all_s = time_a_s
        self._history: tuple[_Exposure, ...] = ()
        self._keeps_history = True
        self._begin()

    def _begin(self) -> None:
        """The state at plane B's first exposure, with the spread known by now."""
        self._time_s, time_b_s = self._start_s
        self._beat_shape = None
        self._weigh(self._hearts.log_odds)
        beats = self._beats_at(self._time_s)
        phase = None if beats is None else beats.phase(self._time_s)
        covariance = first_covariance(self.spread, self._hearts.covariances, self._tuning, phase)
        self._become(np.zeros(covariance.shape[:2]), covariance)
        self._advance(time_b_s)
        if self._between is None:
            self._clone(ORIGIN_B)
        else:
            between = self._between
            self._update(between.across @ self._displacement, between.value, between.covariance, ORIGIN_B)
        self._weigh(self._hearts.log_odds)  # what holds by definition tells nothing of the heart

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

    def _beats_at(self, time_s: float) -> Beats | None:
        """The beats, if they tell the phase at a time."""
        return self._beats if self._beats is not None and self._beats.is_known(time_s) else None

    def later(self, time_s: float) -> RespiratoryMotion:
        """The same motion at a later time, nothing more being seen."""
        later = self.copy()
        later._advance(time_s)
        return later

    @property
    def spread(self) -> Array:
        """(3, 3) covariance of the motion about its mean, learned so far, m²."""
        return self._spread.covariance

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

    def expected_between(self, time_s: float) -> Estimate:
        """How far plane B's origin lies from the displacement at a time: what B measures, in 3-D."""
        return self._foreseen(since_b_at, time_s)

    def _foreseen(self, of_phase: Callable[[float | None], Array], time_s: float) -> Estimate:
        """A function of the state and of the beat's phase, at a later time."""
        if self._tells_of_beats and self._beats_at(time_s) is None:
            later = self.later(time_s)
            return later._seen_along(of_phase(None), later._state, later._covariance)
        return self._seen_along(of_phase(self._phase(time_s)), *self._propagated(time_s))

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
        self._remember(_Exposure(time_s, a, b, is_mark=False))
        self._advance(time_s)
        likelihood = 0.0
        if a is not None:
            likelihood += self._update(a.across @ self._displacement, a.value, a.covariance, AT_A)
        if b is not None:
            likelihood += self._update(b.across @ self._since_b, b.value, b.covariance)
        return likelihood

    def mark_a(self, time_s: float) -> None:
        """Make a time that of `at_a`: what would have been plane A's exposure, where it has none."""
        self._remember(_Exposure(time_s, None, None, is_mark=True))
        self._advance(time_s)
        self._clone(AT_A)

    @property
    def is_revised_next(self) -> bool:
        """Whether the past is gone through again with the next displacement that is learned, which revises `at_a`."""
        is_due = self._spread.count + 1 in self._tuning.rebuild_at
        return is_due and self._keeps_history and self._start_s[0] != self._start_s[1]

    def learn(self, displacement: Array) -> None:
        """Learn the directions of the motion from one sure displacement (3,) m."""
        is_revised = self.is_revised_next
        self._spread, self._ahead, self._foretold = self._spread.learned(displacement), {}, None
        self._spread.way  # noqa: B018 - worked out while no pair waits: the next one asks for it
        if self._time_s - self._since_all_s >= self._tuning.heartbeat_memory_s:
            self._take_up_all()
        if is_revised:
            self._rebuild()
        self._drop_hearts()  # by what the past says with the spread known by now
        if self._keeps_history and self._spread.count >= self._tuning.longest_history:
            self._history, self._keeps_history = (), False

    def _take_up_all(self) -> None:
        """All hearts again: the dropped ones in the state of all the others; what spoke against them has faded."""
        every, old = self._every_heart, self._hearts.number
        against = math.log(self._tuning.heartbeat_kept) * self._tuning.heart_kept(self._time_s - self._since_all_s)
        state, covariance = each_filter(self._mixed(self._state, self._weighted(self._covariance)), len(every))
        log_weights = every.log_odds + (self._log_weights - every.log_odds[old]).max() + against
        state[old], covariance[old], log_weights[old] = self._state, self._covariance, self._log_weights
        self._hearts, self._since_all_s = every, self._time_s
        self._become(state, covariance)
        self._weigh(log_weights)

    def move(self, displacement: Array) -> None:
        """Take the loop to have been put elsewhere, (3,) m: how it breathes is kept, and it breathes about there."""
        shift = displacement - self._state @ self._displacement.T
        state = self._state.copy()
        state[:, MEAN] += shift
        self._become(state, self._covariance)
        self._spread = self._spread.moved(self.weights @ shift)
        self._history, self._keeps_history = (), False  # it tells of another place

    def surged(self) -> RespiratoryMotion:
        """The same motion, if a breath has just set in (or a cough) as nothing before foretold.

        It goes where breathing goes, as far as that is known by now.
        """
        surged = self.copy()
        covariance = self._covariance.copy()
        way = self.spread / np.linalg.eigvalsh(self.spread)[-1]
        covariance[:, VELOCITY, VELOCITY] += self._tuning.surge_m_s**2 * way
        covariance[:, POSITION, POSITION] += self._tuning.surge_m**2 * _IDENTITY_3
        surged._become(self._state, covariance)
        return surged

    def moved_by_hand(self, reach_m: float) -> RespiratoryMotion:
        """The same motion of a ring that somebody may just have put elsewhere, within a reach (standard deviation)."""
        moved = self.copy()
        covariance = self._covariance.copy()
        covariance[:, MEAN, MEAN] += reach_m**2 * _IDENTITY_3
        moved._become(self._state, covariance)
        return moved

    def _remember(self, exposure: _Exposure) -> None:
        if self._keeps_history:
            self._history = (*self._history, exposure)

    def _rebuild(self) -> None:
        """Filter the past again, with the spread learned since."""
        history, self._history = self._history, ()
        self._begin()
        for exposure in history:
            if exposure.is_mark:
                self.mark_a(exposure.time_s)
            else:
                self.observe(exposure.time_s, a=exposure.a, b=exposure.b)

    def _propagated(self, time_s: float) -> tuple[Array, Array]:
        """State and covariance at a later time, kept for when they are asked for again."""
        if time_s <= self._time_s:
            return self._state, self._covariance
        ahead = self._ahead.get(time_s)
        if ahead is None:
            if len(self._ahead) >= self._tuning.times_ahead:
                self._ahead.clear()
            interval_s = time_s - self._time_s
            ahead = moved_on(self._state, self._covariance, interval_s, self.spread, self._random_heart, self._tuning)
            self._ahead[time_s] = ahead
        return ahead

    def _advance(self, time_s: float) -> None:
        if time_s > self._time_s:
            is_known = self._beats_at(time_s) is not None
            if not is_known:
                self._switch(False)
            self._become(*self._propagated(time_s))
            fading = self._tuning.heart_kept(time_s - self._time_s)
            usual = self._hearts.log_odds
            self._weigh(usual + fading * (self._log_weights - usual))
            self._time_s = time_s
            if is_known:
                self._switch(True)
