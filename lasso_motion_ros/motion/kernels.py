"""What the filter in time does to its states and covariances, compiled: see `core/compiled.py`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]


@compiled(
    "Tuple((float64[:, ::1], float64[:, :, ::1]))(float64[:, ::1], float64[:, :, ::1],"
    " Array(float64, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True),"
    " Array(float64, 3, 'A', readonly=True))"
)
def moved_on(
    state: Array,
    covariance: Array,
    transition: Array,
    breathing: Array,
    spread: Array,
    beating: Array,
    heart: Array,
) -> tuple[Array, Array]:
    """States and covariances after an interval: `motion_model.moved_on`.

    Args:
        state: (filters, N).
        covariance: (filters, N, N).
        transition: (N, N); the first nine components depend on those of their own axis (every third one), the next
            six likewise among themselves, the others each on itself.
        breathing: (3, 3) noise of value, slope and curvature, in units of the spread.
        spread: (3, 3) m².
        beating: (2, 2) noise of the heartbeat's value and speed, in units of its variance.
        heart: (filters, 3, 3) m² of what of the heartbeat does not repeat.
    """
    filters, size = state.shape
    moving = 15  # the others stay as they are, but for their own factor
    new_state, new = np.zeros((filters, size)), np.empty((filters, size, size))
    rows, columns, column = np.empty((moving, size)), np.empty((moving, moving)), np.empty(moving)
    driven = np.zeros((moving, moving))
    for i in range(9):
        for j in range(9):
            driven[i, j] = breathing[i // 3, j // 3] * spread[i % 3, j % 3]
    for f in range(filters):
        for k in range(2):
            for m in range(2):
                for i in range(3):
                    for j in range(3):
                        driven[9 + 3 * k + i, 9 + 3 * m + j] = beating[k, m] * heart[f, i, j]
        old, later = covariance[f], new[f]
        for i in range(moving, size):
            new_state[f, i] = transition[i, i] * state[f, i]
            for j in range(moving, size):
                later[i, j] = transition[i, i] * transition[j, j] * 0.5 * (old[i, j] + old[j, i])
        for i in range(moving):
            k = 9 + i % 3 if i >= 9 else i % 3
            u, v = transition[i, k], transition[i, k + 3]
            new_state[f, i] = u * state[f, k] + v * state[f, k + 3]
            for j in range(size):
                rows[i, j] = u * old[k, j] + v * old[k + 3, j]
            if i < 9:
                w = transition[i, k + 6]
                new_state[f, i] += w * state[f, k + 6]
                for j in range(size):
                    rows[i, j] += w * old[k + 6, j]
            for j in range(moving):
                columns[j, i] = rows[i, j]
            for j in range(moving, size):
                later[i, j] = later[j, i] = transition[j, j] * rows[i, j]
        # Covariances are symmetric: one half is worked out, column by column, which the compiler makes vectors of.
        for j in range(moving):
            k = 9 + j % 3 if j >= 9 else j % 3
            u, v = transition[j, k], transition[j, k + 3]
            for i in range(moving):
                column[i] = u * columns[k, i] + v * columns[k + 3, i]
            if j < 9:
                w = transition[j, k + 6]
                for i in range(moving):
                    column[i] += w * columns[k + 6, i]
            for i in range(moving):
                later[j, i] = column[i] + driven[j, i]
        for i in range(moving):
            for j in range(i):
                later[i, j] = later[j, i] = 0.5 * (later[i, j] + later[j, i])
    return new_state, new


@compiled(
    "Tuple((float64[:, ::1], float64[:, :, ::1], float64[::1], float64[::1]))(float64[:, ::1], float64[:, :, ::1],"
    " Array(float64, 2, 'A', readonly=True), Array(float64, 1, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True))"
)
def measured(
    state: Array, covariance: Array, h: Array, value: Array, noise: Array
) -> tuple[Array, Array, Array, Array]:
    """States and covariances with a measurement of two components taken in: `motion_model.measured`.

    Args:
        state: (filters, N).
        covariance: (filters, N, N).
        h: (2, N) of the measurement.
        value: (2,) of it.
        noise: (2, 2) of it.

    Returns:
        As there.
    """
    filters, size = state.shape
    new_state, new = np.empty((filters, size)), np.empty((filters, size, size))
    distance, peaks = np.empty(filters), np.empty(filters)
    parts, used = np.empty(size, np.int64), 0  # half of the state's components
    for k in range(size):
        if h[0, k] != 0.0 or h[1, k] != 0.0:
            parts[used], used = k, used + 1
    cross_0, cross_1, gain_0, gain_1 = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    back_0, back_1 = np.empty(size), np.empty(size)
    for f in range(filters):
        # Covariances are symmetric: rows stand for columns, and whole rows are what the compiler makes vectors of.
        for i in range(size):
            cross_0[i], cross_1[i] = 0.0, 0.0
        for n in range(used):
            k = parts[n]
            for i in range(size):
                cross_0[i] += h[0, k] * covariance[f, k, i]
            for i in range(size):
                cross_1[i] += h[1, k] * covariance[f, k, i]
        a, b, c, d = noise[0, 0], noise[0, 1], noise[1, 0], noise[1, 1]
        off_0, off_1 = value[0], value[1]
        for n in range(used):
            k = parts[n]
            a += h[0, k] * cross_0[k]
            b += h[0, k] * cross_1[k]
            c += h[1, k] * cross_0[k]
            d += h[1, k] * cross_1[k]
            off_0 -= h[0, k] * state[f, k]
            off_1 -= h[1, k] * state[f, k]
        determinant = a * d - b * c
        for i in range(size):
            gain_0[i] = (cross_0[i] * d - cross_1[i] * c) / determinant
            gain_1[i] = (cross_1[i] * a - cross_0[i] * b) / determinant
            new_state[f, i] = state[f, i] + gain_0[i] * off_0 + gain_1[i] * off_1
        for i in range(size):
            for j in range(size):
                new[f, i, j] = covariance[f, i, j] - (gain_0[i] * cross_0[j] + gain_1[i] * cross_1[j])
        for i in range(size):
            back_0[i] = gain_0[i] * noise[0, 0] + gain_1[i] * noise[1, 0]
            back_1[i] = gain_0[i] * noise[0, 1] + gain_1[i] * noise[1, 1]
        for n in range(used):
            k = parts[n]
            for i in range(size):
                back_0[i] -= h[0, k] * new[f, k, i]
            for i in range(size):
                back_1[i] -= h[1, k] * new[f, k, i]
        for i in range(size):
            for j in range(size):
                new[f, i, j] += back_0[i] * gain_0[j] + back_1[i] * gain_1[j]
        distance[f] = (off_0 * (d * off_0 - b * off_1) + off_1 * (a * off_1 - c * off_0)) / determinant
        peaks[f] = -0.5 * math.log(determinant) - math.log(2.0 * math.pi)
    return new_state, new, distance, peaks


@compiled(
    "Tuple((float64[::1], float64[:, ::1]))(Array(float64, 1, 'A', readonly=True), float64[:, ::1],"
    " float64[:, :, ::1], Array(float64, 2, 'A', readonly=True))"
)
def mixed(weights: Array, state: Array, covariance: Array, h: Array) -> tuple[Array, Array]:
    """Mean and covariance of a function of the state over all filters: `RespiratoryMotion._seen_along`.

    Args:
        weights: (filters,) of sum 1.
        state: (filters, N).
        covariance: (filters, N, N).
        h: (3, N) the function.
    """
    filters, size = state.shape
    each, mean, within = np.zeros((filters, 3)), np.zeros(3), np.zeros((3, 3))
    joint, rows = np.zeros((size, size)), np.zeros((3, size))
    for f in range(filters):
        weight, one = weights[f], covariance[f]
        for i in range(size):
            for j in range(size):
                joint[i, j] += weight * one[i, j]
        for k in range(3):
            for i in range(size):
                each[f, k] += h[k, i] * state[f, i]
            mean[k] += weight * each[f, k]
    for k in range(3):
        for i in range(size):
            if h[k, i] != 0.0:
                for j in range(size):
                    rows[k, j] += h[k, i] * joint[i, j]
    for k in range(3):
        for m in range(3):
            for j in range(size):
                within[k, m] += rows[k, j] * h[m, j]
            for f in range(filters):
                within[k, m] += weights[f] * (each[f, k] - mean[k]) * (each[f, m] - mean[m])
    return mean, within


@compiled("void(float64[:, ::1], float64[:, :, ::1], Array(float64, 2, 'A', readonly=True), int64)")
def _clone(state: Array, covariance: Array, h: Array, first: int) -> None:
    """What `cloned` gives, in place."""
    filters, size = state.shape
    rows, values = np.empty((3, size)), np.empty(3)
    for f in range(filters):
        rows[:] = 0.0
        for k in range(3):
            values[k] = 0.0
            for i in range(size):
                if h[k, i] != 0.0:
                    values[k] += h[k, i] * state[f, i]
                    for j in range(size):
                        rows[k, j] += h[k, i] * covariance[f, i, j]
        for k in range(3):
            state[f, first + k] = values[k]
            for j in range(size):
                covariance[f, first + k, j] = covariance[f, j, first + k] = rows[k, j]
        for k in range(3):
            for m in range(3):
                value = 0.0
                for j in range(size):
                    value += rows[k, j] * h[m, j]
                covariance[f, first + k, first + m] = value


@compiled(
    "Tuple((float64[:, ::1], float64[:, :, ::1], float64[::1], float64))(float64[:, ::1], float64[:, :, ::1],"
    " Array(float64, 2, 'A', readonly=True), Array(float64, 1, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True), Array(float64, 1, 'A', readonly=True),"
    " Array(float64, 1, 'A', readonly=True), float64, float64, Array(float64, 2, 'A', readonly=True), int64)"
)
def taken_in(
    state: Array,
    covariance: Array,
    h: Array,
    value: Array,
    noise: Array,
    log_weights: Array,
    odds: Array,
    freedom: float,
    unusual: float,
    function: Array,
    first: int,
) -> tuple[Array, Array, Array, float]:
    """A measurement of two components, and what it tells of the filters: `RespiratoryMotion._update`.

    Args:
        state: as `measured`, like the next four.
        covariance: (filters, N, N).
        h: (2, N).
        value: (2,).
        noise: (2, 2).
        log_weights: (filters,) logarithms of their weights, but for a constant.
        odds: (filters,) of them before any measurement.
        freedom: degrees of freedom of the measurements' distribution.
        unusual: share of `odds` in what is expected.
        function: (3, N) of the state, which a block becomes then;
        first: of that block's three components; -1 where none does.

    Returns:
        States and covariances; the logarithms of the weights; that of the measurement's probability density.
    """
    new_state, new, distance, peaks = measured(state, covariance, h, value, noise)
    filters = distance.size
    densities, weights = np.empty(filters), np.empty(filters)
    highest, heaviest, total, likelihood = -np.inf, -np.inf, 0.0, 0.0
    for f in range(filters):
        densities[f] = peaks[f] - 0.5 * (freedom + 2.0) * math.log1p(distance[f] / freedom)
        highest, heaviest = max(highest, densities[f]), max(heaviest, log_weights[f])
    for f in range(filters):
        weights[f] = math.exp(log_weights[f] - heaviest)
        total += weights[f]
    for f in range(filters):
        likelihood += ((1.0 - unusual) * weights[f] / total + unusual * odds[f]) * math.exp(densities[f] - highest)
        densities[f] += log_weights[f]
    if first >= 0:
        _clone(new_state, new, function, first)
    return new_state, new, densities, highest + math.log(likelihood + 1e-300)


@compiled(
    "Tuple((float64[:, ::1], float64[:, :, ::1]))(float64[:, ::1], float64[:, :, ::1],"
    " Array(float64, 2, 'A', readonly=True), int64)"
)
def cloned(state: Array, covariance: Array, h: Array, first: int) -> tuple[Array, Array]:
    """States and covariances with a block that becomes a function of the state: `RespiratoryMotion._clone`.

    Args:
        state: (filters, N).
        covariance: (filters, N, N).
        h: (3, N) the function.
        first: of the block's three components.
    """
    new_state, new = state.copy(), covariance.copy()
    _clone(new_state, new, h, first)
    return new_state, new
