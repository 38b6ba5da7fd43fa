"""How the ring's centre is expected to move: the state and its process, and how large the motion is in each direction.

The process is a Matérn-5/2 in state-space form (Hartikainen and Särkkä, "Kalman filtering and smoothing solutions to
temporal Gaussian process regression models", MLSP 2010), its directional covariance learned from the motion so far, at
first that of `breathing_prior`: breathing nearly follows a line, so depth follows from height. On top of it lie the
heartbeat, for which there are several sizes and shapes, each a model of its own, and a mean.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.covariance import inverses
from lasso_motion_ros.motion import matern, oscillator
from lasso_motion_ros.motion.hearts import Hearts, hearts

Array = npt.NDArray[np.float64]

# Blocks of three (x, y, z) in the state.
POSITION, VELOCITY, ACCELERATION, HEARTBEAT, HEART_SPEED, MEAN, ORIGIN_B, AT_A = (
    slice(3 * i, 3 * i + 3) for i in range(8)
)
BREATHING, BEATING = slice(0, 9), slice(9, 15)
SIZE = 24
# Where R peaks tell of the heart's beats, what repeats from beat to beat follows: a Fourier series in the beat's phase,
# of each harmonic the cosine's and the sine's coefficients (x, y, z).
HARMONICS = 3
BEAT_SHAPE = slice(SIZE, SIZE + 6 * HARMONICS)
SIZE_WITH_BEATS = BEAT_SHAPE.stop
_IDENTITY_3 = np.eye(3)
_SMALLEST_M2 = 1e-14  # variance of what is known by definition


@dataclass(frozen=True)
class MotionTuning:
    """What is expected of breathing, heart and measurements."""

    first_spread_m: float = 0.010  # standard deviation before any motion was seen, along the body if that is known
    smallest_spread_m: float = 0.0005  # and at least, however little has been seen
    seen_spread_m: float = 0.003  # root sum of squares of the motion seen, beyond which it outweighs the first spread
    sideways_share: float = 0.25  # of the motion's size, expected across its direction: breathing nearly follows a line
    # After these many sure displacements the past is gone through again with the spread learned since. What it changes
    # is what the loop did between the first two exposures, and with it every displacement's depth.
    rebuild_at: frozenset[int] = frozenset({*range(1, 9), 12, 16})
    longest_history: int = 16  # sure displacements after which the past is no longer kept
    # Of breathing, which is smoother than a Matérn process: longer than its period over 2π.
    time_scale_s: float = 1.0
    # The heart's motion: standard deviation, metres, and odds before any measurement. Alike in all directions,
    heartbeats_any_way: tuple[tuple[float, float], ...] = ((1e-4, 0.1), (4e-4, 0.1), (9e-4, 0.06), (1.8e-3, 0.04))
    # or to and fro on one way, which tells of what a plane shows of it what is in that plane's depth,
    heartbeats_one_way: tuple[tuple[float, float], ...] = ((4e-4, 0.25), (8e-4, 0.2), (1.4e-3, 0.15), (2.2e-3, 0.1))
    heartbeat_ways: int = 48  # of so many, 8 degrees from any on average,
    heartbeat_across_share: float = 0.15  # from which it strays by so much of how far it goes.
    heartbeat_ways_in_step: int = 12  # So many will do where plane B is exposed with plane A, or nearly so:
    heartbeat_across_share_in_step: float = 0.3
    in_step_s: float = 0.005
    heartbeat_kept: float = 1e-3  # ways less likely than the likeliest by this, odds apart, are not gone on with
    # A beat is smooth, and swings back: its correlation with itself is 0.89, 0.67, 0.31 and -0.08 after 40, 80, 140 and
    # 300 ms with these (docs/constants.md).
    heartbeat_damping_per_s: float = 8.0
    heartbeat_turning_rad_s: float = 10.0
    # With R peaks: of its variance so much repeats from beat to beat, and is that of the first harmonics by so much.
    beat_share: float = 0.75
    beat_harmonics: tuple[float, ...] = (0.55, 0.3, 0.15)
    beats_weigh: float = 8.0  # exposures, as which all that was learned with them counts where peaks stop coming
    heartbeat_memory_s: float = 60.0  # measurements older than this fade from the weights: rhythms change
    freedom: float = 4.0  # degrees of freedom of the measurements' distribution about what was foretold
    surge_m: float = 0.002  # what a breath that sets in unforeseen adds, standard deviations,
    surge_m_s: float = 0.02  # of place and speed
    unusual_share: float = 0.1  # a heartbeat may be of any size once in a while, whatever was learned

    def hearts(self, late_s: float) -> Hearts:
        """What the heart may do, before any measurement, where plane B is exposed so many seconds after plane A."""
        return self._hearts_in_step if late_s <= self.in_step_s else self._hearts

    @cached_property
    def _hearts(self) -> Hearts:
        return hearts(
            self.heartbeats_any_way, self.heartbeats_one_way, self.heartbeat_ways, self.heartbeat_across_share
        )

    @cached_property
    def _hearts_in_step(self) -> Hearts:
        ways, across_share = self.heartbeat_ways_in_step, self.heartbeat_across_share_in_step
        return hearts(self.heartbeats_any_way, self.heartbeats_one_way, ways, across_share)

    def passage(self, interval_s: float) -> Passage:
        """What an interval does to a state, seconds."""
        rates = self.heartbeat_damping_per_s, self.heartbeat_turning_rad_s
        return _passage(round(interval_s * 1e9), self.time_scale_s, *rates)

    def heart_kept(self, interval_s: float) -> float:
        """Share of what was learned of the heart that is left after an interval, seconds."""
        return math.exp(-interval_s / self.heartbeat_memory_s)


TUNING = MotionTuning()


@dataclass(frozen=True, eq=False)
class Estimate:
    """The centre's displacement since the seed pair, at one time.

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

    def of_two(self) -> Observation:
        """The same with two components, as a plane's has, the second of which tells nothing; of one or two."""
        if len(self.value) == 2:
            return self
        across, value, covariance = np.zeros((2, 3)), np.zeros(2), np.eye(2)
        across[:1], value[:1], covariance[:1, :1] = self.across, self.value, self.covariance
        return Observation(across, value, covariance)


