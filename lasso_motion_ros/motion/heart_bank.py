"""Kalman filters side by side that differ in what the heart may do, each weighted by what was measured.

A static bank of models (Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation",
2001, section 11.6.2): each filter's weight is the probability that it gives to the measurements so far.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.covariance import probabilities_beyond
from lasso_motion_ros.motion.hearts import Hearts
from lasso_motion_ros.motion.motion_model import (
    AT_A,
    DISPLACEMENT,
    HEARTBEAT,
    ORIGIN_B,
    SIZE,
    Estimate,
    MotionTuning,
    measured,
)

Array = npt.NDArray[np.float64]

_BLOCKS = {block.start: np.eye(SIZE)[block] for block in (HEARTBEAT, ORIGIN_B, AT_A)}  # as functions of the state


class HeartBank:
    """The filters' states at one time; arrays are never changed in place, so that copies share them.

    Args:
        hearts: what the heart may do, of each filter.
        tuning: what is expected of measurements.
    """

    def __init__(self, hearts: Hearts, tuning: MotionTuning) -> None:
        self._hearts, self._tuning = hearts, tuning
        self._weights: Array | None = None  # not worked out yet
        # What was asked for is kept until the state changes: blocks of it, states at later times, the last prediction.
        self._blocks: dict[int, Estimate] = {}
        self._ahead: dict[float, tuple[Array, Array]] = {}
        self._foretold: tuple[float, Estimate] | None = None
        self._weigh(hearts.log_odds)

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
    def heartbeat(self) -> Array:
        """(3, 3) m² covariance of the heartbeat's motion, as learned so far."""
        return np.asarray(np.tensordot(self.weights, self._hearts.covariances, 1))

    def _block(self, block: slice) -> Estimate:
        """A block of the state, kept until the state changes: a pair's result asks for it many times."""
        known = self._blocks.get(block.start)
        if known is None:
            known = self._blocks[block.start] = self._seen_along(_BLOCKS[block.start], self._state, self._covariance)
        return Estimate(known.displacement.copy(), known.covariance.copy())

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

    def _drop_hearts(self) -> None:
        """Go on without the ways for which the measurements speak far less than for the best, whatever their odds."""
        evidence = self._log_weights - self._hearts.log_odds
        kept = self._hearts.is_any_way | (evidence >= evidence.max() + math.log(self._tuning.heartbeat_kept))
        if not kept.all():
            log_weights = self._log_weights[kept]
            self._hearts = self._hearts.only(kept)
            self._become(self._state[kept], self._covariance[kept])
            self._weigh(log_weights)

    def _become(self, state: Array, covariance: Array) -> None:
        # New dictionaries: a copy of this filter goes on with the old ones.
        self._state, self._covariance, self._ahead, self._blocks = state, covariance, {}, {}
        self._foretold = None

    def _weigh(self, log_weights: Array) -> None:
        """Take over other weights (filters,), by their logarithms; what they sum up to is worked out when asked for."""
        self._log_weights = log_weights
        self._weights = self._foretold = None
        self._blocks = {}

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
