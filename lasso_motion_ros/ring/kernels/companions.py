"""What companions of the ring tell of its place, compiled: see `core/compiled.py` and `plane_companions`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]


@compiled("float64(float64, float64, float64)")
def student(distance: float, determinant: float, freedom: float) -> float:
    """`geometry.covariance.log_student` of one distance."""
    peak = -math.log(2.0 * math.pi) - 0.5 * math.log(determinant)
    return peak - 0.5 * (freedom + 2.0) * math.log1p(distance / freedom)


@compiled(
    "Tuple((float64[:, ::1], float64[::1], float64[::1], float64))(int64[::1], float64[:, ::1],"
    " Array(float64, 1, 'A', readonly=True), float64[:, :, ::1], float64[:, :, ::1], float64[::1], float64[:, ::1],"
    " float64[:, ::1], float64[::1], UniTuple(float64, 4))"
)
def told(
    index: npt.NDArray[np.int64],
    places: Array,
    ring: Array,
    fitted: Array,
    known: Array,
    noise: Array,
    lowest: Array,
    highest: Array,
    log_odds: Array,
    tuning: tuple[float, float, float, float],
) -> tuple[Array, Array, Array, float]:
    """What companions in one plane tell of where the ring is seen: `PlaneCompanions._told`.

    Args:
        index: (C,) which companions were seen.
        places: (C, 2) where, mm from their homes.
        ring: (2,) likewise the ring.
        fitted: (N, 3, 2) of each companion, by its place and 1: the ring's way from it, mm.
        known: (N, 3, 3) covariance of that.
        noise: (N,) mm² of what is left.
        lowest: (N, 2) of the places that vouch, mm.
        highest: (N, 2) likewise.
        log_odds: (N,) that it moves with the heart.
        tuning: what is unforeseen, Student's freedom, the probability of a failure, a standard deviation elsewhere, mm.

    Returns:
        As there.
    """
    unforeseen, freedom, fails, elsewhere_mm = tuning
    count = index.size
    off, variance, moves = np.empty((count, 2)), np.empty(count), np.empty(count)
    row = np.ones(3)
    most, least = 0.0, 0.0
    for c in range(count):
        i, square = index[c], 0.0
        row[0], row[1] = places[c, 0], places[c, 1]
        variance[c] = noise[i]
        for k in range(2):
            way = 0.0
            for m in range(3):
                way += row[m] * fitted[i, m, k]
            off[c, k] = ring[k] - places[c, k] - way
            square += off[c, k] * off[c, k]
            # Only so far as both were seen together is the one a linear function of the other.
            beyond = places[c, k] - min(max(places[c, k], lowest[i, k]), highest[i, k])
            variance[c] += unforeseen * unforeseen * beyond * beyond
        for k in range(3):
            for m in range(3):
                variance[c] += row[k] * known[i, k, m] * row[m]
        moves[c] = 1.0 / (1.0 + math.exp(-log_odds[i]))
        here = student(square / variance[c], variance[c] * variance[c], freedom)
        wide = elsewhere_mm * elsewhere_mm
        elsewhere = -0.5 * square / wide - math.log(2.0 * math.pi * wide)
        works = (1.0 - fails) * moves[c]
        odds = math.log(works * math.exp(here - elsewhere) + 1.0 - works)
        most, least = max(most, odds), min(least, odds)
    return off, variance, moves, most + least


@compiled(
    "float64[::1](float64[:, ::1], float64[::1], float64[::1], float64[::1], float64[:, ::1], float64, float64,"
    " float64, float64)"
)
def steps(
    off: Array,
    variance: Array,
    ring: Array,
    ring_sum: Array,
    ring_square: Array,
    count: float,
    explained_mm: float,
    freedom: float,
    most: float,
) -> Array:
    """How much more companions are to be believed: `PlaneCompanions._steps`.

    Args:
        off: (C, 2) how far the ring is from where each has it, mm.
        variance: (C,) mm² of that.
        ring: (2,) where it was seen, mm.
        ring_sum: (2,) over its places so far, mm.
        ring_square: (2, 2) likewise of their squares.
        count: of them.
        explained_mm: what is not larger shows nothing.
        freedom: Student's.
        most: log odds that one image can add.

    Returns:
        (C,) log odds.
    """
    least = explained_mm * explained_mm
    x, y = ring_sum[0] / count, ring_sum[1] / count
    a = ring_square[0, 0] / count - x * x + least
    b = ring_square[0, 1] / count - x * y
    c = ring_square[1, 1] / count - y * y + least
    u, v, determinant = ring[0] - x, ring[1] - y, a * c - b * b
    alone = student((u * (c * u - b * v) + v * (a * v - b * u)) / determinant, determinant, freedom)
    made = np.empty(variance.size)
    for n in range(made.size):
        spread = max(variance[n], least)
        square = off[n, 0] * off[n, 0] + off[n, 1] * off[n, 1]
        made[n] = min(student(square / spread, spread * spread, freedom) - alone, most)
    return made


@compiled(
    "void(int64[::1], float64[:, ::1], float64[::1], float64[:, :, ::1], float64[:, :, ::1], float64[::1],"
    " float64[::1], float64[:, ::1], float64[:, ::1])"
)
def vouch(
    index: npt.NDArray[np.int64],
    places: Array,
    ring: Array,
    square: Array,
    product: Array,
    rest: Array,
    seen: Array,
    lowest: Array,
    highest: Array,
) -> None:
    """Add a sighting to the sums over places that vouch: `PlaneCompanions._vouch`.

    Args:
        index: (C,) which companions were seen.
        places: (C, 2) where, mm.
        ring: (2,) likewise the ring.
        square: (N, 3, 3) of all companions; changed, as all that follow.
        product: (N, 3, 2).
        rest: (N,).
        seen: (N,).
        lowest: (N, 2).
        highest: (N, 2).
    """
    row = np.ones(3)
    for c in range(index.size):
        n, squares = index[c], 0.0
        row[0], row[1] = places[c, 0], places[c, 1]
        for k in range(3):
            for m in range(3):
                square[n, k, m] += row[k] * row[m]
        for m in range(2):
            beside = ring[m] - places[c, m]
            squares += beside * beside
            for k in range(3):
                product[n, k, m] += row[k] * beside
            lowest[n, m], highest[n, m] = min(lowest[n, m], places[c, m]), max(highest[n, m], places[c, m])
        rest[n] += squares
        seen[n] += 1.0


@compiled(
    "void(float64[:, :, ::1], float64[:, :, ::1], float64[::1], float64[::1], UniTuple(float64, 5),"
    " float64[:, :, ::1], float64[:, :, ::1], float64[::1], float64[::1])"
)
def fit(
    square: Array,
    product: Array,
    rest: Array,
    seen: Array,
    tuning: tuple[float, float, float, float, float],
    known: Array,
    fitted: Array,
    noise: Array,
    unlike: Array,
) -> None:
    """Fit the ring's places to those of each companion: `PlaneCompanions._fit`.

    Args:
        square: (N, 3, 3) as of `vouch`.
        product: (N, 3, 2) likewise.
        rest: (N,) likewise.
        seen: (N,) likewise.
        tuning: standard deviations of the linear part and of the constant, mm; of the noise, mm, and its weight; the
            smallest noise, mm.
        known: (N, 3, 3) written.
        fitted: (N, 3, 2) written.
        noise: (N,) mm² of the last fit; overwritten by that of this one.
        unlike: (N,) written.
    """
    linear, constant_mm, noise_mm, weight, smallest_mm = tuning
    a = np.empty((3, 3))
    for n in range(noise.size):
        for k in range(3):
            for m in range(3):
                a[k, m] = square[n, k, m] / noise[n]
        a[0, 0] += 1.0 / (linear * linear)
        a[1, 1] += 1.0 / (linear * linear)
        a[2, 2] += 1.0 / (constant_mm * constant_mm)
        determinant = 0.0
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            for m in range(3):
                u, v = (m + 1) % 3, (m + 2) % 3
                known[n, m, k] = a[i, u] * a[j, v] - a[i, v] * a[j, u]
            determinant += a[0, k] * (a[1, i] * a[2, j] - a[1, j] * a[2, i])
        for k in range(3):
            for m in range(3):
                known[n, k, m] /= determinant
        explained, away = 0.0, 0.0
        for m in range(2):
            for k in range(3):
                total = 0.0
                for q in range(3):
                    total += known[n, k, q] * product[n, q, m]
                fitted[n, k, m] = total / noise[n]
            for k in range(3):
                left = 2.0 * product[n, k, m]
                for q in range(3):
                    left -= square[n, k, q] * fitted[n, q, m]
                explained += fitted[n, k, m] * left
            away += fitted[n, 0, m] * fitted[n, 0, m] + fitted[n, 1, m] * fitted[n, 1, m]
        left = max(rest[n] - explained, 0.0)
        expected = weight * noise_mm * noise_mm
        noise[n] = max((expected + 0.5 * left) / (weight + seen[n]), smallest_mm * smallest_mm)
        unlike[n] = 0.5 * away / (linear * linear)
