"""What the filter in time does to its states and covariances, compiled: see `core/compiled.py`.

All filters' values of one component lie side by side, so that what is done to one is done to many by the same
instructions, however small the state; as many filters are worked on at a time as the processor has in its nearest
memory. Of a covariance one half is worked out, and stands for the other: rounding cannot make them differ.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]

_AT_A_TIME = 32  # filters, at most
_MOVING = 15  # components of breathing (nine) and heartbeat, from the first on; the others stay as they are


@compiled("int64(int64)")
def _at_a_time(filters: int) -> int:
    """How many of so many filters to work on at a time: about as many each time."""
    times = -(-filters // _AT_A_TIME)
    return -(-filters // times)


@compiled("void(float64[:, ::1], float64[:, :, ::1], int64, float64[:, ::1], float64[:, :, ::1])")
def _take(state: Array, covariance: Array, start: int, some: Array, half: Array) -> None:
    """Some filters' states (N, F), and one half of their covariances (N, N, F), from one filter on."""
    size, count = some.shape
    for i in range(size):
        for f in range(count):
            some[i, f] = state[i, start + f]
        for j in range(i + 1):
            for f in range(count):
                half[i, j, f] = covariance[i, j, start + f]


@compiled("void(float64[:, ::1], float64[:, :, ::1], int64, float64[:, ::1], float64[:, :, ::1])")
def _put(state: Array, covariance: Array, start: int, some: Array, half: Array) -> None:
    """The other way round: these are written, both halves alike."""
    size, count = some.shape
    for i in range(size):
        for f in range(count):
            state[i, start + f] = some[i, f]
        for j in range(i + 1):
            for f in range(count):
                value = half[i, j, f]
                covariance[i, j, start + f] = value
                covariance[j, i, start + f] = value


@compiled(
    "void(float64[:, :, ::1], int64, Array(float64, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True))"
)
def _turn(rows: Array, row: int, breathing: Array, beating: Array) -> None:
    """What moves of a row (M, N, F) goes on by the transitions (3, 3) and (2, 2), in place."""
    a, b, c = breathing[0, 0], breathing[0, 1], breathing[0, 2]
    d, e, g = breathing[1, 0], breathing[1, 1], breathing[1, 2]
    h, i, j = breathing[2, 0], breathing[2, 1], breathing[2, 2]
    for k in range(3):
        for f in range(rows.shape[2]):
            u, v, w = rows[row, k, f], rows[row, k + 3, f], rows[row, k + 6, f]
            rows[row, k, f] = a * u + b * v + c * w
            rows[row, k + 3, f] = d * u + e * v + g * w
            rows[row, k + 6, f] = h * u + i * v + j * w
    a, b, c, d = beating[0, 0], beating[0, 1], beating[1, 0], beating[1, 1]
    for k in range(9, 12):
        for f in range(rows.shape[2]):
            u, v = rows[row, k, f], rows[row, k + 3, f]
            rows[row, k, f] = a * u + b * v
            rows[row, k + 3, f] = c * u + d * v


