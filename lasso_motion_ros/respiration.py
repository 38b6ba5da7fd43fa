"""The motion of the loop's centre in time: a Gaussian process, filtered exposure by exposure.

Every exposure of a plane measures the centre across its ray, at its own time. A Kalman filter over a
stationary process joins them: it brackets plane A's exposure between two of plane B's, carries the depth over
a missing plane, predicts the next pair and gives the covariance of all that. The process is a Matérn-5/2 in
state-space form (Hartikainen and Särkkä, "Kalman filtering and smoothing solutions to temporal Gaussian
process regression models", MLSP 2010), its directional covariance learned from the motion so far: breathing
nearly follows a line, so depth follows from height.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros import matern

Array = npt.NDArray[np.float64]

# Blocks of three (x, y, z) in the state.
POSITION, VELOCITY, ACCELERATION, HEARTBEAT, MEAN, ORIGIN_B, AT_A = (slice(3 * i, 3 * i + 3) for i in range(7))
SIZE = 21
DISPLACEMENT = np.zeros((3, SIZE))  # as a function of the state: breathing, heartbeat and mean together
DISPLACEMENT[:, POSITION] = DISPLACEMENT[:, HEARTBEAT] = DISPLACEMENT[:, MEAN] = np.eye(3)

FIRST_SPREAD_M = 0.010  # standard deviation of the motion in any direction before any has been seen
SMALLEST_SPREAD_M = 0.0008  # and at least, however little has been seen
SEEN_SPREAD_M = 0.003  # root sum of squares of the motion seen, beyond which it outweighs the first spread
SIDEWAYS_SHARE = 0.2  # of the motion's size, expected across its direction: breathing nearly follows a line
# After these many sure displacements the past is gone through again with the spread learned since. What it changes
# is what the loop did between the first two exposures, and with it every displacement's depth.
REBUILD_AT = frozenset({*range(1, 9), 12, 16, 24})
LONGEST_HISTORY = 24  # sure displacements after which the past is no longer kept
TIME_SCALE_S = 1.0  # of breathing, which is smoother than a Matérn process: longer than its period over 2π
HEARTBEAT_SPREAD_M = 0.00015
HEARTBEAT_TIME_SCALE_S = 0.12


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
    """A plane's view of the displacement.

    Attributes:
        across: (2, 3) unit vectors across the ray.
        value: (2,) the displacement along them, metres.
        covariance: (2, 2) m².
    """

    across: Array
    value: Array
    covariance: Array


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

    def __init__(self, time_a_s: float, time_b_s: float) -> None:
        """Start at the reference pair's two times of exposure, seconds."""
        self._start_s = time_a_s, time_b_s
        self._scatter = np.zeros((3, 3))
        self._learned = 0
        self._scatter_mean = np.zeros(3)
        self._history: tuple[_Exposure, ...] = ()
        self._keeps_history = True
        self._begin()

    def _begin(self) -> None:
        """The state at plane B's first exposure, with the spread known by now."""
        self._time_s, time_b_s = self._start_s
        self._state = np.zeros(SIZE)
        self._covariance = np.zeros((SIZE, SIZE))
        spread = self.spread
        self._covariance[:9, :9] = _stationary(spread)
        self._covariance[HEARTBEAT, HEARTBEAT] = HEARTBEAT_SPREAD_M**2 * np.eye(3)
        self._covariance[MEAN, MEAN] = spread
        # The displacement is zero by definition here: position + heartbeat + mean = 0, exactly.
        self._update(_displacement(), np.zeros(3), 1e-14 * np.eye(3))
        self._clone(AT_A)
        self._advance(time_b_s)
        self._clone(ORIGIN_B)

    def copy(self) -> RespiratoryMotion:
        """An independent filter in the same state; arrays are never changed in place, so they are shared."""
        return copy.copy(self)

    @property
    def spread(self) -> Array:
        """(3, 3) covariance of the motion about its mean, learned so far, m²."""
        seen = float(np.trace(self._scatter))
        sideways = SIDEWAYS_SHARE**2 * seen / max(self._learned, 1)
        unknown = FIRST_SPREAD_M**2 / (1.0 + seen / SEEN_SPREAD_M**2)
        first = (sideways + unknown) * np.eye(3)  # which counts as one displacement
        return np.asarray((self._scatter + first) / (self._learned + 1) + SMALLEST_SPREAD_M**2 * np.eye(3))

    @property
    def mean(self) -> Array:
        """(3,) mean displacement so far, metres."""
        return self._scatter_mean.copy()

    def predict(self, time_s: float) -> Estimate:
        """The displacement expected at a later time, nothing being changed."""
        state, covariance = self._propagated(time_s)
        h = _displacement()
        return Estimate(h @ state, h @ covariance @ h.T)

    def expected_between(self, time_s: float) -> Estimate:
        """How far plane B's origin lies from the displacement at a time: what B measures, in 3-D."""
        state, covariance = self._propagated(time_s)
        h = _displacement()
        h[:, ORIGIN_B] = -np.eye(3)
        return Estimate(h @ state, h @ covariance @ h.T)

    def observe(self, time_s: float, *, a: Observation | None = None, b: Observation | None = None) -> None:
        """Take in one exposure's measurements; times must not decrease.

        Plane B's, though later, still sharpens `at_a`, which is of the last `mark_a`.
        """
        self._remember(_Exposure(time_s, a, b, is_mark=False))
        self._advance(time_s)
        if a is not None:
            h = a.across @ _displacement()
            self._update(h, a.value, a.covariance)
        if b is not None:
            h = _displacement()
            h[:, ORIGIN_B] = -np.eye(3)
            self._update(b.across @ h, b.value, b.covariance)

    def mark_a(self, time_s: float) -> None:
        """Make a time that of `at_a`: plane A's exposure, or what would have been it."""
        self._remember(_Exposure(time_s, None, None, is_mark=True))
        self._advance(time_s)
        self._clone(AT_A)

    @property
    def origin_b(self) -> Estimate:
        """The displacement at plane B's first exposure, as known by now."""
        return Estimate(self._state[ORIGIN_B].copy(), self._covariance[ORIGIN_B, ORIGIN_B].copy())

    @property
    def at_a(self) -> Estimate:
        """The displacement at plane A's last exposure, with all that came since."""
        return Estimate(self._state[AT_A].copy(), self._covariance[AT_A, AT_A].copy())

    def learn(self, displacement: Array) -> None:
        """Learn the directions of the motion from one sure displacement (3,) m; `at_a` may be revised by it."""
        self._learned += 1
        delta = displacement - self._scatter_mean
        self._scatter_mean = self._scatter_mean + delta / (self._learned + 1)  # the reference's zero counts, too
        self._scatter = self._scatter + np.outer(delta, displacement - self._scatter_mean)
        if not self._keeps_history:
            return
        if self._learned in REBUILD_AT and self._start_s[0] != self._start_s[1]:
            self._rebuild()
        if self._learned >= LONGEST_HISTORY:
            self._history, self._keeps_history = (), False

    def move(self, displacement: Array) -> None:
        """Take the loop to have been put elsewhere, (3,) m: how it breathes is kept, and it breathes about there."""
        shift = displacement - DISPLACEMENT @ self._state
        state = self._state.copy()
        state[MEAN] += shift
        self._state = state
        self._scatter_mean = self._scatter_mean + shift
        self._history, self._keeps_history = (), False  # it tells of another place

    def doubt(self, displacement: Array) -> float:
        """By what factor the covariance (3, 3) understates a depth that rests on the direction learned so far.

        That direction is known from few displacements; further out than they reach it may be off by more
        (predictive distribution of a regression: 1 + the squared Mahalanobis distance over their number).
        """
        delta = displacement - self._scatter_mean
        return 1.0 + float(delta @ np.linalg.solve(self.spread, delta)) / (self._learned + 1)

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
        interval = max(0.0, time_s - self._time_s)
        # Every block of three moves alike in x, y and z: transition = (7, 7) ⊗ 1.
        blocks = np.eye(SIZE // 3)
        blocks[:3, :3] = transition = matern.transition(interval, TIME_SCALE_S)
        blocks[3, 3] = decay = math.exp(-interval / HEARTBEAT_TIME_SCALE_S)
        stationary = matern.stationary(TIME_SCALE_S)
        added = np.zeros((SIZE // 3, 3, SIZE // 3, 3))
        growth = stationary - transition @ stationary @ transition.T
        added[:3, :, :3, :] = growth[:, None, :, None] * self.spread[None, :, None, :]
        added[3, :, 3, :] = HEARTBEAT_SPREAD_M**2 * (1.0 - decay**2) * np.eye(3)
        phi = _in_each_axis(blocks)
        covariance = phi @ self._covariance @ phi.T + added.reshape(SIZE, SIZE)
        return phi @ self._state, 0.5 * (covariance + covariance.T)

    def _advance(self, time_s: float) -> None:
        if time_s > self._time_s:
            self._state, self._covariance = self._propagated(time_s)
            self._time_s = time_s

    def _clone(self, block: slice) -> None:
        mapping = np.eye(SIZE)
        mapping[block] = _displacement()
        self._state = mapping @ self._state
        self._covariance = mapping @ self._covariance @ mapping.T

    def _update(self, h: Array, value: Array, noise: Array) -> None:
        cross = self._covariance @ h.T
        gain = np.linalg.solve(h @ cross + noise, cross.T).T
        self._state = self._state + gain @ (value - h @ self._state)
        keep = np.eye(SIZE) - gain @ h
        # Joseph's form stays positive where nearly noise-free measurements would not.
        self._covariance = keep @ self._covariance @ keep.T + gain @ noise @ gain.T


def _displacement() -> Array:
    """(3, SIZE) the displacement as a function of the state."""
    return DISPLACEMENT.copy()


def _in_each_axis(blocks: Array) -> Array:
    """(3 N, 3 N) matrix that acts on x, y and z alike as `blocks` (N, N) does on the state's blocks."""
    count = len(blocks)
    full = np.zeros((count, 3, count, 3))
    for axis in range(3):
        full[:, axis, :, axis] = blocks
    return full.reshape(3 * count, 3 * count)


def _stationary(spread: Array) -> Array:
    """(9, 9) stationary covariance of value, slope and curvature for a directional covariance (3, 3)."""
    return np.kron(matern.stationary(TIME_SCALE_S), spread).astype(np.float64)
