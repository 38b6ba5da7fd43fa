"""Kalman filters side by side that differ in what the heart may do, each weighted by what was measured.

A static bank of models (Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation",
2001, section 11.6.2): each filter's weight is the probability that it gives to the measurements so far.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.covariance import inverses, probabilities_beyond
from lasso_motion_ros.motion.heartbeat import Beats
from lasso_motion_ros.motion.hearts import Hearts
from lasso_motion_ros.motion.motion_model import (
    AT_A,
    BEAT_SHAPE,
    HARMONICS,
    HEARTBEAT,
    ORIGIN_B,
    SIZE,
    SIZE_WITH_BEATS,
    Estimate,
    MotionTuning,
    Observation,
    beat_shape_covariance,
    displacement_at,
    measured,
    since_b_at,
)
from lasso_motion_ros.motion.outcome import Outlook

Array = npt.NDArray[np.float64]

_IDENTITY_3 = np.eye(3)


@lru_cache
def _block_of(start: int, size: int) -> Array:
    """(3, N) a block of the state, by its beginning, as a function of the state of a size N."""
    block = np.eye(3, size, start)
    block.setflags(write=False)
    return block


def each_filter(mixed: tuple[Array, Array], filters: int) -> tuple[Array, Array]:
    """(N, filters) states and (N, N, filters) covariances, all of them that of all filters together."""
    mean, covariance = mixed
    return np.repeat(mean[:, None], filters, axis=-1), np.repeat(covariance[..., None], filters, axis=-1)


def _changed(matrix: Array, state: Array, covariance: Array) -> tuple[Array, Array]:
    """States and covariances of what a matrix (M, N) makes of states (N, filters) with covariances (N, N, filters)."""
    (size, filters), made = state.shape, len(matrix)
    half = (matrix @ covariance.reshape(size, -1)).reshape(made, size, filters)
    return matrix @ state, matrix @ half


class HeartBank:
    """The filters' states at one time; arrays are never changed in place, so that copies share them.

    States are (N, filters), their covariances (N, N, filters).

    Whoever makes one has it `_become` its first states.

    Where R peaks tell when the heart beats, what it does repeats in part from beat to beat, which is in the state, too.

    Args:
        hearts: what the heart may do, of each filter.
        tuning: what is expected of measurements.
        time_s: of the states, seconds.
        beats: the heart's, by the R peaks known; None without any.
    """

    def __init__(self, hearts: Hearts, tuning: MotionTuning, time_s: float, beats: Beats | None) -> None:
        self._hearts = self._every_heart = hearts
        self._tuning, self._time_s, self._beats = tuning, time_s, beats
        self._beat_shape: tuple[Array, Array] | None = None  # what was known of it when it was last told of
        self._weights: Array | None = None  # not worked out yet
        # What was asked for is kept until the state changes: blocks of it, the last predictions, the state later on.
        self._blocks: dict[int, Estimate] = {}
        self._foretold: tuple[float, Estimate] | None = None
        self._ahead: Outlook | None = None
        self._later: HeartBank | None = None
        self._weigh(hearts.log_odds)

    @property
    def hearts(self) -> Hearts:
        """What the heart may do: of each filter."""
        return self._hearts

    @property
    def beats(self) -> Beats | None:
        """The heart's beats, as far as the state tells of what repeats in them; else None."""
        return self._beats if self._tells_of_beats else None

    @property
    def weights(self) -> Array:
        """(filters,) probability of each of the hearts; not to be changed in place."""
        if self._weights is None:
            weights = np.exp(self._log_weights - self._log_weights.max())
            self._weights = np.asarray(weights / weights.sum())
        return self._weights

    @property
    def heartbeat(self) -> Array:
        """(3, 3) m² covariance of the heartbeat's motion, as learned so far, whatever of it repeats."""
        random = np.asarray(np.tensordot(self.weights, self._random_heart, 1))
        if not self._tells_of_beats:
            return random
        # Cosines and sines are a half each, squared, on average over a beat.
        mean, covariance = self._learned_shape()
        waves = (covariance + np.outer(mean, mean)).reshape(2 * HARMONICS, 3, 2 * HARMONICS, 3)
        return np.asarray(random + 0.5 * np.einsum("nink->ik", waves))

    def _learned_shape(self) -> tuple[Array, Array]:
        """What is known of what repeats: (18,) coefficients, metres, and their (18, 18) covariance in m²."""
        return self._mixed(self._state[BEAT_SHAPE], self._weighted(self._covariance[BEAT_SHAPE, BEAT_SHAPE]))

    @property
    def _random_heart(self) -> Array:
        """(filters, 3, 3) m² of what of the heartbeat does not repeat."""
        covariances = self._hearts.covariances
        return (1.0 - self._tuning.beat_share) * covariances if self._tells_of_beats else covariances

    @property
    def _tells_of_beats(self) -> bool:
        return bool(len(self._state) == SIZE_WITH_BEATS)

    def _phase(self, time_s: float) -> float | None:
        """Of the beat, as far as the state tells of beats; else None."""
        return self._beats.phase(time_s) if self._beats is not None and self._tells_of_beats else None

    @property
    def _displacement(self) -> Array:
        """(3, N) the displacement now, as a function of the state."""
        return displacement_at(self._phase(self._time_s))

    @property
    def _since_b(self) -> Array:
        """(3, N) what plane B measures now, in 3-D, likewise."""
        return since_b_at(self._phase(self._time_s))

    def _hear(self, beats: Beats | None) -> None:
        """Go on with the heart's beats as they are known by now."""
        if beats is None or not beats.is_known(self._time_s):
            self._switch(False)
        self._beats, self._blocks = beats, {}
        self._forget_foreseen()

    def _switch(self, tells: bool) -> None:
        """Have a state that tells of what repeats from beat to beat, or one that does not.

        The displacement now, and what is known of it, stay as they are.
        """
        if tells == self._tells_of_beats or self._beats is None:
            return
        phase = self._beats.phase(self._time_s)
        if tells:
            self._become(*self._with_beats(phase))
            return
        usual = self.heartbeat
        self._beat_shape = self._learned_shape()
        state, covariance = self._without_beats(phase)
        mixed = self._mixed(state, self._weighted(covariance))
        # Hearts were weighed by what of them does not repeat. Now they are by all that was learned of the heartbeat.
        every = self._hearts = self._every_heart
        self._become(*each_filter(mixed, len(every)))
        precisions, determinants = inverses(every.covariances)
        fit = np.log(determinants) + np.einsum("nij,ji->n", precisions, usual)
        self._weigh(every.log_odds - 0.5 * self._tuning.beats_weigh * fit)

    def _with_beats(self, phase: float) -> tuple[Array, Array]:
        """States and covariances with what repeats from beat to beat, as far as that was known before, at a phase."""
        filters, size = len(self._hearts), SIZE_WITH_BEATS
        state, covariance = np.zeros((size, filters)), np.zeros((size, size, filters))
        state[:SIZE], covariance[:SIZE, :SIZE] = self._state, self._covariance
        if self._beat_shape is None:
            covariance[BEAT_SHAPE, BEAT_SHAPE] = beat_shape_covariance(self._hearts.covariances, self._tuning)
        else:
            state[BEAT_SHAPE], covariance[BEAT_SHAPE, BEAT_SHAPE] = each_filter(self._beat_shape, filters)
        # What of the displacement repeats is no longer random.
        parted = np.eye(size)
        parted[HEARTBEAT, BEAT_SHAPE] = -displacement_at(phase)[:, BEAT_SHAPE]
        return _changed(parted, state, covariance)

    def _without_beats(self, phase: float) -> tuple[Array, Array]:
        """States and covariances without that: what it does now, at a phase, is as random as all else."""
        joined = np.eye(SIZE, SIZE_WITH_BEATS)
        joined[HEARTBEAT, BEAT_SHAPE] = displacement_at(phase)[:, BEAT_SHAPE]
        return _changed(joined, self._state, self._covariance)

    def _block(self, block: slice) -> Estimate:
        """A block of the state, kept until the state changes: a pair's result asks for it many times."""
        known = self._blocks.get(block.start)
        if known is None:
            read = _block_of(block.start, len(self._state))
            known = self._blocks[block.start] = self._seen_along(read)
        return Estimate(known.displacement.copy(), known.covariance.copy())

    @property
    def origin_b(self) -> Estimate:
        """The displacement at plane B's first exposure, as known by now."""
        return self._block(ORIGIN_B)

    @property
    def at_a(self) -> Estimate:
        """The displacement at plane A's last exposure, with all that came since."""
        return self._block(AT_A)

    def beyond(self, limit_m: float, more: Array, across: Array = _IDENTITY_3) -> float:
        """Probability that `at_a` is farther off than a limit, metres, each heart by itself.

        A heart that is seldom so strong is seldom far off, and then by much: no one normal distribution says so.

        Args:
            limit_m: of the distance.
            more: (3, 3) m² of what else it may be off by.
            across: (3, 3) onto the directions in which the filters are asked: all of them if not given.
        """
        off = (self._state[AT_A].T - self.at_a.displacement) @ across
        covariances = across @ self._covariance[AT_A, AT_A].transpose(2, 0, 1) @ across
        beyond = probabilities_beyond(limit_m, covariances + more, off)
        return float(self.weights @ beyond)

    def _seen_along(self, function: Array) -> Estimate:
        """A linear function (3, N) of the state, over all filters."""
        if has_kernels():
            from lasso_motion_ros.motion import kernels

            return Estimate(*kernels.mixed(self.weights, self._state, self._covariance, function))
        within = function @ self._weighted(self._covariance) @ function.T
        return Estimate(*self._mixed(function @ self._state, within))

    def _mixed(self, each: Array, within: Array) -> tuple[Array, Array]:
        """(K,) mean and (K, K) covariance of (K, filters): the filters' own (K, K), and what they differ by."""
        mean = each @ self.weights
        off = each - mean[:, None]
        return mean, within + (self.weights * off) @ off.T

    def _weighted(self, covariance: Array) -> Array:
        """(K, K) mean of the filters' (K, K, filters)."""
        return np.asarray(covariance @ self.weights)

    def _drop_hearts(self) -> None:
        """Go on without the ways for which the measurements speak far less than for the best, whatever their odds."""
        evidence = self._log_weights - self._hearts.log_odds
        kept = self._hearts.is_any_way | (evidence >= evidence.max() + math.log(self._tuning.heartbeat_kept))
        if not kept.all():
            log_weights = self._log_weights[kept]
            self._hearts = self._hearts.only(kept)
            self._become(np.compress(kept, self._state, -1), np.compress(kept, self._covariance, -1))
            self._weigh(log_weights)

    def _become(self, state: Array, covariance: Array) -> None:
        # A new dictionary: a copy of this filter goes on with the old one.
        self._state, self._covariance, self._blocks = state, covariance, {}
        self._forget_foreseen()

    def _weigh(self, log_weights: Array) -> None:
        """Take over other weights (filters,), by their logarithms; what they sum up to is worked out when asked for."""
        self._log_weights = log_weights
        self._weights, self._blocks = None, {}
        self._forget_foreseen()

    def _forget_foreseen(self) -> None:
        self._foretold = self._ahead = self._later = None

    def _clone(self, function: Array, block: slice) -> None:
        """Make a block of the state a function (3, N) of it."""
        state, covariance = self._state.copy(), self._covariance.copy()
        (size, filters), state[block] = state.shape, function @ state
        rows = (function @ covariance.reshape(size, -1)).reshape(-1, size, filters)
        covariance[block], covariance[:, block] = rows, rows.swapaxes(0, 1)
        covariance[block, block] = function @ rows
        self._become(state, covariance)

    def _update(self, seen: Observation, function: Array) -> float:
        """Take in a measurement; returns the logarithm of its probability density, per metre and component.

        Args:
            seen: of a function of the state, as is `Observation` of the displacement.
            function: (3, N).
        """
        h = seen.across @ function
        state, covariance, distance, peaks = measured(self._state, self._covariance, h, seen.value, seen.covariance)
        self._become(state, covariance)
        freedom, unusual = self._tuning.freedom, self._tuning.unusual_share
        # Of Student's distribution: a beat or a breath unlike those before is rare, not impossible.
        densities = peaks - 0.5 * (freedom + len(seen.value)) * np.log1p(distance / freedom)
        weights = (1.0 - unusual) * self.weights + unusual * self._hearts.odds
        self._weigh(self._log_weights + densities)
        highest = float(densities.max())
        return highest + math.log(float(weights @ np.exp(densities - highest)) + 1e-300)