NOTHING = Observation(np.zeros((2, 3)), np.zeros(2), np.eye(2))
"""Stands where there is no measurement."""


@dataclass(frozen=True, eq=False)
class Spread:
    """How large the motion is in each direction, learned from sure displacements.

    Attributes:
        shape: (3, 3) covariance of the motion before any has been seen, in units of its variance along the body.
        tuning: what is expected of it.
        count: displacements learned from.
        mean: (3,) of them, metres.
        scatter: (3, 3) sum of their products about the mean, m².
    """

    shape: Array
    tuning: MotionTuning
    count: int = 0
    mean: Array = field(default_factory=lambda: np.zeros(3))
    scatter: Array = field(default_factory=lambda: np.zeros((3, 3)))

    @cached_property
    def covariance(self) -> Array:
        """(3, 3) of the motion about its mean, m²."""
        tuning, seen = self.tuning, float(np.trace(self.scatter))
        sideways = tuning.sideways_share**2 * seen / max(self.count, 1)
        unknown = tuning.first_spread_m**2 / (1.0 + seen / tuning.seen_spread_m**2)
        first = sideways * _IDENTITY_3 + unknown * self.shape  # which counts as one displacement
        return np.asarray((self.scatter + first) / (self.count + 1) + tuning.smallest_spread_m**2 * _IDENTITY_3)

    @cached_property
    def way(self) -> Array:
        """(3,) unit vector along which the motion is largest."""
        return np.asarray(np.linalg.eigh(self.covariance)[1][:, -1])

    def learned(self, displacement: Array) -> Spread:
        """With one more displacement (3,) m."""
        count, delta = self.count + 1, displacement - self.mean
        mean = self.mean + delta / (count + 1)  # the seed pair's zero counts, too
        return replace(self, count=count, mean=mean, scatter=self.scatter + np.outer(delta, displacement - mean))

    def moved(self, shift: Array) -> Spread:
        """The same about another mean, (3,) m from the present one."""
        return replace(self, mean=self.mean + shift)


@lru_cache(maxsize=256)
def displacement_at(phase: float | None) -> Array:
    """(3, N) the displacement as a function of the state: breathing, heartbeat and mean together; not to be changed.

    Args:
        phase: of the heart's beat, 0 to 1; None for a state that knows of none.
    """
    displacement = np.zeros((3, SIZE if phase is None else SIZE_WITH_BEATS))
    displacement[:, POSITION] = displacement[:, HEARTBEAT] = displacement[:, MEAN] = _IDENTITY_3
    if phase is not None:
        angles = 2.0 * math.pi * phase * np.arange(1, HARMONICS + 1)
        waves = np.stack([np.cos(angles), np.sin(angles)], axis=1).reshape(-1)
        displacement[:, BEAT_SHAPE] = np.kron(waves, _IDENTITY_3)
    displacement.setflags(write=False)
    return displacement


