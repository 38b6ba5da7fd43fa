"""The motion of the ring's centre in time: a Gaussian process, filtered exposure by exposure.

Every exposure of a plane measures the centre across its ray, at its own time. A Kalman filter over a
stationary process joins them: it brackets plane A's exposure between two of plane B's, carries the depth over
a missing plane, predicts the next pair and gives the covariance of all that. The process is a Matérn-5/2 in
state-space form (Hartikainen and Särkkä, "Kalman filtering and smoothing solutions to temporal Gaussian
process regression models", MLSP 2010), its directional covariance learned from the motion so far, at first that of
`breathing_prior`: breathing nearly follows a line, so depth follows from height.

How far the heartbeat moves the atrium differs tenfold between patients. It is learned: filters that differ only in that
run side by side, each weighted by the probability that it gives to the measurements so far (a static bank of models:
Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001, section 11.6.2).
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.covariance import squared_mahalanobis
from lasso_motion_ros.motion import matern

Array = npt.NDArray[np.float64]

# Blocks of three (x, y, z) in the state.
POSITION, VELOCITY, ACCELERATION, HEARTBEAT, MEAN, ORIGIN_B, AT_A = (slice(3 * i, 3 * i + 3) for i in range(7))
SIZE = 21
DISPLACEMENT = np.zeros((3, SIZE))  # as a function of the state: breathing, heartbeat and mean together
DISPLACEMENT[:, POSITION] = DISPLACEMENT[:, HEARTBEAT] = DISPLACEMENT[:, MEAN] = np.eye(3)
SINCE_B = DISPLACEMENT.copy()  # how far the displacement is from plane B's origin: what B measures, in 3-D
SINCE_B[:, ORIGIN_B] = -np.eye(3)

FIRST_SPREAD_M = 0.010  # standard deviation of the motion before any has been seen, along the body if that is known
SMALLEST_SPREAD_M = 0.0008  # and at least, however little has been seen
SEEN_SPREAD_M = 0.003  # root sum of squares of the motion seen, beyond which it outweighs the first spread
SIDEWAYS_SHARE = 0.25  # of the motion's size, expected across its direction: breathing nearly follows a line
# After these many sure displacements the past is gone through again with the spread learned since. What it changes
# is what the loop did between the first two exposures, and with it every displacement's depth.
REBUILD_AT = frozenset({*range(1, 9), 12, 16, 24})
LONGEST_HISTORY = 24  # sure displacements after which the past is no longer kept
TIME_SCALE_S = 1.0  # of breathing, which is smoother than a Matérn process: longer than its period over 2π
HEARTBEATS_M = np.array([0.00015, 0.0004, 0.0009, 0.0018])  # of the heartbeat's motion, standard deviations
HEARTBEAT_ODDS = np.array([0.25, 0.35, 0.25, 0.15])  # before any measurement
HEARTBEAT_TIME_SCALE_S = 0.12
HEARTBEAT_MEMORY_S = 60.0  # measurements older than this fade from the weights: rhythms change
FREEDOM = 4.0  # degrees of freedom of the measurements' distribution about what was foretold
SURGE_M, SURGE_M_S = 0.002, 0.02  # what a breath that sets in unforeseen adds, standard deviations
UNUSUAL_SHARE = 0.1  # a heartbeat may be of any size once in a while, whatever was learned
FILTERS = len(HEARTBEATS_M)
_IDENTITY, _IDENTITY_3 = np.eye(SIZE), np.eye(3)
TIMES_AHEAD = 8  # predictions kept; while the loop stays lost they are for ever new times


@dataclass(frozen=True, eq=False)
class Estimate:
    """The centre's displacement since the reference, at one time.

    Attributes:
        displacement: (3,) metres, world frame.
        covariance: (3, 3) m².
    """

    displacement: Array
    covariance: Array


@dataclass(frozen=True, eq=False)
class Observation:
    """A plane's view of the displacement, or another linear measurement of it.

    Attributes:
        across: (N, 3) unit vectors; a plane's are the two across its ray.
        value: (N,) the displacement along them, metres.
        covariance: (N, N) m².
    """

    across: Array
    value: Array
    covariance: Array


@dataclass(frozen=True)
class Likelihood:
    """How well measurements were foretold; natural logarithms of probability densities, per metre and component.

    Attributes:
        density: at what was measured.
        peak: at what was foretold, the largest that it could have been.
    """

    density: float
    peak: float

    def __add__(self, other: Likelihood) -> Likelihood:
        return Likelihood(self.density + other.density, self.peak + other.peak)


@dataclass(frozen=True, eq=False)
class _Exposure:
    """Something that was taken in: measurements, or (`is_mark`) the time of plane A's exposure."""

    time_s: float
    a: Observation | None
    b: Observation | None
    is_mark: bool


