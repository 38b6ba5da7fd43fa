"""The turn that goes with the breath, compiled: see `core/compiled.py` and `breathing_rotation`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]


@compiled("float64[::1](float64[:, ::1])")
def principal_axis(matrix: Array) -> Array:
    """(3,) unit eigenvector of the largest eigenvalue of a symmetric matrix (3, 3), by Jacobi's rotations."""
    a, vectors = matrix.copy(), np.eye(3)
    for _ in range(12):
        for i, j in ((0, 1), (0, 2), (1, 2)):
            if a[i, j] == 0.0:
                continue
            half = 0.5 * (a[j, j] - a[i, i]) / a[i, j]
            tangent = 1.0 / (abs(half) + math.sqrt(half * half + 1.0))
            tangent = -tangent if half < 0.0 else tangent
            cosine = 1.0 / math.sqrt(tangent * tangent + 1.0)
            sine = tangent * cosine
            for k in range(3):
                a[k, i], a[k, j] = cosine * a[k, i] - sine * a[k, j], sine * a[k, i] + cosine * a[k, j]
                u, v = vectors[k, i], vectors[k, j]
                vectors[k, i], vectors[k, j] = cosine * u - sine * v, sine * u + cosine * v
            for k in range(3):
                a[i, k], a[j, k] = cosine * a[i, k] - sine * a[j, k], sine * a[i, k] + cosine * a[j, k]
            a[i, j] = a[j, i] = 0.0
    largest = 0
    for k in range(1, 3):
        largest = k if a[k, k] >= a[largest, largest] else largest
    return vectors[:, largest].copy()


@compiled("float64(float64[:, ::1], float64, float64[:, ::1])")
def _inverse(matrix: Array, more: float, inverse: Array) -> float:
    """Determinant of a matrix (3, 3) with so much more on its diagonal; its inverse (3, 3) is written."""
    a = matrix.copy()
    for k in range(3):
        a[k, k] += more
    determinant = 0.0
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        determinant += a[0, k] * (a[1, i] * a[2, j] - a[1, j] * a[2, i])
        for m in range(3):
            u, v = (m + 1) % 3, (m + 2) % 3
            inverse[m, k] = a[i, u] * a[j, v] - a[i, v] * a[j, u]
    inverse /= determinant
    return determinant


@compiled("float64(float64[:, ::1], float64[:, ::1], float64)")
def _log_evidence(square: Array, cross: Array, variance: float) -> float:
    """`_Posterior.log_evidence`, in units of the prior's standard deviations."""
    inverse, explained = np.empty((3, 3)), 0.0
    determinant = _inverse(square, variance, inverse)
    for c in range(3):
        for k in range(3):
            for m in range(3):
                explained += cross[k, c] * inverse[k, m] * cross[m, c]
    return 0.5 * explained / variance - 1.5 * math.log(determinant / variance**3)


@compiled(
    "Tuple((float64[::1], float64[::1], float64, float64))(float64[:, ::1], float64,"
    " Array(float64, 1, 'C', readonly=True), float64, float64, int64)"
)
def regression(
    sums: Array, count: float, prior_sd: Array, own_turn_rad: float, own_turn_pairs: float, rounds: int
) -> tuple[Array, Array, float, float]:
    """The turn that goes with the breath: `BreathingRotation._regression`.

    Args:
        sums: (8, 8) of products of (1, displacement (3), stretch, turn (3)).
        count: of pairs, weighed.
        prior_sd: (3,) standard deviations of the coefficients: of a constant, displacement and stretch.
        own_turn_rad: the ring's own turning before any has been seen,
        own_turn_pairs: which counts as so many pairs.
        rounds: of noise and coefficients in turn.

    Returns:
        (3,) unit direction of breathing; (3,) rad a metre along it; its variance; log odds of a rotation.
    """
    scatter = np.empty((3, 3))
    for k in range(3):
        for m in range(3):
            scatter[k, m] = sums[1 + k, 1 + m] - sums[0, 1 + k] * sums[0, 1 + m] / count
    axis = principal_axis(scatter)
    # Sums of products of the regressors, and of these and the turn's components; in units of the prior.
    columns, square, cross = np.zeros((5, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    columns[0, 0], columns[4, 2] = prior_sd[0], prior_sd[2]
    for k in range(3):
        columns[1 + k, 1] = prior_sd[1] * axis[k]
    total = sums[5, 5] + sums[6, 6] + sums[7, 7]
    for k in range(3):
        for m in range(3):
            for i in range(5):
                cross[k, m] += columns[i, k] * sums[i, 5 + m]
                for j in range(5):
                    square[k, m] += columns[i, k] * sums[i, j] * columns[j, m]
    variance, expected = own_turn_rad * own_turn_rad, 3.0 * own_turn_pairs
    inverse, mean = np.empty((3, 3)), np.empty((3, 3))
    for _ in range(rounds):
        _inverse(square, variance, inverse)
        explained = 0.0
        for c in range(3):
            for k in range(3):
                mean[k, c] = 0.0
                for m in range(3):
                    mean[k, c] += inverse[k, m] * cross[m, c]
            for k in range(3):
                left = 2.0 * cross[k, c]
                for m in range(3):
                    left -= square[k, m] * mean[m, c]
                explained += mean[k, c] * left
        # Each pair tells three components; as many coefficients were fitted as there are columns, three times.
        known = 3.0 * max(count - 3, 0.0)
        variance = (expected * own_turn_rad * own_turn_rad + max(total - explained, 0.0)) / (expected + known)
    slope = np.zeros(3)
    _inverse(square, variance, inverse)
    for c in range(3):
        for m in range(3):
            slope[c] += prior_sd[1] * inverse[1, m] * cross[m, c]
    slope_variance = variance * prior_sd[1] * prior_sd[1] * inverse[1, 1]
    evidence = _log_evidence(square, cross, variance)
    square[1, :] = 0.0
    square[:, 1] = 0.0
    cross[1, :] = 0.0
    return axis, slope, slope_variance, evidence - _log_evidence(square, cross, variance)
