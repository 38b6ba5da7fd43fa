"""The change-point regression of `slide`, compiled: see `core/compiled.py`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


@compiled("float64(float64[::1], float64)")
def _quantile(ordered: Array, share: float) -> float:
    at = share * (ordered.size - 1)
    low = int(at)
    high = min(low + 1, ordered.size - 1)
    return float(ordered[low] + (at - low) * (ordered[high] - ordered[low]))


@compiled("void(float64[:, ::1], int64, float64[::1])")
def _leave_out(basis: Array, terms: int, values: Array) -> None:
    """Take from values (N,) what lies in the first rows of an orthonormal basis (K, N)."""
    for k in range(terms):
        part = 0.0
        for n in range(values.size):
            part += basis[k, n] * values[n]
        for n in range(values.size):
            values[n] -= part * basis[k, n]


@compiled("void(float64[:, ::1])")
def _orthonormalise(rows: Array) -> None:
    """Make rows (K, N) orthonormal, each by those before it: Gram and Schmidt, twice for the rounding's sake."""
    for k in range(rows.shape[0]):
        for _ in range(2):
            _leave_out(rows, k, rows[k])
            power = 0.0
            for n in range(rows.shape[1]):
                power += rows[k, n] * rows[k, n]
            scale = 1.0 / math.sqrt(power) if power > 0.0 else 0.0
            for n in range(rows.shape[1]):
                rows[k, n] *= scale


@compiled("void(float64[::1])")
def _sort(values: Array) -> None:
    """Sort a few hundred values, most of them in order already where they come from a breath: by insertion."""
    for i in range(1, values.size):
        value, place = values[i], i
        while place > 0 and values[place - 1] > value:
            values[place] = values[place - 1]
            place -= 1
        values[place] = value


@compiled(
    "UniTuple(float64, 4)(float64[::1], float64[:, ::1], float64[:, ::1], float64, float64,"
    " int64, float64, float64, float64, float64)"
)
def _best_drift(
    times: Array,
    across: Array,
    basis: Array,
    expected_noise_m: float,
    expected_weight: float,
    starts: int,
    shortest_s: float,
    fastest_m_s: float,
    penalty: float,
    rest_penalty: float,
) -> tuple[float, float, float, float]:
    """The drift that explains best where the ring was seen, beside its breathing: `slide._best_drift`."""
    terms, count = basis.shape
    rest = np.empty((3, count))
    squares = 0.0
    for k in range(3):
        for n in range(count):
            rest[k, n] = across[n, k]
        _leave_out(basis, terms, rest[k])
        for n in range(count):
            squares += rest[k, n] * rest[k, n]
    freedom = 2.0 * (count - terms) + expected_weight
    squares += expected_weight * expected_noise_m * expected_noise_m
    noise = squares / freedom
    at = np.empty(starts + 1)
    for first in range(starts):
        at[first] = times[0] + (times[-1] - shortest_s - times[0]) * first / (starts - 1)
    at[starts] = times[-1]
    ramp = np.empty(count)
    best, way = 0.0, (0.0, 0.0, 0.0)
    for first in range(starts):
        for last in range(first + 1, starts + 1):
            start, end = at[first], at[last]
            for n in range(count):
                ramp[n] = min(max(times[n], start), end) - start
            _leave_out(basis, terms, ramp)
            power, x, y, z = 0.0, 0.0, 0.0, 0.0
            for n in range(count):
                power += ramp[n] * ramp[n]
                x += ramp[n] * rest[0, n]
                y += ramp[n] * rest[1, n]
                z += ramp[n] * rest[2, n]
            if power < 1e-6:
                continue
            speed = math.sqrt(x * x + y * y + z * z) / power
            held = min(1.0, fastest_m_s / max(speed, 1e-9))
            remaining = (squares - power * speed * speed * held * (2.0 - held)) / (freedom - 2.0)
            odds = 0.5 * freedom * math.log(noise / max(remaining, 1e-12)) - penalty
            if end < times[-1]:
                odds -= rest_penalty
            if odds > best:
                scale = held * (end - start) / power
                best, way = odds, (scale * x, scale * y, scale * z)
    return way[0], way[1], way[2], best