class RespiratoryMotion:
    """Filter for the displacement of the loop's centre; at the reference's exposure in plane A it is zero.

    Plane B's first exposure may be later: what the loop had moved until then is a part of the state
    (`ORIGIN_B`), since plane B's appearance, and so its every measurement, refers to it.
    """

    def __init__(
        self,
        time_a_s: float,
        time_b_s: float,
        *,
        shape: Array = _IDENTITY_3,
        between: Observation | None = None,
    ) -> None:
        """Start at the reference pair.

        Args:
            time_a_s: plane A's exposure, seconds.
            time_b_s: plane B's, not earlier.
            shape: (3, 3) covariance of the motion before any has been seen, in units of its variance along the body.
            between: what the reference pair shows of the displacement at plane B's exposure.
        """
        self._start_s = time_a_s, time_b_s
        self._shape, self._between = shape, between
        self._scatter = np.zeros((3, 3))
        self._learned = 0
        self._scatter_mean = np.zeros(3)
        self._spread = self._learned_spread()
        self._history: tuple[_Exposure, ...] = ()
        self._keeps_history = True
        self._begin()

    def _begin(self) -> None:
        """The state at plane B's first exposure, with the spread known by now."""
        self._time_s, time_b_s = self._start_s
        self._log_weights = np.log(HEARTBEAT_ODDS)
        self._state = np.zeros((FILTERS, SIZE))
        self._covariance = np.zeros((FILTERS, SIZE, SIZE))
        spread = self.spread
        self._covariance[:, :9, :9] = _in_each_direction(matern.stationary(TIME_SCALE_S), spread)
        self._covariance[:, HEARTBEAT, HEARTBEAT] = np.square(HEARTBEATS_M)[:, None, None] * _IDENTITY_3
        self._covariance[:, MEAN, MEAN] = spread
        self._ahead: dict[float, tuple[Array, Array]] = {}
        # The displacement is zero by definition here: position + heartbeat + mean = 0, exactly.
        self._update(DISPLACEMENT, np.zeros(3), 1e-14 * _IDENTITY_3)
        self._clone(AT_A)
        self._advance(time_b_s)
        if self._between is not None:
            self._update(self._between.across @ DISPLACEMENT, self._between.value, self._between.covariance)
        self._clone(ORIGIN_B)
        self._log_weights = np.log(HEARTBEAT_ODDS)  # what holds by definition tells nothing of the heart

    def copy(self) -> RespiratoryMotion:
        """An independent filter in the same state; arrays are never changed in place, so they are shared."""
        return copy.copy(self)

    @property
    def spread(self) -> Array:
        """(3, 3) covariance of the motion about its mean, learned so far, m²."""
        return self._spread

    def _learned_spread(self) -> Array:
        seen = float(np.trace(self._scatter))
        sideways = SIDEWAYS_SHARE**2 * seen / max(self._learned, 1)
        unknown = FIRST_SPREAD_M**2 / (1.0 + seen / SEEN_SPREAD_M**2)
        first = sideways * _IDENTITY_3 + unknown * self._shape  # which counts as one displacement
        return np.asarray((self._scatter + first) / (self._learned + 1) + SMALLEST_SPREAD_M**2 * _IDENTITY_3)

    @property
    def mean(self) -> Array:
        """(3,) mean displacement so far, metres."""
        return self._scatter_mean.copy()

    def predict(self, time_s: float) -> Estimate:
        """The displacement expected at a later time, nothing being changed."""
        return self._mixed(DISPLACEMENT, *self._propagated(time_s))

    def expected_between(self, time_s: float) -> Estimate:
        """How far plane B's origin lies from the displacement at a time: what B measures, in 3-D."""
        return self._mixed(SINCE_B, *self._propagated(time_s))

    @property
    def weights(self) -> Array:
        """(FILTERS,) probability of each size of the heartbeat."""
        weights = np.exp(self._log_weights - self._log_weights.max())
        return np.asarray(weights / weights.sum())

    @property
    def heartbeat_m(self) -> float:
        """Standard deviation of the heartbeat's motion, as learned so far, metres."""
        return float(np.sqrt(self.weights @ np.square(HEARTBEATS_M)))

    def _mixed(self, h: Array, state: Array, covariance: Array) -> Estimate:
        """Mean and covariance of a linear function h (3, SIZE) of the state over all filters."""
        weights = self.weights
        each = state @ h.T
        mean = weights @ each
        off = each - mean
        within = np.tensordot(weights, h @ covariance @ h.T, 1)
        return Estimate(mean, within + (weights[:, None] * off).T @ off)

    def observe(self, time_s: float, *, a: Observation | None = None, b: Observation | None = None) -> Likelihood:
        """Take in one exposure's measurements; times must not decrease.

        Plane B's, though later, still sharpens `at_a`, which is of the last `mark_a`.

        Returns:
            How likely the measurements were, given all before.
        """
        self._remember(_Exposure(time_s, a, b, is_mark=False))
        self._advance(time_s)
        likelihood = Likelihood(0.0, 0.0)
        if a is not None:
            likelihood += self._update(a.across @ DISPLACEMENT, a.value, a.covariance)
        if b is not None:
            likelihood += self._update(b.across @ SINCE_B, b.value, b.covariance)
        return likelihood

    def mark_a(self, time_s: float) -> None:
        """Make a time that of `at_a`: plane A's exposure, or what would have been it."""
        self._remember(_Exposure(time_s, None, None, is_mark=True))
        self._advance(time_s)
        self._clone(AT_A)

    @property
    def origin_b(self) -> Estimate:
        """The displacement at plane B's first exposure, as known by now."""
        return self._mixed(_IDENTITY[ORIGIN_B], self._state, self._covariance)

    @property
    def at_a(self) -> Estimate:
        """The displacement at plane A's last exposure, with all that came since."""
        return self._mixed(_IDENTITY[AT_A], self._state, self._covariance)

    def learn(self, displacement: Array) -> None:
        """Learn the directions of the motion from one sure displacement (3,) m; `at_a` may be revised by it."""
        self._learned += 1
        delta = displacement - self._scatter_mean
        self._scatter_mean = self._scatter_mean + delta / (self._learned + 1)  # the reference's zero counts, too
        self._scatter = self._scatter + np.outer(delta, displacement - self._scatter_mean)
        self._spread, self._ahead = self._learned_spread(), {}
        if not self._keeps_history:
            return
        if self._learned in REBUILD_AT and self._start_s[0] != self._start_s[1]:
            self._rebuild()
        if self._learned >= LONGEST_HISTORY:
            self._history, self._keeps_history = (), False

    def move(self, displacement: Array) -> None:
        """Take the loop to have been put elsewhere, (3,) m: how it breathes is kept, and it breathes about there."""
        shift = displacement - self._state @ DISPLACEMENT.T
        state = self._state.copy()
        state[:, MEAN] += shift
        self._become(state, self._covariance)
        self._scatter_mean = self._scatter_mean + self.weights @ shift
        self._history, self._keeps_history = (), False  # it tells of another place

    def surged(self) -> RespiratoryMotion:
        """The same motion, if a breath has just set in (or a cough) as nothing before foretold."""
        surged = self.copy()
        covariance = self._covariance.copy()
        covariance[:, VELOCITY, VELOCITY] += SURGE_M_S**2 * _IDENTITY_3
        covariance[:, POSITION, POSITION] += SURGE_M**2 * _IDENTITY_3
        surged._become(self._state, covariance)
        return surged

    def moved_by_hand(self, reach_m: float) -> RespiratoryMotion:
        """The same motion of a ring that somebody may just have put elsewhere, within a reach (standard deviation)."""
        moved = self.copy()
        covariance = self._covariance.copy()
        covariance[:, MEAN, MEAN] += reach_m**2 * _IDENTITY_3
        moved._become(self._state, covariance)
        return moved

    def doubt(self, displacement: Array) -> float:
        """By what factor the covariance (3, 3) understates a depth that rests on the direction learned so far.

        That direction is known from few displacements; further out than they reach it may be off by more
        (predictive distribution of a regression: 1 + the squared Mahalanobis distance over their number).
        """
        delta = displacement - self._scatter_mean
        return 1.0 + squared_mahalanobis(delta, self.spread) / (self._learned + 1)

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
            if len(self._ahead) >= TIMES_AHEAD:
                self._ahead.clear()
            ahead = self._ahead[time_s] = self._moved_on(time_s - self._time_s)
        return ahead

    def _moved_on(self, interval_s: float) -> tuple[Array, Array]:
        scales_s = TIME_SCALE_S, HEARTBEAT_TIME_SCALE_S
        transition, breathing, renewed = _passage(round(interval_s * 1e9), scales_s)
        covariance = transition @ self._covariance @ transition.T
        covariance[:, :9, :9] += _in_each_direction(breathing, self._spread)
        covariance[:, HEARTBEAT, HEARTBEAT] += (renewed * np.square(HEARTBEATS_M))[:, None, None] * _IDENTITY_3
        return self._state @ transition.T, 0.5 * (covariance + covariance.swapaxes(-1, -2))

    def _become(self, state: Array, covariance: Array) -> None:
        # A new dictionary: a copy of this filter goes on with the old one.
        self._state, self._covariance, self._ahead = state, covariance, {}

    def _advance(self, time_s: float) -> None:
        if time_s > self._time_s:
            self._become(*self._propagated(time_s))
            fading = math.exp(-(time_s - self._time_s) / HEARTBEAT_MEMORY_S)
            self._log_weights = np.log(HEARTBEAT_ODDS) + fading * (self._log_weights - np.log(HEARTBEAT_ODDS))
            self._time_s = time_s

    def _clone(self, block: slice) -> None:
        """Make a block of the state the displacement now."""
        state, covariance = self._state.copy(), self._covariance.copy()
        state[:, block] = self._state @ DISPLACEMENT.T
        rows = DISPLACEMENT @ self._covariance
        covariance[:, block], covariance[:, :, block] = rows, rows.swapaxes(-1, -2)
        covariance[:, block, block] = rows @ DISPLACEMENT.T
        self._become(state, covariance)

    def _update(self, h: Array, value: Array, noise: Array) -> Likelihood:
        """Take in a measurement; returns how likely it was."""
        cross = self._covariance @ h.T
        expected = h @ cross + noise
        innovation = value - self._state @ h.T
        gain = np.linalg.solve(expected, cross.swapaxes(-1, -2)).swapaxes(-1, -2)
        keep = _IDENTITY - gain @ h
        # Joseph's form stays positive where nearly noise-free measurements would not.
        covariance = keep @ self._covariance @ keep.swapaxes(-1, -2) + gain @ noise @ gain.swapaxes(-1, -2)
        self._become(self._state + (gain @ innovation[..., None])[..., 0], covariance)
        distance = (innovation * np.linalg.solve(expected, innovation[..., None])[..., 0]).sum(axis=-1)
        peaks = -0.5 * (np.linalg.slogdet(expected)[1] + len(value) * math.log(2.0 * math.pi))
        # Of Student's distribution: a beat or a breath unlike those before is rare, not impossible.
        densities = peaks - 0.5 * (FREEDOM + len(value)) * np.log1p(distance / FREEDOM)
        weights = (1.0 - UNUSUAL_SHARE) * self.weights + UNUSUAL_SHARE * HEARTBEAT_ODDS
        self._log_weights = self._log_weights + densities
        highest = float(peaks.max())
        density, peak = (
            highest + math.log(float(weights @ np.exp(logs - highest)) + 1e-300) for logs in (densities, peaks)
        )
        return Likelihood(density, peak)


