"""Where breathing has taken the ring so far, and how far a place lies off that curve.

Breathing repeats. Along its own direction a breath may go deeper than those before, across it hardly at all. So the
distance that counts is the one across, in units of how well the breaths have repeated. What only just happened must not
vouch for itself: a ring that slides out of its vein would take the curve along. The curve is that of the breaths up to
one breath ago, and of the first one for good.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.curves import distance_of_point
from lasso_motion_ros.ring.slide import SeenPlaces, Slide, SlideTuning

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class CurveTuning:
    """How breathing repeats, and when a ring slides off its curve."""

    longest_breath_s: float = 9.0  # what is younger does not vouch for a place, once a breath is complete
    settled_s: float = 3.0  # before the first breath is complete: likewise
    points: int = 400  # kept
    spacing_s: float = 0.05  # between points that are kept
    first_axis_m: float = 0.002  # root mean square of the motion, before its direction is believed
    first_reach_m: float = 0.040  # before that, breathing may go so far anywhere
    first_sigma_m: float = 0.0025  # across the direction, before a breath has repeated
    repeated_sigma_m: float = 0.001  # across, once a breath is complete
    repeated_pairs: float = 6.0  # as which that counts
    repeats: int = 60  # pairs from which it is learned
    smallest_sigma_m: float = 0.0004  # however well breaths repeat
    along_sigma_m: float = 0.010  # beyond the deepest breath so far
    widening: float = 0.08  # across, per metre beyond it: the direction is known only so well
    hidden_axis: float = 1.5  # likewise before a breath is complete: times the heartbeat's share of what was seen
    reversal_share: float = 0.3  # of the range so far: a turn of the breathing, not a jitter
    smallest_reversal_m: float = 1.5e-3
    fastest_m_s: float = 0.065  # of a breath or a cough
    at_once_m: float = 0.002  # and so much besides, for the heartbeat
    longest_interval_s: float = 1.5  # after a longer pause speed tells nothing
    too_fast_sigmas: float = 4.0  # what just exceeds it
    aside_sigmas: float = 6.0  # off the curve: what is further away did not slide there unnoticed
    drift_m_s: float = 1e-4  # of the end of expiration, in a patient who settles down,
    drift_s: float = 9.0  # for so long
    slide: SlideTuning = field(default_factory=SlideTuning)


class BreathingCurve:
    """Places of the ring that were believed to be breathing.

    Args:
        first: (3,) displacement at which it starts, metres.
        time_s: when.
        tuning: how breathing repeats.
    """

    def __init__(self, first: Array, time_s: float, tuning: CurveTuning) -> None:
        self._tuning = tuning
        self._points, self._times_s = first[None], np.array([time_s])
        self._axis, self._spread_m = _principal_axis(self._points)
        self._last, self._last_s = np.array(first), time_s
        self._seen = SeenPlaces(first, time_s, tuning.slide)
        self._complete_s: float | None = None
        self._off: list[tuple[float, float]] = []  # metres across, of breaths that repeated
        self._last_asked, self._last_off = (-np.inf, -np.inf, b""), (0.0, 0.0, 0.0)

    @property
    def is_complete(self) -> bool:
        """Whether a whole breath has been seen: two turns. A breath that is held is none."""
        return self._complete_s is not None

    @property
    def sigma_m(self) -> float:
        """How far breaths are apart, across their direction, metres."""
        if not self.is_complete:
            return self._tuning.first_sigma_m
        # What is younger than a breath may be a ring that is drawn aside: it must not widen what is borne.
        settled = [off for time_s, off in self._off if time_s <= self._times_s[-1] - self._tuning.longest_breath_s]
        recent = np.square(settled[-self._tuning.repeats :])
        # What is expected of a patient counts as a few pairs.
        total = self._tuning.repeated_sigma_m**2 * self._tuning.repeated_pairs + float(recent.sum())
        return float(max(np.sqrt(total / (self._tuning.repeated_pairs + len(recent))), self._tuning.smallest_sigma_m))

    def see(self, time_s: float, displacement: Array, *, is_whole: bool = True) -> None:
        """Take note of a displacement (3,) m where the ring was seen, of breathing or not.

        Args:
            time_s: when.
            displacement: (3,) metres.
            is_whole: both planes showed it. What one shows tells how fast it breathes, and not whether it slides: its
                depth is taken from the breathing.
        """
        self._seen.add(time_s, displacement, is_whole=is_whole)

    def see_aside(self, time_s: float, displacement: Array, *, is_whole: bool) -> None:
        """Take note of a displaced ring (3,) m, if a slide may have taken it there: not what a hand put far away.

        Args as of `see`.
        """
        reach_m = self._tuning.at_once_m + self._tuning.slide.fastest_m_s * (time_s - self._times_s[0])
        is_near = float(np.linalg.norm(self._points - displacement, axis=1).min()) < reach_m
        if is_near and self.distance_sigmas(time_s, displacement, 0.0) < self._tuning.aside_sigmas:
            self._seen.add(time_s, displacement, is_whole=is_whole, is_aside=True)

    def forget_aside(self) -> None:
        """Forget where the ring was displaced: it is known to be back."""
        self._seen.forget_aside()

    def accept(self, time_s: float, displacement: Array) -> None:
        """Take a displacement (3,) m for one of breathing."""
        self.see(time_s, displacement)
        self._last, self._last_s = np.array(displacement), time_s
        if time_s - self._times_s[-1] < self._tuning.spacing_s:
            return
        if self.is_complete:
            self._off.append((time_s, self._off_curve(time_s, displacement)[0]))
            del self._off[: -self._tuning.points]
        self._points = np.vstack([self._points, displacement])[-self._tuning.points :]
        self._times_s = np.append(self._times_s, time_s)[-self._tuning.points :]
        self._axis, self._spread_m = _principal_axis(self._points)
        is_moving = self._spread_m > self._tuning.first_axis_m
        if self._complete_s is None and is_moving and _count_turns(self._points @ self._axis, self._tuning) >= 2:
            self._complete_s = time_s

    def slide(self, time_s: float, displacement: Array) -> Slide:
        """Whether the ring has slid off its place by a displacement (3,) m, further than a patient settles down."""
        # Of what is believed to be breathing: a slide may be larger than a small breath, and would be taken for it.
        return self._seen.slide(time_s, displacement, self._axis)

    def departure_sigmas(
        self, time_s: float, displacement: Array, sigma_m: float, slide: Slide, *, is_away: bool = False
    ) -> float:
        """How far a displacement (3,) m is from breathing, in standard deviations: off its curve, too fast, or sliding.

        Args:
            time_s: when.
            displacement: (3,) metres.
            sigma_m: of the displacement itself, with the heartbeat's across the breath, metres.
            slide: by that displacement.
            is_away: the ring has been displaced, and has to come back to where it was seen.
        """
        off = max(self.distance_sigmas(time_s, displacement, sigma_m), self._speed_sigmas(time_s, displacement))
        if is_away and not self.is_complete:
            nearest = float(np.linalg.norm(self._points - displacement, axis=1).min())
            off = max(off, nearest / float(np.hypot(self._tuning.first_sigma_m, sigma_m)))
        return max(off, math.sqrt(2.0 * slide.log_odds))

    def _speed_sigmas(self, time_s: float, displacement: Array) -> float:
        """How far a displacement (3,) m is beyond what a breath or a cough does since the last one believed."""
        interval_s = time_s - self._last_s
        if interval_s > self._tuning.longest_interval_s:
            return 0.0
        moved = float(np.linalg.norm(displacement - self._last))
        excess = moved / (self._tuning.fastest_m_s * interval_s + self._tuning.at_once_m)
        return self._tuning.too_fast_sigmas * excess if excess > 1.0 else 0.0

    def distance_sigmas(self, time_s: float, displacement: Array, sigma_m: float) -> float:
        """How far a displacement (3,) m lies off the curve, in standard deviations.

        Args:
            time_s: when.
            displacement: (3,) metres.
            sigma_m: of the displacement itself, with the heartbeat's across the breath, metres.
        """
        across, beyond, spread_m = self._off_curve(time_s, displacement)
        if not self.is_complete and spread_m < self._tuning.first_axis_m:
            away = float(np.linalg.norm(displacement - self._points.mean(axis=0)))
            return 3.0 * away / self._tuning.first_reach_m
        drift_m = self._tuning.drift_m_s * min(time_s - self._times_s[0], self._tuning.drift_s)
        wider_m = self._tuning.widening * beyond
        if not self.is_complete:  # a strong heart hides where breathing is going to
            hidden = self._tuning.hidden_axis * sigma_m / self._spread_m
            wider_m = max(wider_m, hidden * float(np.hypot(across, beyond)))
        scale = float(np.sqrt(self.sigma_m**2 + sigma_m**2 + wider_m**2 + drift_m**2))
        return float(np.hypot(across / scale, beyond / self._tuning.along_sigma_m))

    def _vouching(self, time_s: float) -> Array:
        """(N, 3) the places that vouch for one at a time: all but the youngest."""
        if self._complete_s is not None:
            return self._points[self._times_s <= max(self._complete_s, time_s - self._tuning.longest_breath_s)]
        old = self._times_s <= max(time_s - self._tuning.settled_s, self._times_s[min(3, len(self._times_s) - 1)])
        return self._points if old.sum() < 4 else self._points[old]

    def _off_curve(self, time_s: float, displacement: Array) -> tuple[float, float, float]:
        """How far a displacement (3,) m lies off the curve that vouches at a time.

        The last answer is kept: a place is accepted just after it was judged.

        Returns:
            Metres across the curve, along its axis beyond its ends, and the root mean square of the curve along it.
        """
        asked = time_s, float(self._times_s[-1]), displacement.tobytes()
        if asked != self._last_asked:
            self._last_asked, self._last_off = asked, self._compared(displacement, self._vouching(time_s))
        return self._last_off

    def _compared(self, displacement: Array, curve: Array) -> tuple[float, float, float]:
        """What `_off_curve` tells, for a curve (N, 3)."""
        axis, spread_m = (self._axis, self._spread_m) if curve is self._points else _principal_axis(curve)
        axis = axis if len(curve) > 2 else self._axis
        if has_kernels():
            from lasso_motion_ros.ring.kernels.breathing_curve import compared

            return *compared(displacement, curve, axis, self._complete_s is None), spread_m
        mean = curve.sum(axis=0) / len(curve)
        along = (curve - mean) @ axis
        at = float((displacement - mean) @ axis)
        beyond = max(at - float(along.max()), float(along.min()) - at, 0.0)
        if self._complete_s is None:  # so far a line: the way back may lie beside the way in
            off = displacement - mean - at * axis
            return float(np.linalg.norm(off)), beyond, spread_m
        distance = distance_of_point(displacement, curve)
        return math.sqrt(max(distance**2 - beyond**2, 0.0)), beyond, spread_m


def _count_turns(along: Array, tuning: CurveTuning) -> int:
    """Reversals of a motion, (N,) positions along its axis in metres, that are larger than a share of its range."""
    threshold = max(tuning.reversal_share * float(np.ptp(along)), tuning.smallest_reversal_m)
    turns, heading, extreme = 0, 0, float(along[0])
    for value in along[1:].tolist():
        if heading == 0:
            if abs(value - extreme) > threshold:
                heading, extreme = (1 if value > extreme else -1), value
        elif heading * (value - extreme) > 0.0:
            extreme = value
        elif heading * (extreme - value) > threshold:
            turns, heading, extreme = turns + 1, -heading, value
    return turns


def _principal_axis(points: Array) -> tuple[Array, float]:
    """(3,) direction of largest spread, and the root mean square along it, metres."""
    if has_kernels():
        from lasso_motion_ros.ring.kernels.breathing_curve import direction

        axis_and_spread: tuple[Array, float] = direction(points)
        return axis_and_spread
    off = points - points.sum(axis=0) / len(points)
    squares, directions = np.linalg.eigh(off.T @ off)
    return directions[:, -1], float(np.sqrt(max(squares[-1], 0.0) / len(points)))
