"""Whether the ring slides off its place, too slowly to leave its breathing from one pair to the next.

Across its direction, breathing is a function of its depth and of whether it goes in or out; a ring that slides adds a
steady drift from some time on, and may come to rest. Both are fitted by least squares to the places of the last minute,
for every time from which and until which it may have slid (a change-point regression). That the way of a breath bends,
and opens the further the faster it goes, is asked of as many places as can tell.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.core.logistic import logistic
from lasso_motion_ros.ring.breathing_terms import breathing_terms, speed_along

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class SlideTuning:
    """What tells a slide from breathing (docs/constants.md)."""

    memory_s: float = 60.0
    spacing_s: float = 0.25  # places nearer in time share a heartbeat, and count as one
    kept: int = 400  # places
    fewest: int = 8  # places: before, nothing tells a slide from breathing
    places_a_term: int = 3  # of what breathing is a function of: fewer cannot tell it from a slide
    longest_gap: float = 1.8  # of the usual interval
    starts: int = 8
    fastest_m_s: float = 0.0015  # what is faster is a cough, or a hand
    shortest_s: float = 1.5
    smallest_m: float = 0.00095  # across, which is a part of it: a patient who settles down drifts by less
    # Of all places, those between these shares are usual, and what is not deeper by more than a share, or than so much.
    usual_depth: tuple[float, float] = (0.15, 0.85)
    unusual_share: float = 0.5
    unusual_m: float = 0.003
    expected_noise_m: float = 0.0004  # of places about the regression, however well breaths repeat,
    expected_weight: float = 4.0  # and as how many numbers that counts
    penalty: float = 4.0  # log odds against, for a drift of two components that starts at any time
    rest_penalty: float = 5.0  # and so much more for one that has come to rest at any time


class Slide(NamedTuple):
    """Whether the ring slides off its place, as far as that shows.

    Attributes:
        across: (3,) how far it has slid by now across the direction of its breathing, which alone shows; metres.
        log_odds: natural logarithm of the odds that it has; 0 where nothing speaks for it.
    """

    across: tuple[float, float, float] = (0.0, 0.0, 0.0)
    log_odds: float = 0.0

    @property
    def across_m(self) -> float:
        """How far that is, metres."""
        return math.hypot(*self.across)

    def beyond(self, limit_m: float) -> float:
        """Probability that it has slid by more than a limit, metres.

        It may slide in any direction of space, and mostly along the breath. Of all directions, those within an angle θ
        of the breath, on either side, have a share of 1 − cos θ; what shows is sin θ of the way.
        """
        if self.log_odds <= 0.0:
            return 0.0
        share = min(self.across_m / limit_m, 1.0)
        return (1.0 - math.sqrt(1.0 - share**2)) * logistic(self.log_odds)


class SeenPlaces:
    """All places where the ring was seen, in its place or not: a slide shows in all of them together.

    Args:
        first: (3,) displacement of the first, metres.
        time_s: when.
        tuning: what tells a slide from breathing.
    """

    def __init__(self, first: Array, time_s: float, tuning: SlideTuning) -> None:
        self._tuning = tuning
        self._points, self._times_s, self._is_whole = first[None], np.array([time_s]), np.array([True])
        self._is_aside = np.array([False])
        self._past = (np.inf, -np.inf), 0.0  # first and last time of the places looked at, and their odds of a slide

    def add(self, time_s: float, displacement: Array, *, is_whole: bool, is_aside: bool = False) -> None:
        """Take note of a displacement (3,) m, unless the last one was seen just before.

        Args:
            time_s: when.
            displacement: (3,) metres.
            is_whole: both planes showed it. What one shows tells how fast it breathes, and not whether it slides.
            is_aside: it was taken to be displaced.
        """
        if time_s - self._times_s[-1] < self._tuning.spacing_s:
            return
        self._points = np.vstack([self._points, displacement])[-self._tuning.kept :]
        self._times_s = np.append(self._times_s, time_s)[-self._tuning.kept :]
        self._is_whole = np.append(self._is_whole, is_whole)[-self._tuning.kept :]
        self._is_aside = np.append(self._is_aside, is_aside)[-self._tuning.kept :]

    def forget_aside(self) -> None:
        """Forget where it was displaced: it is known to be back, so that it has not slid."""
        in_place = ~self._is_aside
        self._points, self._times_s = self._points[in_place], self._times_s[in_place]
        self._is_whole, self._is_aside = self._is_whole[in_place], self._is_aside[in_place]
        self._past = (np.inf, -np.inf), 0.0

    def slide(self, time_s: float, displacement: Array, axis: Array) -> Slide:
        """Whether the ring has slid off its place by a displacement (3,) m, further than a patient settles down.

        The newest place counts whichever planes show it, since it adds nothing to the odds of those before it.

        Args:
            time_s: when.
            displacement: (3,) metres.
            axis: (3,) unit vector along which it breathes.
        """
        recent = self._times_s > time_s - self._tuning.memory_s
        points, times, is_whole = self._points[recent], self._times_s[recent], self._is_whole[recent]
        odds = self._past_odds(points, times, is_whole, axis)
        if odds == 0.0:  # one place proves nothing, the newest least of all
            return Slide()
        points, times = np.vstack([points, displacement]), np.append(times, time_s)
        with_newest = _change_point(points, times, np.append(is_whole, True), axis, self._tuning)
        if with_newest.across_m <= self._tuning.smallest_m:
            return Slide()
        return with_newest._replace(log_odds=min(odds, with_newest.log_odds))

    def _past_odds(self, points: Array, times: Array, is_whole: Mask, axis: Array) -> float:
        """Log odds of a slide by the places (N, 3) m before the newest, kept until there is another one among them."""
        if len(times) < self._tuning.fewest:
            return 0.0
        span = float(times[0]), float(times[-1])
        if span != self._past[0]:
            self._past = span, _change_point(points, times, is_whole, axis, self._tuning).log_odds
        return self._past[1]


def _change_point(points: Array, times: Array, is_whole: Mask, axis: Array, tuning: SlideTuning) -> Slide:
    """The slide by the last of the places (N, 3) m at times (N,) s."""
    if has_kernels():
        return _compiled_change_point(points, times, is_whole, axis, tuning)
    if len(points) < tuning.fewest:
        return Slide()
    intervals = np.diff(times)
    # How fast it breathed beside a gap nobody saw.
    longest = tuning.longest_gap * _median(intervals)
    seen = (np.append(intervals, 0.0) < longest) & (np.append(0.0, intervals) < longest) & is_whole
    if seen.sum() < tuning.fewest:
        return Slide()
    along = points @ axis
    mean = points.sum(axis=0) / len(points)
    across = points - mean - (along - mean @ axis)[:, None] * axis
    speed = speed_along(along, intervals)
    # What a cough or a sigh does aside is unknown, and how fast it breathed right before and after it.
    is_usual = _is_usual(along, tuning)
    seen &= is_usual & np.append(is_usual[1:], True) & np.append(True, is_usual[:-1])
    if seen.sum() < tuning.fewest:
        return Slide()
    terms = breathing_terms(along[seen], speed[seen], tuning.places_a_term)
    return _best_drift(times[seen], across[seen], terms, tuning)


def _compiled_change_point(points: Array, times: Array, is_whole: Mask, axis: Array, tuning: SlideTuning) -> Slide:
    """The same by the compiled kernel."""
    from lasso_motion_ros.ring.kernels.slide import change_point

    x, y, z, odds = change_point(
        points,
        times,
        is_whole,
        axis,
        tuning.fewest,
        tuning.longest_gap,
        tuning.usual_depth,
        tuning.unusual_share,
        tuning.unusual_m,
        tuning.places_a_term,
        tuning.expected_noise_m,
        tuning.expected_weight,
        tuning.starts,
        tuning.shortest_s,
        tuning.fastest_m_s,
        tuning.penalty,
        tuning.rest_penalty,
    )
    return Slide((x, y, z), odds)


def _best_drift(times: Array, across: Array, breathing: Array, tuning: SlideTuning) -> Slide:
    """The drift that explains best where the ring was seen, beside its breathing.

    Args:
        times: (N,) seconds.
        across: (N, 3) places across the direction of breathing, metres.
        breathing: (N, K) what breathing may be a linear function of.
        tuning: what tells a slide from breathing.
    """
    basis = np.linalg.qr(breathing)[0]
    rest = across - basis @ (basis.T @ across)
    freedom, weight = 2.0 * (len(times) - breathing.shape[1]), tuning.expected_weight
    expected = weight * tuning.expected_noise_m**2
    noise = (float(np.sum(rest**2)) + expected) / (freedom + weight)
    # All starts and ends at once: ramps (S, N), and what drift (S, 3) m/s along each explains of the rest.
    starts = np.linspace(times[0], times[-1] - tuning.shortest_s, tuning.starts)
    # What slides goes on, or has come to rest at one of these times: a patient who settles down stays there.
    first, last = np.triu_indices(len(starts) + 1, 1)
    starts, ends = starts[first], np.append(starts, times[-1])[last]
    ramps = np.clip(times, starts[:, None], ends[:, None]) - starts[:, None]
    ramps -= (ramps @ basis) @ basis.T
    power = (ramps * ramps).sum(axis=1)
    drift = ramps @ rest / np.maximum(power, 1e-6)[:, None]
    speed = np.linalg.norm(drift, axis=1)
    held = np.minimum(1.0, tuning.fastest_m_s / np.maximum(speed, 1e-9))
    explained = power * speed**2 * held * (2.0 - held)
    squares = float(np.sum(rest**2)) - explained + expected
    remaining = np.maximum(squares / (freedom + weight - 2.0), 1e-12)
    odds = 0.5 * (freedom + weight) * np.log(noise / remaining) - tuning.penalty
    odds[ends < times[-1]] -= tuning.rest_penalty
    odds[power < 1e-6] = 0.0
    best = int(np.argmax(odds))
    if odds[best] <= 0.0:
        return Slide()
    x, y, z = (held[best] * (ends[best] - starts[best]) * drift[best]).tolist()
    return Slide((x, y, z), float(odds[best]))


def _is_usual(along: Array, tuning: SlideTuning) -> Mask:
    """(N,) whether places along the breath (N,) m are as deep as most, or not much deeper."""
    low, high = _quantiles(along, tuning.usual_depth)
    margin = max(tuning.unusual_share * (high - low), tuning.unusual_m)
    return np.asarray((along > low - margin) & (along < high + margin))


def _quantiles(values: Array, shares: tuple[float, float]) -> list[float]:
    """Of a few values (N,): numpy's take five times as long."""
    ordered = np.sort(values).tolist()
    found = []
    for share in shares:
        below, part = divmod(share * (len(ordered) - 1), 1.0)
        low, high = ordered[int(below)], ordered[min(int(below) + 1, len(ordered) - 1)]
        found.append(low + part * (high - low))
    return found


def _median(values: Array) -> float:
    """Of a few values (N,), N ≥ 1: numpy's takes ten times as long."""
    ordered = np.sort(values)
    return 0.5 * float(ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2])