@lru_cache(maxsize=256)
def since_b_at(phase: float | None) -> Array:
    """(3, N) how far the displacement is from plane B's origin, likewise: what B measures, in 3-D."""
    since_b = displacement_at(phase).copy()
    since_b[:, ORIGIN_B] = -_IDENTITY_3
    since_b.setflags(write=False)
    return since_b


def first_states(spread: Array, heart: Array, tuning: MotionTuning, phase: float | None = None) -> tuple[Array, Array]:
    """The states (N, filters) at plane A's first exposure, where the displacement is zero by definition.

    Args:
        spread: (3, 3) m² of breathing.
        heart: (filters, 3, 3) m² of the heartbeat.
        tuning: what is expected of it.
        phase: of the heart's beat then; None where no R peaks tell of it.

    Returns:
        They, and (N, N, filters) their covariances.
    """
    displacement, size = displacement_at(phase), SIZE if phase is None else SIZE_WITH_BEATS
    beat = oscillator.stationary(tuning.heartbeat_damping_per_s, tuning.heartbeat_turning_rad_s)
    random = heart if phase is None else (1.0 - tuning.beat_share) * heart
    breathing = _in_each_direction(matern.stationary(tuning.time_scale_s), spread)
    if has_kernels():
        from lasso_motion_ros.motion import kernels

        repeating = np.zeros(0) if phase is None else _beat_variances(tuning)
        first: tuple[Array, Array] = kernels.first_states(
            breathing, beat, repeating, random, heart, displacement, _SMALLEST_M2, AT_A.start
        )
        return first
    covariance = np.zeros((size, size, len(heart)))
    covariance[BREATHING, BREATHING] = breathing[..., None]
    covariance[BEATING, BEATING] = filters_last(_in_each_direction(beat, random))
    covariance[MEAN, MEAN] = spread[..., None]
    if phase is not None:
        covariance[BEAT_SHAPE, BEAT_SHAPE] = beat_shape_covariance(heart, tuning)
    # What makes up the displacement adds up to zero, as surely as numbers tell.
    state = np.zeros((size, len(heart)))
    sure = _SMALLEST_M2 * _IDENTITY_3
    _, covariance, _, _ = measured(state, covariance, displacement, np.zeros(3), sure)
    covariance[AT_A, AT_A] = sure[..., None]
    return state, covariance


def _beat_variances(tuning: MotionTuning) -> Array:
    """(6,) of the Fourier coefficients of what repeats, in units of the heartbeat's own."""
    return tuning.beat_share * np.repeat(tuning.beat_harmonics, 2)


def beat_shape_covariance(heart: Array, tuning: MotionTuning) -> Array:
    """(18, 18, filters) m² of the Fourier coefficients of what repeats of hearts (filters, 3, 3) m²."""
    return filters_last(_in_each_direction(np.diag(_beat_variances(tuning)), heart))


def filters_last(values: Array) -> Array:
    """(..., filters) of what is (filters, ...): all filters' values of one component lie side by side."""
    return np.moveaxis(values, 0, -1)


def moved_on(
    state: Array, covariance: Array, interval_s: float, spread: Array, heart: Array, tuning: MotionTuning
) -> tuple[Array, Array]:
    """States (N, filters) and their covariances (N, N, filters) after an interval without measurements.

    Args:
        state: at its beginning.
        covariance: likewise.
        interval_s: seconds.
        spread: (3, 3) m² of breathing.
        heart: (filters, 3, 3) m² of what of the heartbeat does not repeat.
        tuning: what is expected of them.
    """
    passage = tuning.passage(interval_s)
    if has_kernels():
        from lasso_motion_ros.motion import kernels

        later: tuple[Array, Array] = kernels.moved_on(
            state,
            covariance,
            passage.breathing,
            passage.beating,
            passage.breathing_noise,
            passage.beating_noise,
            spread,
            heart,
        )
        return later
    size = len(state)
    transition = passage.before(np.eye(size))
    covariance = transition @ (transition @ covariance.reshape(size, -1)).reshape(covariance.shape)
    covariance[BREATHING, BREATHING] += _in_each_direction(passage.breathing_noise, spread)[..., None]
    covariance[BEATING, BEATING] += filters_last(_in_each_direction(passage.beating_noise, heart))
    return transition @ state, 0.5 * (covariance + covariance.swapaxes(0, 1))