@compiled(
    "UniTuple(float64, 4)(Array(float64, 2, 'A', readonly=True), Array(float64, 1, 'A', readonly=True),"
    " Array(boolean, 1, 'A', readonly=True), Array(float64, 1, 'A', readonly=True), int64, float64,"
    " UniTuple(float64, 2), float64, float64, int64, float64, float64, int64, float64, float64, float64, float64)"
)
def change_point(
    points: Array,
    times: Array,
    is_whole: Mask,
    axis: Array,
    fewest: int,
    longest_gap: float,
    usual_depth: tuple[float, float],
    unusual_share: float,
    unusual_m: float,
    places_a_term: int,
    expected_noise_m: float,
    expected_weight: float,
    starts: int,
    shortest_s: float,
    fastest_m_s: float,
    penalty: float,
    rest_penalty: float,
) -> tuple[float, float, float, float]:
    """The slide by the last of some places: `slide._change_point`.

    Args:
        points: (N, 3) metres.
        times: (N,) seconds, increasing.
        is_whole: (N,) whether both planes showed the ring there.
        axis: (3,) unit vector along which it breathes.
        fewest: as `SlideTuning`, like all that follow.
        longest_gap: of the usual interval.
        usual_depth: shares of all places.
        unusual_share: of the range between them.
        unusual_m: metres.
        places_a_term: of what breathing is a function of.
        expected_noise_m: metres.
        expected_weight: numbers as which that counts.
        starts: of a drift.
        shortest_s: of a drift, seconds.
        fastest_m_s: m/s.
        penalty: log odds.
        rest_penalty: log odds.

    Returns:
        How far it has slid across, x, y and z in metres, and the log odds that it has; 0 where nothing speaks for it.
    """
    nothing = 0.0, 0.0, 0.0, 0.0
    count = times.size
    if count < fewest:
        return nothing
    intervals, ordered = np.empty(count - 1), np.empty(count)
    for i in range(count - 1):
        intervals[i] = ordered[i] = times[i + 1] - times[i]
    _sort(ordered[: count - 1])
    longest = longest_gap * 0.5 * (ordered[(count - 2) // 2] + ordered[(count - 1) // 2])
    mean = np.zeros(3)
    for i in range(count):
        mean += points[i] / count
    along, speed = np.empty(count), np.empty(count)
    for i in range(count):
        along[i] = points[i, 0] * axis[0] + points[i, 1] * axis[1] + points[i, 2] * axis[2]
    level = mean[0] * axis[0] + mean[1] * axis[1] + mean[2] * axis[2]
    # Of second order but for the ends: of two steps the shorter one counts for more.
    for i in range(count):
        before = (along[i] - along[i - 1]) / intervals[i - 1] if i > 0 else 0.0
        after = (along[i + 1] - along[i]) / intervals[i] if i < count - 1 else 0.0
        if i == 0:
            speed[i] = after
        elif i == count - 1:
            speed[i] = before
        else:
            speed[i] = (before * intervals[i] + after * intervals[i - 1]) / (intervals[i - 1] + intervals[i])
    for i in range(count):
        ordered[i] = along[i]
    _sort(ordered)
    low, high = _quantile(ordered, usual_depth[0]), _quantile(ordered, usual_depth[1])
    margin = max(unusual_share * (high - low), unusual_m)
    seen = np.empty(count, np.int64)
    all_seen, used = 0, 0
    for i in range(count):
        is_next = (i == 0 or intervals[i - 1] < longest) and (i == count - 1 or intervals[i] < longest)
        if not (is_next and is_whole[i]):
            continue
        all_seen += 1
        is_usual = True
        for k in range(max(i - 1, 0), min(i + 2, count)):
            is_usual = is_usual and low - margin < along[k] < high + margin
        if is_usual:
            seen[used] = i
            used += 1
    if all_seen < fewest or used < fewest:
        return nothing
    depth = 0.0
    for n in range(used):
        depth += along[seen[n]] / used
    terms = min(max(3, used // places_a_term), 5)
    breathing, across, at = np.empty((terms, used)), np.empty((used, 3)), np.empty(used)
    for n in range(used):
        i = seen[n]
        deep, at[n] = along[i] - depth, times[i]
        breathing[0, n], breathing[1, n], breathing[2, n] = 1.0, deep, speed[i]
        if terms > 3:
            breathing[3, n] = deep * deep
        if terms > 4:
            breathing[4, n] = deep * speed[i]
        for k in range(3):
            across[n, k] = points[i, k] - mean[k] - (along[i] - level) * axis[k]
    _orthonormalise(breathing)
    return _best_drift(
        at,
        across,
        breathing,
        expected_noise_m,
        expected_weight,
        starts,
        shortest_s,
        fastest_m_s,
        penalty,
        rest_penalty,
    )
