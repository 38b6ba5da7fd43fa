"""What a fit is worth: is the loop there, do the planes agree, is this breathing?"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.ring import JudgementConfig
from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.ring.loop_views import PlaneFit

Array = npt.NDArray[np.float64]

LONGEST_TRAJECTORY = 600  # accepted pairs kept
POINTS_A_BREATH = 200  # of these, in the longest breath at most, so that always several breaths are kept
FIRST_AXIS_SPREAD_M = 0.003  # motion seen before its axis is believed
FIRST_BREATH_REACH_M = 0.040  # along that axis, before a whole breath has been seen
CURVE_WIDTH_SHARE = 0.6
# Of the deepest and fastest breath, 32 mm in 3 s: 4 (π / 3 s)² times its depth (Lujan's sin⁴). Further than this times
# the interval squared from where its motion would carry it, the loop was moved.
LARGEST_ACCELERATION_MM_S2 = 140.0
FORESEEN_WITHIN_MM = 3.0  # besides, for the heartbeat and the errors of three displacements
REVERSAL_SHARE = 0.3  # of the range so far: a turn of the breathing, not a jitter


def is_seen(fit: PlaneFit, config: JudgementConfig) -> bool:
    """Whether one plane shows the loop, by itself."""
    return fit.likeness >= config.smallest_likeness and fit.visible >= config.smallest_visible


def is_clearly_seen(fit: PlaneFit, config: JudgementConfig) -> bool:
    """Whether one plane alone is good enough to rest a pose on."""
    return is_seen(fit, config) and fit.visible >= config.full_visible and fit.likeness >= config.clear_likeness


def is_faintly_seen(fit: PlaneFit, config: JudgementConfig) -> bool:
    """Whether a plane shows so much of the loop that it counts where all else agrees."""
    return fit.likeness >= config.faint_likeness


def epipolar_gap(ray_a: Array, ray_b: Array, centre_a: Array, centre_b: Array) -> tuple[float, Array]:
    """How far two planes' rays through the loop's centre pass each other.

    Args:
        ray_a: (3,) direction of plane A's ray.
        ray_b: (3,) direction of plane B's.
        centre_a: (3,) a point on plane A's ray, world metres.
        centre_b: (3,) a point on plane B's, moved to plane A's time.

    Returns:
        The signed gap in metres, and the (3,) unit direction along which it was measured.
    """
    across = np.cross(ray_a, ray_b)
    across /= np.linalg.norm(across)
    return float(across @ (centre_b - centre_a)), across


class BreathingEnvelope:
    """Where breathing has taken the loop so far, and so where it may be.

    Until a whole breath has been seen, the loop may go far along the axis of the motion, or anywhere while
    no axis has shown; afterwards it has to stay near its trajectory, or leave it as a deeper breath does:
    along the axis and foreseeably.
    """

    def __init__(self, config: JudgementConfig, first: Array | None = None, time_s: float = 0.0) -> None:
        """Start at a displacement (3,) m, zero unless given, and a time."""
        self._config = config
        self._points = np.zeros((1, 3)) if first is None else first[None]
        self._times_s = np.array([time_s])
        self._last_time_s = self._first_time_s = self._complete_time_s = time_s
        self._complete = False
        self._last = self._points[-1]
        self._velocity, self._last_interval_s = np.zeros(3), 0.0  # of the last two accepted; 0: not yet two
        self._widest_mm = 0.0  # the curve's scatter across its axis, once complete

    def reconfigure(self, config: JudgementConfig) -> None:
        """Judge by other limits; what was learnt of the breathing is kept."""
        self._config = config

    def departure(self, time_s: float, displacement: Array, predicted: Array) -> str:
        """Why a displacement (3,) m at a time cannot be breathing, in plain words; empty if it can.

        Args:
            time_s: of plane A's exposure, since the reference.
            displacement: (3,) found, metres.
            predicted: (3,) foreseen from the motion so far, metres.
        """
        config = self._config
        interval = max(time_s - self._last_time_s, 1e-3)
        if interval <= config.longest_jump_interval_s:
            moved = 1e3 * float(np.linalg.norm(displacement - self._last))
            if moved > config.largest_speed_mm_s * interval + config.jump_allowance_mm:
                return f"jumped {moved:.0f} mm in {interval:.2f} s, faster than breathing"
            if self._last_interval_s > 0.0:
                leap = 1e3 * float(np.linalg.norm(displacement - self._last - interval * self._velocity))
                # What a bounded acceleration adds to the mean velocity of the interval before.
                reach = LARGEST_ACCELERATION_MM_S2 * interval * 0.5 * (interval + self._last_interval_s)
                if leap > reach + config.jump_allowance_mm + FORESEEN_WITHIN_MM:
                    return f"{leap:.0f} mm from where its motion led {interval:.2f} s before, which no breath does"
        mean = self._points.mean(axis=0)
        if not self._complete and _principal_axis(self._points)[1] < FIRST_AXIS_SPREAD_M:
            distance = 1e3 * float(np.linalg.norm(displacement - mean))
            return f"{distance:.0f} mm from where it was" if distance > 1e3 * FIRST_BREATH_REACH_M else ""
        distance, sideways = self._off_curve(displacement)
        if distance <= min(self._sideways_limit_mm, config.displaced_mm):
            return ""
        leap = 1e3 * float(np.linalg.norm(displacement - predicted))
        if sideways <= self._sideways_limit_mm and (
            distance <= config.displaced_mm or (leap <= config.displaced_mm and distance <= config.deeper_breath_mm)
        ):
            return ""
        return f"{distance:.0f} mm off the breathing curve"

    @property
    def _sideways_limit_mm(self) -> float:
        """How far off the curve, across its axis, is still breathing: less where breaths have repeated well."""
        if not self._complete:
            return self._config.displaced_mm
        return min(self._config.displaced_mm, self._config.repeatable_mm + 2.0 * self._widest_mm)

    @property
    def _curve(self) -> Array:
        """(N, 3) what judges: the first whole breath, then all but the last one, which must not vouch for itself."""
        if not self._complete:
            return self._points
        until_s = max(self._complete_time_s, self._last_time_s - self._config.longest_breath_s, self._times_s[0])
        return np.asarray(self._points[self._times_s <= until_s])

    def _off_curve(self, displacement: Array) -> tuple[float, float]:
        """Distance to the curve, and its part across the axis, mm."""
        curve = self._curve
        axis, _ = _principal_axis(curve)
        mean = curve.mean(axis=0)
        if not self._complete:
            curve = np.vstack([mean - FIRST_BREATH_REACH_M * axis, mean + FIRST_BREATH_REACH_M * axis])
        distance = float(distance_to_curve(displacement[None], curve)[0])
        along = (curve - mean) @ axis
        beyond = float((displacement - mean) @ axis)
        beyond -= float(np.clip(beyond, along.min(), along.max()))
        return 1e3 * distance, 1e3 * float(np.sqrt(max(distance**2 - beyond**2, 0.0)))

    def accept(self, time_s: float, displacement: Array) -> None:
        """Take a displacement (3,) m at a time as breathing."""
        self._last_interval_s = max(time_s - self._last_time_s, 1e-3)
        if self._last_interval_s > self._config.longest_jump_interval_s:
            # Breaths that passed unseen, while somebody clicked along a held pair say, have taught nothing.
            self._first_time_s += self._last_interval_s
        self._velocity = (displacement - self._last) / self._last_interval_s
        self._last_time_s, self._last = time_s, np.array(displacement)
        if self._complete:
            # What only just passes must not widen the curve: else a slow departure would carry it along.
            sideways = self._off_curve(displacement)[1]
            if sideways > CURVE_WIDTH_SHARE * self._sideways_limit_mm:
                return
            self._widest_mm = max(self._widest_mm, sideways)
        if time_s - self._times_s[-1] >= self._config.longest_breath_s / POINTS_A_BREATH or not self._complete:
            self._points = np.vstack([self._points, displacement])[-LONGEST_TRAJECTORY:]
            self._times_s = np.append(self._times_s, time_s)[-LONGEST_TRAJECTORY:]
        if not self._complete:
            long_enough = time_s - self._first_time_s > self._config.longest_breath_s
            self._complete = long_enough or _count_turns(self._points) >= 2
            self._complete_time_s = time_s


def _principal_axis(points: Array) -> tuple[Array, float]:
    """(3,) direction of largest spread, and the standard deviation along it."""
    _, singular, directions = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    return directions[0], float(singular[0] / np.sqrt(len(points)))


def _count_turns(points: Array) -> int:
    """Reversals along the principal axis, larger than a share of the range."""
    axis, _ = _principal_axis(points)
    along = points @ axis
    threshold = max(REVERSAL_SHARE * float(np.ptp(along)), 1.5e-3)
    turns, heading, extreme = 0, 0, float(along[0])
    for value in along[1:]:
        if heading == 0:
            if abs(value - extreme) > threshold:
                heading, extreme = (1 if value > extreme else -1), float(value)
        elif heading * (value - extreme) > 0.0:
            extreme = float(value)
        elif heading * (extreme - value) > threshold:
            turns, heading, extreme = turns + 1, -heading, float(value)
    return turns