def measured(
    state: Array, covariance: Array, h: Array, value: Array, noise: Array
) -> tuple[Array, Array, Array, Array]:
    """States and covariances with a linear measurement h (M, N) of the state taken in, its noise being (M, M).

    Returns:
        The two; (filters,) squared Mahalanobis distance of the value from what was foretold; and (filters,) natural
        logarithm of the highest normal density that it could have had.
    """
    size, filters = state.shape
    cross = (h @ covariance.reshape(size, -1)).reshape(-1, size, filters)
    precision, determinant = inverses(np.moveaxis(h @ cross, -1, 0) + noise)
    innovation = value[:, None] - h @ state
    gain = np.einsum("fmk,mnf->knf", precision, cross)
    # Joseph's form, (1 − gain h) covariance (1 − gain h)ᵀ + gain noise gainᵀ, stays positive where nearly noise-free
    # measurements would not. Its factors differ from 1 by a rank of M, and are never made.
    covariance = covariance - np.einsum("mif,mjf->ijf", gain, cross)
    back = np.einsum("mif,mk->kif", gain, noise) - (h @ covariance.reshape(size, -1)).reshape(cross.shape)
    covariance += np.einsum("mif,mjf->ijf", back, gain)
    state = state + np.einsum("mnf,mf->nf", gain, innovation)
    distance = np.einsum("mf,fmk,kf->f", innovation, precision, innovation)
    peaks = -0.5 * (np.log(determinant) + len(value) * math.log(2.0 * math.pi))
    return state, covariance, distance, peaks


@dataclass(frozen=True, eq=False)
class Passage:
    """What an interval does to a state; not to be changed.

    Attributes:
        breathing: (3, 3) transition of its value, slope and curvature.
        beating: (2, 2) transition of the heartbeat's value and speed.
        breathing_noise: (3, 3) in units of the spread.
        beating_noise: (2, 2) in units of the heartbeat's variance.
    """

    breathing: Array
    beating: Array
    breathing_noise: Array
    beating_noise: Array

    @property
    def matrices(self) -> tuple[Array, Array, Array, Array]:
        """All of them."""
        return self.breathing, self.beating, self.breathing_noise, self.beating_noise

    def before(self, function: Array) -> Array:
        """(M, N) what a function (M, N) of the state after it is of the state before it, but for what is added."""
        before = function.copy()
        for block, transition in ((BREATHING, self.breathing), (BEATING, self.beating)):
            by_axis = function[:, block].reshape(len(function), -1, 3)  # x, y and z move alike
            before[:, block] = (transition.T @ by_axis).reshape(len(function), -1)
        return before


@lru_cache(maxsize=64)
def _passage(interval_ns: int, scale_s: float, damping_per_s: float, turning_rad_s: float) -> Passage:
    """Exposures come at few intervals, and the past is gone through again at the same ones."""
    interval_s = interval_ns * 1e-9
    breathing = matern.transition(interval_s, scale_s)
    beating = oscillator.transition(interval_s, damping_per_s, turning_rad_s)
    breathing_noise = _noise(breathing, matern.stationary(scale_s))
    beating_noise = _noise(beating, oscillator.stationary(damping_per_s, turning_rad_s))
    for array in (breathing, beating, breathing_noise, beating_noise):
        array.setflags(write=False)
    return Passage(breathing, beating, breathing_noise, beating_noise)


def _noise(transition: Array, stationary: Array) -> Array:
    """(N, N) what keeps a process stationary (N, N) through its transition (N, N)."""
    return np.asarray(stationary - transition @ stationary @ transition.T)


def _in_each_direction(blocks: Array, directions: Array) -> Array:
    """(..., 3 N, 3 N) Kronecker product of what acts on value, slope and so on (N, N) and on x, y and z (..., 3, 3)."""
    product = blocks[:, None, :, None] * directions[..., None, :, None, :]
    return np.asarray(product.reshape(*directions.shape[:-2], 3 * len(blocks), 3 * len(blocks)))
