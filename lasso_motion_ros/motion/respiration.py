"""The motion of the ring's centre in time: a Gaussian process, filtered exposure by exposure.

Every exposure of a plane measures the centre across its ray, at its own time. A Kalman filter over a
stationary process (`motion_model`) joins them: it brackets plane A's exposure between two of plane B's, carries the
depth over a missing plane, predicts the next pair and gives the covariance of all that.

How far the heartbeat moves the atrium differs tenfold between patients, and which way. Both are learned by filters that
differ only in that (`hearts`), side by side, each weighted by the probability that it gives to the measurements so far
(a static bank of models: Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation",
2001, section 11.6.2). Those of next to no weight are dropped, and taken up anew after a while: rhythms change.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.covariance import probabilities_beyond
from lasso_motion_ros.motion.hearts import Hearts
from lasso_motion_ros.motion.motion_model import (
    AT_A,
    DISPLACEMENT,
    HEARTBEAT,
    MEAN,
    ORIGIN_B,
    POSITION,
    SINCE_B,
    SIZE,
    TUNING,
    VELOCITY,
    Estimate,
    MotionTuning,
    Observation,
    Spread,
    first_covariance,
    measured,
    moved_on,
)

Array = npt.NDArray[np.float64]

_IDENTITY_3 = np.eye(3)
_BLOCKS = {block.start: np.eye(SIZE)[block] for block in (HEARTBEAT, ORIGIN_B, AT_A)}  # as functions of the state


@dataclass(frozen=True, eq=False)
class _Exposure:
    """Something that was taken in: measurements, or (`is_mark`) the time of plane A's exposure."""

    time_s: float
    a: Observation | None
    b: Observation | None
    is_mark: bool