@compiled(
    "void(float64[:, :, ::1], float64[:, :, ::1], Array(float64, 2, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True),"
    " Array(float64, 3, 'A', readonly=True), float64[:, :, ::1])"
)
def _move(
    state: Array,
    half: Array,
    breathing: Array,
    beating: Array,
    breathing_noise: Array,
    beating_noise: Array,
    spread: Array,
    heart: Array,
    whole: Array,
) -> None:
    """Some filters after an interval, in place: see `moved_on`.

    Args:
        state: (1, N, F).
        half: (N, N, F) the covariances: of each row what stands before the diagonal, and on it.
        breathing: (3, 3), as the next four there.
        beating: (2, 2).
        breathing_noise: (3, 3).
        beating_noise: (2, 2).
        spread: (3, 3).
        heart: (F, 3, 3).
        whole: (15, 15, F) to work in.
    """
    size, count = half.shape[1:]
    _turn(state, 0, breathing, beating)
    for i in range(_MOVING, size):
        _turn(half, i, breathing, beating)
    # Of what moves, the transition from the right, and from the left.
    for i in range(_MOVING):
        for j in range(i + 1):
            for f in range(count):
                value = half[i, j, f]
                whole[i, j, f] = value
                whole[j, i, f] = value
    for i in range(_MOVING):
        _turn(whole, i, breathing, beating)
    for i in range(_MOVING):
        for j in range(i + 1):
            k = i % 3
            if i < 9:
                u, v, w = breathing[i // 3, 0], breathing[i // 3, 1], breathing[i // 3, 2]
                noise = breathing_noise[i // 3, j // 3] * spread[k, j % 3]
                for f in range(count):
                    half[i, j, f] = u * whole[k, j, f] + v * whole[k + 3, j, f] + w * whole[k + 6, j, f] + noise
            else:
                m = (i - 9) // 3
                u, v = beating[m, 0], beating[m, 1]
                for f in range(count):
                    half[i, j, f] = u * whole[k + 9, j, f] + v * whole[k + 12, j, f]
                if j >= 9:
                    noise = beating_noise[m, (j - 9) // 3]
                    for f in range(count):
                        half[i, j, f] += noise * heart[f, k, j % 3]


@compiled("void(Array(float64, 2, 'A', readonly=True), float64[:, ::1], float64[:, ::1])")
def _values(function: Array, state: Array, values: Array) -> None:
    """(M, F) a function (M, N) of states (N, F)."""
    size, filters = state.shape
    for a in range(len(function)):
        for f in range(filters):
            values[a, f] = 0.0
        for k in range(size):
            factor = function[a, k]
            if factor != 0.0:
                for f in range(filters):
                    values[a, f] += factor * state[k, f]


@compiled("void(Array(float64, 2, 'A', readonly=True), float64[:, :, ::1], float64[:, :, ::1])")
def _rows(function: Array, half: Array, rows: Array) -> None:
    """(M, N, F) how a function (M, N) of the states varies with them, by one half of their covariances (N, N, F)."""
    count, size, filters = rows.shape
    parts, factors = np.empty(size + 2, np.int64), np.empty(size + 2)
    for a in range(count):
        used = 0
        for k in range(size):
            if function[a, k] != 0.0:
                parts[used], factors[used] = k, function[a, k]
                used += 1
        for n in range(used, used + 2):  # three at a time
            parts[n], factors[n] = 0, 0.0
        for i in range(size):
            for f in range(filters):
                rows[a, i, f] = 0.0
        for first in range(0, used, 3):
            k, m, n = parts[first], parts[first + 1], parts[first + 2]
            u, v, w = factors[first], factors[first + 1], factors[first + 2]
            for i in range(size):
                one, two, three = half[max(i, k), min(i, k)], half[max(i, m), min(i, m)], half[max(i, n), min(i, n)]
                for f in range(filters):
                    rows[a, i, f] += u * one[f] + v * two[f] + w * three[f]


@compiled("void(Array(float64, 2, 'A', readonly=True), float64[:, :, ::1], float64[:, :, ::1])")
def _joint(function: Array, rows: Array, joint: Array) -> None:
    """(M, M, F) one half of the covariance of a function (M, N) of the states, by its `_rows` (M, N, F)."""
    count, size, filters = rows.shape
    for a in range(count):
        for b in range(a + 1):
            for f in range(filters):
                joint[a, b, f] = 0.0
            for k in range(size):
                factor = function[b, k]
                if factor != 0.0:
                    for f in range(filters):
                        joint[a, b, f] += factor * rows[a, k, f]


@compiled(
    "void(float64[:, ::1], float64[:, :, ::1], Array(float64, 2, 'A', readonly=True), int64, float64[:, ::1],"
    " float64[:, :, ::1], float64[:, :, ::1])"
)
def _clone(state: Array, half: Array, function: Array, first: int, values: Array, rows: Array, joint: Array) -> None:
    """A block of some filters becomes a function of the state, in place: `HeartBank._clone`.

    Args:
        state: (N, F).
        half: (N, N, F), as of `_move`.
        function: (3, N).
        first: of the block's three components.
        values: (3, F) to work in, as the next two.
        rows: (3, N, F).
        joint: (3, 3, F).
    """
    size, count = state.shape
    _values(function, state, values)
    _rows(function, half, rows)
    _joint(function, rows, joint)
    for a in range(3):
        row = first + a
        for f in range(count):
            state[row, f] = values[a, f]
        for i in range(size):
            high, low = max(row, i), min(row, i)
            for f in range(count):
                half[high, low, f] = rows[a, i, f]
    for a in range(3):
        for b in range(a + 1):
            for f in range(count):
                half[first + a, first + b, f] = joint[a, b, f]


@compiled(
    "void(float64[:, ::1], float64[:, :, ::1], Array(float64, 2, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True), Array(float64, 1, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True), float64, float64[:, ::1], float64[:, :, ::1], float64[:, :, ::1],"
    " float64[::1])"
)
def _measure(
    state: Array,
    half: Array,
    function: Array,
    across: Array,
    value: Array,
    noise: Array,
    freedom: float,
    values: Array,
    rows: Array,
    joint: Array,
    densities: Array,
) -> None:
    """Some filters with a measurement of two components taken in, in place: see `gone_through`.

    A plane's noise is not so small beside what is measured that the difference of covariances would lose its sign.

    Args:
        state: (N, F).
        half: (N, N, F), as of `_move`.
        function: (3, N), as the next four there.
        across: (2, 3).
        value: (2,).
        noise: (2, 2).
        freedom: of the distribution.
        values: (3, F) to work in, as the next two.
        rows: (3, N, F).
        joint: (3, 3, F).
        densities: (F,) natural logarithms of the measurement's probability density, which are written.
    """
    size, filters = state.shape
    _values(function, state, values)
    _rows(function, half, rows)
    _joint(function, rows, joint)
    k, m, n, p, q, r = across[0, 0], across[0, 1], across[0, 2], across[1, 0], across[1, 1], across[1, 2]
    off, precision = np.empty((2, filters)), np.empty((3, filters))
    cross, gain = np.empty((2, size, filters)), np.empty((2, size, filters))
    for f in range(filters):
        off[0, f] = value[0] - (k * values[0, f] + m * values[1, f] + n * values[2, f])
        off[1, f] = value[1] - (p * values[0, f] + q * values[1, f] + r * values[2, f])
    for f in range(filters):
        a, b, c = joint[0, 0, f], joint[1, 1, f], joint[2, 2, f]
        d, e, g = joint[1, 0, f], joint[2, 0, f], joint[2, 1, f]
        u, v, w = k * a + m * d + n * e, k * d + m * b + n * g, k * e + m * g + n * c
        first, mixed = noise[0, 0] + u * k + v * m + w * n, noise[1, 0] + u * p + v * q + w * r
        u, v, w = p * a + q * d + r * e, p * d + q * b + r * g, p * e + q * g + r * c
        second = noise[1, 1] + u * p + v * q + w * r
        determinant = first * second - mixed * mixed
        precision[0, f], precision[1, f], precision[2, f] = (
            second / determinant,
            -mixed / determinant,
            first / determinant,
        )
        x, y = off[0, f], off[1, f]
        distance = (x * x * second - 2.0 * x * y * mixed + y * y * first) / determinant
        densities[f] = -0.5 * math.log(determinant) - math.log(2.0 * math.pi)
        densities[f] -= 0.5 * (freedom + 2.0) * math.log1p(distance / freedom)
    for i in range(size):
        for f in range(filters):
            cross[0, i, f] = k * rows[0, i, f] + m * rows[1, i, f] + n * rows[2, i, f]
        for f in range(filters):
            cross[1, i, f] = p * rows[0, i, f] + q * rows[1, i, f] + r * rows[2, i, f]
        for f in range(filters):
            gain[0, i, f] = cross[0, i, f] * precision[0, f] + cross[1, i, f] * precision[1, f]
        for f in range(filters):
            gain[1, i, f] = cross[0, i, f] * precision[1, f] + cross[1, i, f] * precision[2, f]
        for f in range(filters):
            state[i, f] += gain[0, i, f] * off[0, f] + gain[1, i, f] * off[1, f]
    for i in range(size):
        for j in range(i + 1):
            for f in range(filters):
                half[i, j, f] -= gain[0, i, f] * cross[0, j, f] + gain[1, i, f] * cross[1, j, f]


@compiled(
    "Tuple((float64[:, ::1], float64[:, :, ::1]))(Array(float64, 2, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True), Array(float64, 1, 'A', readonly=True),"
    " Array(float64, 3, 'A', readonly=True), Array(float64, 3, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True), float64, int64)"
)
def first_states(
    breathing: Array,
    beating: Array,
    repeating: Array,
    heart: Array,
    beat: Array,
    function: Array,
    sure: float,
    first: int,
) -> tuple[Array, Array]:
    """States and covariances where the displacement is zero by definition: `motion_model.first_states`.

    Args:
        breathing: (9, 9) covariance of value, slope and curvature, m².
        beating: (2, 2) of the heartbeat's value and speed, in units of its variance.
        repeating: (K,) variances of what repeats from beat to beat, in units of `beat`.
        heart: (filters, 3, 3) m² of what of the heartbeat does not repeat.
        beat: (filters, 3, 3) m² of the heartbeat, whatever of it repeats.
        function: (3, N) the displacement.
        sure: m², of what is known by definition.
        first: of the block's three components that is the displacement.
    """
    filters, size = len(heart), function.shape[1]
    states, covariances, count = np.zeros((size, filters)), np.empty((size, size, filters)), _at_a_time(filters)
    half, rows = np.empty((size, size, count)), np.empty((3, size, count))
    joint, gain, some = np.empty((3, 3, count)), np.empty((3, count)), np.zeros((size, count))
    for at in range(0, filters, count):
        start = min(at, filters - count)
        for i in range(size):
            for j in range(i + 1):
                value = 0.0
                if i < 9:
                    value = breathing[i, j]
                elif j >= _MOVING and i < _MOVING + 3:  # the mean spreads as breathing does
                    value = breathing[i - _MOVING, j - _MOVING]
                for f in range(count):
                    half[i, j, f] = value
        for k in range(2):
            for m in range(k + 1):
                for i in range(3):
                    for j in range(3 if m < k else i + 1):
                        for f in range(count):
                            half[9 + 3 * k + i, 9 + 3 * m + j, f] = beating[k, m] * heart[start + f, i, j]
        for k in range(repeating.size):
            row = size - 3 * (repeating.size - k)
            for i in range(3):
                for j in range(i + 1):
                    for f in range(count):
                        half[row + i, row + j, f] = repeating[k] * beat[start + f, i, j]
        _rows(function, half, rows)
        _joint(function, rows, joint)
        for f in range(count):
            a, b, c = joint[0, 0, f] + sure, joint[1, 1, f] + sure, joint[2, 2, f] + sure
            d, e, g = joint[1, 0, f], joint[2, 0, f], joint[2, 1, f]
            k, m, n = b * c - g * g, e * g - d * c, d * g - e * b
            determinant = a * k + d * m + e * n
            joint[0, 0, f], joint[1, 0, f], joint[2, 0, f] = k / determinant, m / determinant, n / determinant
            joint[1, 1, f], joint[2, 1, f] = (a * c - e * e) / determinant, (d * e - a * g) / determinant
            joint[2, 2, f] = (a * b - d * d) / determinant
        for i in range(size):
            for a in range(3):
                one, two, three = joint[a, 0], joint[max(a, 1), min(a, 1)], joint[2, a]
                for f in range(count):
                    gain[a, f] = one[f] * rows[0, i, f] + two[f] * rows[1, i, f] + three[f] * rows[2, i, f]
            for j in range(i + 1):
                for f in range(count):
                    half[i, j, f] -= (
                        gain[0, f] * rows[0, j, f] + gain[1, f] * rows[1, j, f] + gain[2, f] * rows[2, j, f]
                    )
        for i in range(first, first + 3):
            for f in range(count):
                half[i, i, f] = sure
        _put(states, covariances, start, some, half)
    return states, covariances


@compiled(
    "Tuple((float64[:, ::1], float64[:, :, ::1]))(float64[:, ::1], float64[:, :, ::1],"
    " Array(float64, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True), Array(float64, 3, 'A', readonly=True))"
)
def moved_on(
    state: Array,
    covariance: Array,
    breathing: Array,
    beating: Array,
    breathing_noise: Array,
    beating_noise: Array,
    spread: Array,
    heart: Array,
) -> tuple[Array, Array]:
    """States and covariances after an interval: `motion_model.moved_on`.

    Args:
        state: (N, filters).
        covariance: (N, N, filters).
        breathing: (3, 3) transition of value, slope and curvature.
        beating: (2, 2) transition of the heartbeat's value and speed.
        breathing_noise: (3, 3) in units of the spread.
        beating_noise: (2, 2) in units of the heartbeat's variance.
        spread: (3, 3) m².
        heart: (filters, 3, 3) m² of what of the heartbeat does not repeat.
    """
    size, filters = state.shape
    count = _at_a_time(filters)
    new_state, new = np.empty_like(state), np.empty_like(covariance)
    some, half, whole = np.empty((size, count)), np.empty((size, size, count)), np.empty((_MOVING, _MOVING, count))
    for at in range(0, filters, count):
        start = min(at, filters - count)
        _take(state, covariance, start, some, half)
        own = heart[start : start + count]
        _move(
            some.reshape(1, size, count), half, breathing, beating, breathing_noise, beating_noise, spread, own, whole
        )
        _put(new_state, new, start, some, half)
    return new_state, new


@compiled("float64(float64[::1], float64[::1], Array(float64, 1, 'A', readonly=True), float64)")
def _told(densities: Array, log_weights: Array, odds: Array, unusual: float) -> float:
    """Logarithm of a measurement's probability density over all filters, whose own (F,) their weights take in.

    Args:
        densities: (F,) natural logarithms of each filter's.
        log_weights: (F,) of their weights, which are changed.
        odds: (F,) of them before any measurement.
        unusual: share of `odds` in what is expected.
    """
    highest, heaviest, total, mean = -np.inf, -np.inf, 0.0, 0.0
    filters = densities.size
    for f in range(filters):
        highest, heaviest = max(highest, densities[f]), max(heaviest, log_weights[f])
    for f in range(filters):
        total += math.exp(log_weights[f] - heaviest)
    for f in range(filters):
        share = (1.0 - unusual) * math.exp(log_weights[f] - heaviest) / total + unusual * odds[f]
        mean += share * math.exp(densities[f] - highest)
        log_weights[f] += densities[f]
    return highest + math.log(mean + 1e-300)


@compiled(
    "Tuple((float64[:, ::1], float64[:, :, ::1], float64[::1], float64))(float64[:, ::1], float64[:, :, ::1],"
    " float64[::1], Array(float64, 1, 'A', readonly=True), Array(float64, 1, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True), Array(float64, 3, 'A', readonly=True), float64[::1],"
    " Array(float64, 3, 'A', readonly=True), Array(float64, 3, 'A', readonly=True),"
    " Array(float64, 3, 'A', readonly=True), Array(float64, 3, 'A', readonly=True), float64[::1], boolean[::1],"
    " boolean[::1], Array(float64, 3, 'A', readonly=True), Array(float64, 3, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True), Array(float64, 3, 'A', readonly=True), int64[::1], float64, float64)"
)
def gone_through(
    state: Array,
    covariance: Array,
    log_weights: Array,
    log_odds: Array,
    odds: Array,
    spread: Array,
    heart: Array,
    intervals_s: Array,
    breathing: Array,
    beating: Array,
    breathing_noise: Array,
    beating_noise: Array,
    kept: Array,
    is_measured: npt.NDArray[np.bool_],
    is_telling: npt.NDArray[np.bool_],
    functions: Array,
    across: Array,
    values: Array,
    noises: Array,
    firsts: npt.NDArray[np.int64],
    freedom: float,
    unusual: float,
) -> tuple[Array, Array, Array, float]:
    """What exposures in turn make of states, covariances and weights: `ExposureFilter._go_through`.

    Args:
        state: (N, filters).
        covariance: (N, N, filters).
        log_weights: (filters,) logarithms of their weights, but for a constant.
        log_odds: (filters,) likewise before any measurement.
        odds: (filters,) of them then.
        spread: (3, 3) m².
        heart: (filters, 3, 3) m² of what of the heartbeat does not repeat.
        intervals_s: (S,) before each exposure, seconds.
        breathing: (S, 3, 3) as of `moved_on`, for these intervals, like the next three.
        beating: (S, 2, 2).
        breathing_noise: (S, 3, 3).
        beating_noise: (S, 2, 2).
        kept: (S,) share of what was learned of the heart that is left after them.
        is_measured: (S,) whether there is a measurement,
        is_telling: (S,) and whether it tells of the heart.
        functions: (S, 3, N) of the state, which are measured
        across: (S, 2, 3) in these directions.
        values: (S, 2) of the measurements.
        noises: (S, 2, 2) symmetric.
        firsts: (S,) of a block's three components, which becomes that function then; -1 where none does.
        freedom: degrees of freedom of the measurements' distribution.
        unusual: share of `odds` in what is expected.

    Returns:
        States and covariances; the logarithms of the weights; that of the measurements' probability density.
    """
    (size, filters), steps = state.shape, intervals_s.size
    count = _at_a_time(filters)
    new_state, new = np.empty_like(state), np.empty_like(covariance)
    some, half, whole = np.empty((size, count)), np.empty((size, size, count)), np.empty((_MOVING, _MOVING, count))
    shown, rows, joint = np.empty((3, count)), np.empty((3, size, count)), np.empty((3, 3, count))
    densities = np.zeros((steps, filters))
    for at in range(0, filters, count):
        start = min(at, filters - count)
        _take(state, covariance, start, some, half)
        moving, own = some.reshape(1, size, count), heart[start : start + count]
        for s in range(steps):
            if intervals_s[s] > 0.0:
                _move(moving, half, breathing[s], beating[s], breathing_noise[s], beating_noise[s], spread, own, whole)
            function = functions[s]
            if is_measured[s]:
                told = densities[s, start : start + count]
                _measure(some, half, function, across[s], values[s], noises[s], freedom, shown, rows, joint, told)
            if firsts[s] >= 0:
                _clone(some, half, function, firsts[s], shown, rows, joint)
        _put(new_state, new, start, some, half)
    new_weights, likelihood = log_weights.copy(), 0.0
    for s in range(steps):
        if intervals_s[s] > 0.0:
            for f in range(filters):
                new_weights[f] = log_odds[f] + kept[s] * (new_weights[f] - log_odds[f])
        if is_measured[s] and is_telling[s]:
            likelihood += _told(densities[s], new_weights, odds, unusual)
    return new_state, new, new_weights, likelihood


@compiled(
    "Tuple((float64[::1], float64[:, ::1]))(Array(float64, 1, 'A', readonly=True), float64[:, ::1],"
    " float64[:, :, ::1], Array(float64, 2, 'A', readonly=True))"
)
def mixed(weights: Array, state: Array, covariance: Array, function: Array) -> tuple[Array, Array]:
    """Mean and covariance of a function of the state over all filters: `HeartBank._seen_along`.

    Args:
        weights: (filters,) of sum 1.
        state: (N, filters).
        covariance: (N, N, filters).
        function: (3, N).
    """
    size, filters = state.shape
    each, mean, within = np.empty((3, filters)), np.zeros(3), np.zeros((3, 3))
    _values(function, state, each)
    for a in range(3):
        for f in range(filters):
            mean[a] += weights[f] * each[a, f]
        for f in range(filters):
            each[a, f] -= mean[a]
    for a in range(3):
        for b in range(a + 1):
            total = 0.0
            for f in range(filters):
                total += weights[f] * each[a, f] * each[b, f]
            for k in range(size):
                for m in range(size):
                    factor = function[a, k] * function[b, m]
                    if factor != 0.0:
                        part = 0.0
                        for f in range(filters):
                            part += weights[f] * covariance[k, m, f]
                        total += factor * part
            within[a, b] = within[b, a] = total
    return mean, within


@compiled("void(float64[:, ::1], int64, Array(float64, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True))")
def _before(function: Array, start: int, breathing: Array, beating: Array) -> None:
    """A function (M, N) of the state after transitions (3, 3), (2, 2) becomes that before them, from a row on."""
    for a in range(start, len(function)):
        for k in range(3):
            u, v, w = function[a, k], function[a, k + 3], function[a, k + 6]
            for n in range(3):
                function[a, k + 3 * n] = u * breathing[0, n] + v * breathing[1, n] + w * breathing[2, n]
        for k in range(9, 12):
            u, v = function[a, k], function[a, k + 3]
            for n in range(2):
                function[a, k + 3 * n] = u * beating[0, n] + v * beating[1, n]


@compiled(
    "float64[:, ::1](Array(float64, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True))"
)
def _added(until: Array, way: Array, between: Array) -> Array:
    """(2, 2) covariance of what comes to a value in an interval, and until another one has gone by after it.

    Args:
        until: (K, K) noise of value, slope and so on in the first interval.
        way: (K, K) transition in the other.
        between: (K, K) noise in that.
    """
    added, size = np.zeros((2, 2)), len(way)
    added[0, 0], added[1, 1] = until[0, 0], between[0, 0]
    for k in range(size):
        added[1, 0] += way[0, k] * until[k, 0]
        for m in range(size):
            added[1, 1] += way[0, k] * until[k, m] * way[0, m]
    return added


@compiled("float64[::1](float64[::1])")
def _shares(log_weights: Array) -> Array:
    """(F,) weights of sum 1, by their logarithms."""
    shares, heaviest, total = np.empty(log_weights.size), -np.inf, 0.0
    for f in range(shares.size):
        heaviest = max(heaviest, log_weights[f])
    for f in range(shares.size):
        shares[f] = math.exp(log_weights[f] - heaviest)
        total += shares[f]
    for f in range(shares.size):
        shares[f] /= total
    return shares


@compiled(
    "Tuple((float64[:, ::1], float64[:, :, ::1], float64[::1], float64[:, ::1]))(float64[:, ::1],"
    " float64[:, :, ::1], float64[::1], Array(float64, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True),"
    " UniTuple(Array(float64, 2, 'A', readonly=True), 4), UniTuple(Array(float64, 2, 'A', readonly=True), 4),"
    " Array(float64, 2, 'A', readonly=True), Array(float64, 3, 'A', readonly=True))"
)
def foreseen(
    state: Array,
    covariance: Array,
    log_weights: Array,
    first: Array,
    last: Array,
    until: tuple[Array, Array, Array, Array],
    between: tuple[Array, Array, Array, Array],
    spread: Array,
    heart: Array,
) -> tuple[Array, Array, Array, Array]:
    """What two exposures will show, by each filter and all of them: `outcome.Outlook`.

    Args:
        state: (N, filters).
        covariance: (N, N, filters).
        log_weights: (filters,) logarithms of their weights, but for a constant.
        first: (3, N) what the first one shows of the state then,
        last: (3, N) and the other.
        until: of the interval until the first one (3, 3) and (2, 2) transitions and noises, as of `moved_on`,
        between: and of that between both.
        spread: (3, 3) m².
        heart: (filters, 3, 3) m² of what of the heartbeat does not repeat.

    Returns:
        (6, filters) values and (6, 6, filters) one half of their covariance; (6,) mean and (6, 6) covariance over all.
    """
    size, filters = state.shape
    function = np.empty((6, size))
    for a in range(3):
        for k in range(size):
            function[a, k], function[a + 3, k] = first[a, k], last[a, k]
    _before(function, 3, between[0], between[1])
    _before(function, 0, until[0], until[1])
    breathing, beating = _added(until[2], between[0], between[2]), _added(until[3], between[1], between[3])
    values, rows, joint = np.empty((6, filters)), np.empty((6, size, filters)), np.empty((6, 6, filters))
    _values(function, state, values)
    _rows(function, covariance, rows)
    _joint(function, rows, joint)
    weights, mean, within = _shares(log_weights), np.zeros(6), np.empty((6, 6))
    for a in range(6):
        for f in range(filters):
            mean[a] += weights[f] * values[a, f]
        for b in range(a + 1):
            noise, beat = breathing[a // 3, b // 3] * spread[a % 3, b % 3], beating[a // 3, b // 3]
            total = 0.0
            for f in range(filters):
                joint[a, b, f] += noise + beat * heart[f, a % 3, b % 3]
            for f in range(filters):
                total += weights[f] * (joint[a, b, f] + (values[a, f] - mean[a]) * (values[b, f] - mean[b]))
            within[a, b] = within[b, a] = total
    return values, joint, mean, within


@compiled(
    "Tuple((float64, float64[::1], float64[:, ::1], float64[::1], float64[:, ::1]))(float64[:, ::1],"
    " float64[:, :, ::1], float64[::1], Array(float64, 1, 'A', readonly=True), Array(float64, 1, 'A', readonly=True),"
    " UniTuple(float64, 2), UniTuple(boolean, 2), UniTuple(Array(float64, 2, 'A', readonly=True), 2),"
    " UniTuple(Array(float64, 1, 'A', readonly=True), 2), UniTuple(Array(float64, 2, 'A', readonly=True), 2), float64,"
    " float64)"
)
def outcome(
    values: Array,
    joint: Array,
    log_weights: Array,
    log_odds: Array,
    odds: Array,
    kept: tuple[float, float],
    is_measured: tuple[bool, bool],
    across: tuple[Array, Array],
    measured: tuple[Array, Array],
    noise: tuple[Array, Array],
    freedom: float,
    unusual: float,
) -> tuple[float, Array, Array, Array, Array]:
    """What two exposures' measurements tell: `outcome.Outlook.outcome`.

    Args:
        values: as `foreseen` gives them, like the next.
        joint: (6, 6, filters).
        log_weights: (filters,) logarithms of the filters' weights, but for a constant.
        log_odds: (filters,) likewise before any measurement.
        odds: (filters,) of them then.
        kept: share of what was learned of the heart that is left at each exposure.
        is_measured: whether there is a measurement.
        across: (2, 3) directions of each.
        measured: (2,) values.
        noise: (2, 2) symmetric.
        freedom: degrees of freedom of the measurements' distribution.
        unusual: share of `odds` in what is expected.

    Returns:
        The logarithm of their probability density; (3,) mean and (3, 3) covariance of the first three components after
        both; and of the last three after the first one alone.
    """
    filters = log_weights.size
    some, half, weights = values.copy(), joint.copy(), log_weights.copy()
    shown, rows, square = np.empty((3, filters)), np.empty((3, 6, filters)), np.empty((3, 3, filters))
    first, last, densities, likelihood = np.eye(3, 6), np.eye(3, 6, 3), np.empty(filters), 0.0
    between, spread = np.zeros(3), np.zeros((3, 3))
    for k in range(2):
        if k == 0 or is_measured[k]:
            for f in range(filters):
                weights[f] = log_odds[f] + kept[k] * (weights[f] - log_odds[f])
        if is_measured[k]:
            function = first if k == 0 else last
            _measure(some, half, function, across[k], measured[k], noise[k], freedom, shown, rows, square, densities)
            likelihood += _told(densities, weights, odds, unusual)
        if k == 0 and is_measured[0] and is_measured[1]:
            between, spread = mixed(_shares(weights), some, half, last)
    mean, covariance = mixed(_shares(weights), some, half, first)
    return likelihood, mean, covariance, between, spread
