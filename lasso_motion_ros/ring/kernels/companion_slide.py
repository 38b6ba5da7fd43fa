"""What planes tell of a ring's slide from its companions, compiled: see `core/compiled.py`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled
from lasso_motion_ros.ring.kernels.companions import student

Array = npt.NDArray[np.float64]

_STANDS, _SLIDES = 0, 1
_A_PLANE = "Array(float64, 2, 'A', readonly=True)"


@compiled("float64(float64, float64[::1], float64[:, ::1], float64, float64[::1], float64[:, ::1])")
def _merged(
    weight: float, state: Array, covariance: Array, other_weight: float, other: Array, other_covariance: Array
) -> float:
    """Mean and covariance of a mixture of two normal distributions, in place of the first; the sum of their weights.

    Args:
        weight: of the first.
        state: (6,) its mean; overwritten.
        covariance: (6, 6) of it; overwritten.
        other_weight: of the second.
        other: (6,) its mean; overwritten by what the means differ by.
        other_covariance: (6, 6) of it.
    """
    total = weight + other_weight
    share = other_weight / total
    for i in range(6):
        other[i] -= state[i]
    for i in range(6):
        state[i] += share * other[i]
        for j in range(6):
            spread = share * (1.0 - share) * (other[i] * other[j])
            covariance[i, j] = (1.0 - share) * covariance[i, j] + share * other_covariance[i, j] + spread
    return total


@compiled(
    "float64(float64[:, ::1], float64[:, :, ::1], float64, float64, Array(float64, 2, 'A', readonly=True),"
    " UniTuple(float64, 7))"
)
def _moved_on(
    states: Array,
    covariances: Array,
    log_odds: float,
    interval_s: float,
    directions: Array,
    tuning: tuple[float, float, float, float, float, float, float],
) -> float:
    """`CompanionSlide._moved_on`, in place; returns the log odds of a slide. Args as of `taken_in`."""
    wander_m, begins_per_s, rests_per_s, speed_m_s, _, _, _ = tuning
    slides = 0.5 + 0.5 * math.tanh(0.5 * log_odds)
    begins, rests = 1.0 - math.exp(-begins_per_s * interval_s), 1.0 - math.exp(-rests_per_s * interval_s)
    # What begins to slide has any velocity, what comes to rest none.
    begun, rested = covariances[_STANDS].copy(), np.zeros((6, 6))
    begun[3:, 3:] = 0.0
    standing, there = states[_STANDS].copy(), np.zeros(6)
    for i in range(3):
        begun[3 + i, 3 + i] = speed_m_s * speed_m_s
        there[i] = states[_SLIDES, i]
        for j in range(3):
            rested[i, j] = covariances[_SLIDES, i, j]
    stands = _merged(
        (1.0 - slides) * (1.0 - begins), states[_STANDS], covariances[_STANDS], slides * rests, there, rested
    )
    now_slides = _merged(
        slides * (1.0 - rests), states[_SLIDES], covariances[_SLIDES], (1.0 - slides) * begins, standing, begun
    )
    state, squares = states[_SLIDES], covariances[_SLIDES]
    for i in range(3):
        state[i] += interval_s * state[3 + i]
        for j in range(6):
            squares[i, j] += interval_s * squares[3 + i, j]
    for i in range(6):
        for j in range(3):
            squares[i, j] += interval_s * squares[i, 3 + j]
    for m in range(2):
        for i in range(3):
            for j in range(3):
                covariances[m, i, j] += wander_m * wander_m * interval_s * directions[i, j]
    return math.log(now_slides / stands)


@compiled(
    "Tuple((float64, float64, float64, float64, float64, float64, float64))(float64[::1], float64[:, ::1],"
    f" {_A_PLANE}, Array(float64, 1, 'A', readonly=True), float64)"
)
def _innovation(
    state: Array, covariance: Array, across: Array, value: Array, noise: float
) -> tuple[float, float, float, float, float, float, float]:
    """What a plane shows beside what one model foretold: `companion_slide._innovation`.

    Returns:
        The two values; what was foretold of them, squared, as 00, 01 and 11; the determinant of their covariance; and
        their squared Mahalanobis distance.
    """
    u, v, a, b, c = value[0], value[1], 0.0, 0.0, 0.0
    for i in range(3):
        u -= across[0, i] * state[i]
        v -= across[1, i] * state[i]
        for j in range(3):
            a += across[0, i] * covariance[i, j] * across[0, j]
            b += across[0, i] * covariance[i, j] * across[1, j]
            c += across[1, i] * covariance[i, j] * across[1, j]
    determinant = (a + noise) * (c + noise) - b * b
    far = (u * ((c + noise) * u - b * v) + v * ((a + noise) * v - b * u)) / determinant
    return u, v, a, b, c, determinant, far


@compiled(
    "Tuple((float64[:, ::1], float64[:, :, ::1], float64, boolean))(float64[:, ::1], float64[:, :, ::1], float64,"
    " boolean, float64, Array(float64, 2, 'A', readonly=True), Array(float64, 3, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True), Array(float64, 1, 'A', readonly=True), UniTuple(float64, 7))"
)
def taken_in(
    states: Array,
    covariances: Array,
    log_odds: float,
    was_unlike: bool,
    interval_s: float,
    directions: Array,
    across: Array,
    values: Array,
    noises: Array,
    tuning: tuple[float, float, float, float, float, float, float],
) -> tuple[Array, Array, float, bool]:
    """The two models after a pair: `CompanionSlide._taken_in`.

    Args:
        states: (2, 6) of a ring that stands, and of one that slides, metres and m/s.
        covariances: (2, 6, 6).
        log_odds: natural logarithm of the odds that it slides.
        was_unlike: whether the last pair was unlike what was known before.
        interval_s: since then, seconds.
        directions: (3, 3) onto those in which it is seen.
        across: (P, 2, 3) by each plane, unit vectors across its ray.
        values: (P, 2) metres along them.
        noises: (P,) m² along either.
        tuning: wander, m; chances that it begins to slide, and that it comes to rest, 1/s; its speed, m/s; Student's
            freedom; what is unlike; where a hand puts it, m.

    Returns:
        States, covariances and log odds; whether this pair is unlike what was known before.
    """
    _, _, _, _, freedom, unlike, put_m = tuning
    planes = noises.size
    states, covariances = states.copy(), covariances.copy()
    log_odds = _moved_on(states, covariances, log_odds, interval_s, directions, tuning)
    nearest = np.inf
    for m in range(2):
        far = 0.0
        for p in range(planes):
            far += _innovation(states[m], covariances[m], across[p], values[p], noises[p])[6]
        nearest = min(nearest, far)
    is_unlike = nearest > unlike * planes
    if is_unlike and was_unlike:
        for m in range(2):
            for i in range(3):
                for j in range(3):
                    covariances[m, i, j] += put_m * put_m * directions[i, j]
    cross, gain = np.empty((6, 2)), np.empty((6, 2))
    for p in range(planes):
        noise = noises[p]
        for m in range(2):
            u, v, a, b, c, determinant, far = _innovation(states[m], covariances[m], across[p], values[p], noise)
            likelihood = student(far, determinant, freedom)
            log_odds += likelihood if m == _SLIDES else -likelihood
            # What is far off once counts for less: it is something else, or a hand, which shows at once anyway.
            wider = noise * max((freedom + far) / (freedom + 2.0), 1.0)
            a, c = a + wider, c + wider
            determinant = a * c - b * b
            for i in range(6):
                for k in range(2):
                    cross[i, k] = 0.0
                    for j in range(3):
                        cross[i, k] += covariances[m, i, j] * across[p, k, j]
                gain[i, 0] = (cross[i, 0] * c - cross[i, 1] * b) / determinant
                gain[i, 1] = (cross[i, 1] * a - cross[i, 0] * b) / determinant
                states[m, i] += gain[i, 0] * u + gain[i, 1] * v
            for i in range(6):
                for j in range(6):
                    covariances[m, i, j] -= gain[i, 0] * cross[j, 0] + gain[i, 1] * cross[j, 1]
    for m in range(2):
        for i in range(6):
            for j in range(i):
                mean = 0.5 * (covariances[m, i, j] + covariances[m, j, i])
                covariances[m, i, j] = covariances[m, j, i] = mean
    return states, covariances, min(max(log_odds, -25.0), 25.0), is_unlike