class RespiratoryMotion:
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
        tuning: MotionTuning = TUNING,
    ) -> None:
        """Start at the seed pair.

        Args:
            time_a_s: plane A's exposure, seconds.
            time_b_s: plane B's, not earlier.
            shape: (3, 3) covariance of the motion before any has been seen, in units of its variance along the body.
            between: what the seed pair shows of the displacement at plane B's exposure.
            tuning: what is expected of breathing and heart.
        """
        self._start_s = time_a_s, time_b_s
        self._between, self._tuning = between, tuning
        self._spread = Spread(shape, tuning)
        self._every_heart = tuning.hearts(time_b_s - time_a_s)
        self._hearts, self._since_all_s = self._every_heart, time_a_s
        self._history: tuple[_Exposure, ...] = ()
        self._keeps_history = True
        self._weights: Array | None = None  # not worked out yet
        self._begin()

    def _begin(self) -> None:
        """The state at plane B's first exposure, with the spread known by now."""
        self._time_s, time_b_s = self._start_s
        self._ahead: dict[float, tuple[Array, Array]] = {}
        self._foretold: tuple[float, Estimate] | None = None  # the last time that was asked for
        self._blocks: dict[int, Estimate] = {}
        self._weigh(self._hearts.log_odds)
        covariance = first_covariance(self.spread, self._hearts.covariances, self._tuning)
        self._become(np.zeros((len(self._hearts), SIZE)), covariance)
        self._advance(time_b_s)
        if self._between is None:
            self._clone(ORIGIN_B)
        else:
            between = self._between
            self._update(between.across @ DISPLACEMENT, between.value, between.covariance, ORIGIN_B)
        self._weigh(self._hearts.log_odds)  # what holds by definition tells nothing of the heart

    def copy(self) -> RespiratoryMotion:
        """An independent filter in the same state; arrays are never changed in place, so they are shared."""
        twin = RespiratoryMotion.__new__(RespiratoryMotion)  # in a quarter of the time of `copy.copy`
        twin.__dict__.update(self.__dict__)
        return twin

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
            self._foretold = time_s, self._seen_along(DISPLACEMENT, *self._propagated(time_s))
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
        return self._seen_along(SINCE_B, *self._propagated(time_s))

    @property
    def hearts(self) -> Hearts:
        """What the heart may do: of each filter."""
        return self._hearts

    @property
    def weights(self) -> Array:
        """(filters,) probability of each of the hearts; not to be changed in place."""
        if self._weights is None:
            weights = np.exp(self._log_weights - self._log_weights.max())
            self._weights = np.asarray(weights / weights.sum())
        return self._weights

    @property
    def way(self) -> Array:
        """(3,) unit vector of the direction of breathing, as learned so far."""
        return self._spread.way

    @property
    def heartbeat(self) -> Array:
        """(3, 3) m² covariance of the heartbeat's motion, as learned so far."""
        return np.asarray(np.tensordot(self.weights, self._hearts.covariances, 1))

    @property
    def heartbeat_sideways(self) -> Array:
        """(3, 3) m² of it across the direction of breathing."""
        across = _IDENTITY_3 - np.outer(self.way, self.way)
        return np.asarray(across @ self.heartbeat @ across)

    def _seen_along(self, h: Array, state: Array, covariance: Array) -> Estimate:
        """A linear function h (3, SIZE) of the state, over all filters."""
        if has_kernels():
            from lasso_motion_ros.motion import kernels

            return Estimate(*kernels.mixed(self.weights, state, covariance, h))
        return self._mixed(state @ h.T, h @ self._weighted(covariance) @ h.T)

    def _mixed(self, each: Array, within: Array) -> Estimate:
        """The filters' estimates (filters, 3) and their own covariance (3, 3), and what they differ by."""
        mean = self.weights @ each
        off = each - mean
        return Estimate(mean, within + (self.weights[:, None] * off).T @ off)

    def _weighted(self, covariance: Array) -> Array:
        """(N, N) mean of the filters' (filters, N, N)."""
        return (self.weights @ covariance.reshape(len(covariance), -1)).reshape(covariance.shape[1:])

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
            likelihood += self._update(a.across @ DISPLACEMENT, a.value, a.covariance, AT_A)
        if b is not None:
            likelihood += self._update(b.across @ SINCE_B, b.value, b.covariance)
        return likelihood

    def mark_a(self, time_s: float) -> None:
        """Make a time that of `at_a`: what would have been plane A's exposure, where it has none."""
        self._remember(_Exposure(time_s, None, None, is_mark=True))
        self._advance(time_s)
        self._clone(AT_A)

    @property
    def origin_b(self) -> Estimate:
        """The displacement at plane B's first exposure, as known by now."""
        return self._block(ORIGIN_B)

    @property
    def at_a(self) -> Estimate:
        """The displacement at plane A's last exposure, with all that came since."""
        return self._block(AT_A)

    def beyond(self, limit_m: float, more: Array) -> float:
        """Probability that `at_a` is farther off than a limit, metres, each heart by itself.

        A heart that is seldom so strong is seldom far off, and then by much: no one normal distribution says so.

        Args:
            limit_m: of the distance.
            more: (3, 3) m² of what else it may be off by.
        """
        off = self._state[:, AT_A] - self.at_a.displacement
        beyond = probabilities_beyond(limit_m, self._covariance[:, AT_A, AT_A] + more, off)
        return float(self.weights @ beyond)

    def _block(self, block: slice) -> Estimate:
        """A block of the state, kept until the state changes: a pair's result asks for it many times."""
        known = self._blocks.get(block.start)
        if known is None:
            known = self._blocks[block.start] = self._seen_along(_BLOCKS[block.start], self._state, self._covariance)
        return Estimate(known.displacement.copy(), known.covariance.copy())

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

    def _drop_hearts(self) -> None:
        """Go on without the ways for which the measurements speak far less than for the best, whatever their odds."""
        evidence = self._log_weights - self._hearts.log_odds
        kept = self._hearts.is_any_way | (evidence >= evidence.max() + math.log(self._tuning.heartbeat_kept))
        if not kept.all():
            log_weights = self._log_weights[kept]
            self._hearts = self._hearts.only(kept)
            self._become(self._state[kept], self._covariance[kept])
            self._weigh(log_weights)

    def _take_up_all(self) -> None:
        """All hearts again: the dropped ones in the state of all the others; what spoke against them has faded."""
        every, old = self._every_heart, self._hearts.number
        against = math.log(self._tuning.heartbeat_kept) * self._tuning.heart_kept(self._time_s - self._since_all_s)
        off = self._state - self.weights @ self._state
        within = self._weighted(self._covariance) + (self.weights[:, None] * off).T @ off
        state, covariance = np.tile(self.weights @ self._state, (len(every), 1)), np.tile(within, (len(every), 1, 1))
        log_weights = every.log_odds + (self._log_weights - every.log_odds[old]).max() + against
        state[old], covariance[old], log_weights[old] = self._state, self._covariance, self._log_weights
        self._hearts, self._since_all_s = every, self._time_s
        self._become(state, covariance)
        self._weigh(log_weights)

    def move(self, displacement: Array) -> None:
        """Take the loop to have been put elsewhere, (3,) m: how it breathes is kept, and it breathes about there."""
        shift = displacement - self._state @ DISPLACEMENT.T
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

    def alone(self, ray: Array) -> Array:
        """(3, 3) m² of `at_a` where one plane was alone, and depth along its ray (3,) rests on the motion seen so far.

        That motion is known from few displacements: further out than they reach, depth is less sure than the filter
        says. About them it is surer, as far as it is the filter's spread that it rests on, not a depth just seen.
        """
        at_a = self.at_a
        wide, seen = self._spread.along(ray)
        share = min(float(ray @ at_a.covariance @ ray) / wide, 1.0)
        narrower = 1.0 - math.sqrt(1.0 - share * (1.0 - seen / wide))
        along = _IDENTITY_3 - narrower * np.outer(ray, ray)
        return np.asarray(self._spread.doubt(at_a.displacement) * along @ at_a.covariance @ along)

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
            ahead = moved_on(
                self._state, self._covariance, interval_s, self.spread, self._hearts.covariances, self._tuning
            )
            self._ahead[time_s] = ahead
        return ahead

    def _become(self, state: Array, covariance: Array) -> None:
        # New dictionaries: a copy of this filter goes on with the old ones.
        self._state, self._covariance, self._ahead, self._blocks = state, covariance, {}, {}
        self._foretold = None

    def _weigh(self, log_weights: Array) -> None:
        """Take over other weights (filters,), by their logarithms; what they sum up to is worked out when asked for."""
        self._log_weights = log_weights
        self._weights = self._foretold = None
        self._blocks = {}

    def _advance(self, time_s: float) -> None:
        if time_s > self._time_s:
            self._become(*self._propagated(time_s))
            fading = self._tuning.heart_kept(time_s - self._time_s)
            usual = self._hearts.log_odds
            self._weigh(usual + fading * (self._log_weights - usual))
            self._time_s = time_s

    def _clone(self, block: slice) -> None:
        """Make a block of the state the displacement now."""
        if has_kernels():
            from lasso_motion_ros.motion import kernels

            self._become(*kernels.cloned(self._state, self._covariance, DISPLACEMENT, block.start))
            return
        state, covariance = self._state.copy(), self._covariance.copy()
        state[:, block] = self._state @ DISPLACEMENT.T
        rows = DISPLACEMENT @ self._covariance
        covariance[:, block], covariance[:, :, block] = rows, rows.swapaxes(-1, -2)
        covariance[:, block, block] = rows @ DISPLACEMENT.T
        self._become(state, covariance)

    def _update(self, h: Array, value: Array, noise: Array, block: slice | None = None) -> float:
        """Take in a measurement; returns the logarithm of its probability density, per metre and component.

        A block of the state, where one is given, becomes the displacement, as by `_clone`.
        """
        if len(value) == 2 and has_kernels():
            from lasso_motion_ros.motion import kernels

            state, covariance, log_weights, likelihood = kernels.taken_in(
                self._state,
                self._covariance,
                h,
                value,
                noise,
                self._log_weights,
                self._hearts.odds,
                self._tuning.freedom,
                self._tuning.unusual_share,
                DISPLACEMENT,
                -1 if block is None else block.start,
            )
            self._become(state, covariance)
            self._weigh(log_weights)
            return likelihood
        state, covariance, distance, peaks = measured(self._state, self._covariance, h, value, noise)
        self._become(state, covariance)
        if block is not None:
            self._clone(block)
        freedom, unusual = self._tuning.freedom, self._tuning.unusual_share
        # Of Student's distribution: a beat or a breath unlike those before is rare, not impossible.
        densities = peaks - 0.5 * (freedom + len(value)) * np.log1p(distance / freedom)
        weights = (1.0 - unusual) * self.weights + unusual * self._hearts.odds
        self._weigh(self._log_weights + densities)
        highest = float(densities.max())
        return highest + math.log(float(weights @ np.exp(densities - highest)) + 1e-300)
