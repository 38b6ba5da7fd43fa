"""The part of the ring's turning that repeats with the breathing, and so is the atrium's; weighted by its evidence.

The ring tilts and spins by itself, with the heartbeat and in the hand, while the atrium does not. What the atrium does
turn, it turns with the breath: in proportion to how far the breath has moved it. A Bayesian linear regression (Bishop,
"Pattern Recognition and Machine Learning", 2006, section 3.3) of the ring's turn on that displacement tells the two
apart, with the ring's stretch as a witness of the heartbeat. How much of it is used is the probability that it turns
at all: the Bayes factor against no rotation (ibid., section 3.4) at even odds. So the pose never jumps from one to the
other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.core.logistic import logistic

Array = npt.NDArray[np.float64]

# Columns of the regression: a constant (the ring's own tilt at the reference), displacement, stretch of the ring.
CONSTANT, MOVED, STRETCHED = range(3)
OTHERS = slice(CONSTANT, STRETCHED + 1, STRETCHED - CONSTANT)


@dataclass(frozen=True)
class _Tuning:
    """What is expected of the turning before any has been seen."""

    # Standard deviations of the regression's coefficients.
    own_tilt_rad: float = np.radians(3.0)
    turn_rad_per_m: float = np.radians(70.0)  # a degree in 14 mm, about any axis
    turn_per_stretch_rad: float = 1.0
    own_turn_rad: float = np.radians(1.5)  # the ring's own turning before any has been seen, which counts as
    own_turn_pairs: float = 2.0  # so many pairs
    smallest_sd_rad: float = np.radians(0.25)  # what does not follow the breath's depth: hysteresis, say
    fewest_pairs: int = 2  # before, there is no direction of breathing
    # Pairs closer in time than this show nearly the same phase of the heartbeat, and count for less.
    independent_s: float = 0.3
    rounds: int = 3  # of noise and coefficients in turn


TUNING = _Tuning()
PRIOR_SD = np.array([TUNING.own_tilt_rad, TUNING.turn_rad_per_m, TUNING.turn_per_stretch_rad])


@dataclass(frozen=True, eq=False)
class Rotation:
    """The atrium's rotation since the reference.

    Attributes:
        vector: (3,) rotation vector, rad; the mean over both models, with a rotation and without.
        covariance: (3, 3) rad²; near the prior's where the vector is held near zero.
    """

    vector: Array
    covariance: Array


@dataclass(frozen=True, eq=False)
class _Fit:
    axis: Array  # (3,) unit direction of breathing
    slope: Array  # (3,) rad a metre along it
    slope_covariance: Array  # (3, 3)
    probability: float  # that the atrium turns with the breath


class BreathingRotation:
    """Learns from pair to pair; sums only, so that it costs the same after an hour."""

    def __init__(self) -> None:
        self._pairs, self._last_s = 0, -np.inf
        self._count = 0.0  # of pairs, each as far as it is independent of the one before
        # Sums of products of (1, displacement (3), stretch, turn (3)).
        self._sums = np.zeros((8, 8))
        self._fit: _Fit | None = None

    @property
    def probability(self) -> float:
        """Of a rotation that goes with the breath, against none; even odds before any pair."""
        return 0.5 if self._fit is None else self._fit.probability

    def learn(self, time_s: float, displacement: Array, turn: Array, stretch: float) -> None:
        """Take in one sure pair.

        Args:
            time_s: of the pair; later than that of the last.
            displacement: (3,) of the ring's centre since the first pair, metres.
            turn: (3,) rotation vector of the ring since then, rad.
            stretch: logarithm of its size since then.
        """
        weight = min(1.0, (time_s - self._last_s) / TUNING.independent_s)
        row = np.concatenate([[1.0], displacement, [stretch], turn])
        self._sums = self._sums + weight * np.outer(row, row)
        self._pairs, self._count, self._last_s = self._pairs + 1, self._count + weight, time_s
        self._fit = self._regression() if self._pairs >= TUNING.fewest_pairs else None

    def between(self, reference: Array, displacement: Array) -> Rotation:
        """The rotation from the reference's displacement (3,) m to another."""
        moved, fit = displacement - reference, self._fit
        squared = float(moved @ moved)
        prior, unexplained = PRIOR_SD[MOVED] ** 2 * np.eye(3), TUNING.smallest_sd_rad**2 * np.eye(3)
        if fit is None:
            return Rotation(np.zeros(3), squared * prior + unexplained)
        along, p = float(fit.axis @ moved), fit.probability
        turned = fit.slope * along
        known = fit.slope_covariance * along**2 + (1.0 - p) * np.outer(turned, turned)
        # Without a rotation the mixture would be certain; what has not been seen yet may still turn as the prior says,
        # and so may what lies across the breathing's axis.
        unseen = p * max(squared - along**2, 0.0) + (1.0 - p) * squared
        return Rotation(p * turned, p * known + unseen * prior + unexplained)

    def _regression(self) -> _Fit:
        if has_kernels():
            from lasso_motion_ros.motion.rotation_kernels import regression

            axis, slope, slope_variance, log_odds = regression(
                self._sums, self._count, PRIOR_SD, TUNING.own_turn_rad, TUNING.own_turn_pairs, TUNING.rounds
            )
            return _Fit(axis, slope, slope_variance * np.eye(3), logistic(log_odds))
        moments = self._sums[:5, :5]
        scatter = moments[1:4, 1:4] - np.outer(moments[0, 1:4], moments[0, 1:4]) / self._count
        axis = np.linalg.eigh(scatter)[1][:, -1]
        columns = np.zeros((5, 3))
        columns[0, CONSTANT] = columns[4, STRETCHED] = 1.0
        columns[1:4, MOVED] = axis
        square = columns.T @ moments @ columns
        cross = columns.T @ self._sums[:5, 5:]
        total = float(np.trace(self._sums[5:, 5:]))
        posterior = _Posterior(square, cross, PRIOR_SD)
        variance, expected = TUNING.own_turn_rad**2, 3.0 * TUNING.own_turn_pairs
        for _ in range(TUNING.rounds):
            residual = total - posterior.explained_squares(variance)
            # Each pair tells three components; as many coefficients were fitted as there are columns, three times.
            known = 3.0 * max(self._count - len(PRIOR_SD), 0)
            variance = (expected * TUNING.own_turn_rad**2 + max(residual, 0.0)) / (expected + known)
        without = _Posterior(square[OTHERS, OTHERS], cross[OTHERS], PRIOR_SD[OTHERS])
        slopes, covariance = posterior.coefficients(variance)
        evidence = posterior.log_evidence(variance) - without.log_evidence(variance)
        return _Fit(axis, slopes[MOVED], covariance[MOVED, MOVED] * np.eye(3), logistic(float(evidence)))