@lru_cache(maxsize=64)
def _passage(interval_ns: int, scales_s: tuple[float, float]) -> tuple[Array, Array, float]:
    """What an interval does to the state: (SIZE, SIZE) transition, and the noise that it adds; not to be changed.

    The noise is (3, 3) of breathing's value, slope and curvature, in units of the spread, and of the heartbeat, in
    units of its variance.
    Exposures come at few intervals, and the past is gone through again at the same ones.
    """
    interval_s, (scale_s, heartbeat_scale_s) = interval_ns * 1e-9, scales_s
    breathing, stationary = matern.transition(interval_s, scale_s), matern.stationary(scale_s)
    decay = math.exp(-interval_s / heartbeat_scale_s)
    transition = np.eye(SIZE)
    transition[:9, :9] = _in_each_direction(breathing, _IDENTITY_3)  # x, y and z move alike
    transition[HEARTBEAT, HEARTBEAT] = decay * _IDENTITY_3
    noise = stationary - breathing @ stationary @ breathing.T
    for array in (transition, noise):
        array.setflags(write=False)
    return transition, noise, 1.0 - decay**2


def _in_each_direction(blocks: Array, directions: Array) -> Array:
    """(9, 9) Kronecker product of what acts on value, slope and curvature (3, 3) and on x, y and z (3, 3)."""
    return np.asarray((blocks[:, None, :, None] * directions[None, :, None, :]).reshape(9, 9))