class _Posterior:
    """Coefficients of three components with common regressors, for any variance of the noise.

    In the eigenvectors of the regressors' sums of squares, taken in units of the prior's standard deviations, all
    coefficients are independent of each other, whatever the noise.

    Args:
        square: (K, K) sums of products of the regressors.
        cross: (K, 3) of regressors and components.
        prior_sd: (K,) standard deviations of the coefficients' prior.
    """

    def __init__(self, square: Array, cross: Array, prior_sd: Array) -> None:
        self._squares, vectors = np.linalg.eigh(prior_sd[:, None] * square * prior_sd)
        self._vectors = prior_sd[:, None] * vectors
        self._cross = self._vectors.T @ cross
        self._cross_squared = (self._cross * self._cross).sum(axis=1)

    def explained_squares(self, variance: float) -> float:
        """By how much the sum of the components' squares is less about their regression."""
        shrunk = self._squares + variance
        return float((self._cross_squared * (2.0 / shrunk - self._squares / shrunk**2)).sum())

    def coefficients(self, variance: float) -> tuple[Array, Array]:
        """Their mean (K, 3) and their covariance (K, K), the same for each component."""
        shrunk = self._squares + variance
        mean = (self._vectors / shrunk) @ self._cross
        return mean, np.asarray((self._vectors * (variance / shrunk)) @ self._vectors.T)

    def log_evidence(self, variance: float) -> float:
        """Logarithm of the marginal likelihood, but for what all models share."""
        explained = float((self._cross_squared / (self._squares + variance)).sum()) / variance
        return 0.5 * explained - 1.5 * float(np.log1p(self._squares / variance).sum())
