"""Breathing and heartbeat as functions of time, drawn once from a seed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.transforms import rigid
from lasso_motion_ros.phantom.body_renderer import BodyState
from lasso_motion_ros.phantom.settings import BreathingSettings, HeartSettings

Array = npt.NDArray[np.float64]


class Breathing:
    """Depth and displacement of breathing.

    One breath follows Lujan et al. (Medical Physics 26, 1999): depth = sin⁴(πu), u from 0 to 1, which dwells at
    end-expiration. Each breath has its own depth and length; all begin and end at end-expiration, so that the motion
    and its velocity are continuous.

    Args:
        settings: the scenario's.
        random: draws the irregular breaths.
        duration_s: how long breaths are needed for.
    """

    def __init__(self, settings: BreathingSettings, random: np.random.Generator, duration_s: float) -> None:
        self._settings = settings
        self._direction = _unit(settings.direction)
        # The way back lies beside the way in, across the main direction, mostly front to back.
        sideways = np.cross(self._direction, (1.0, 0.0, 0.0))
        self._sideways = _unit(
            sideways if np.linalg.norm(sideways) > 0.1 else np.cross(self._direction, (0.0, 1.0, 0.0))
        )
        starts = [-settings.start * settings.period_s]
        depths: list[float] = []
        while starts[-1] <= duration_s or not depths:
            spread = random.normal(size=2) if depths else np.zeros(2)
            starts.append(starts[-1] + settings.period_s * float(np.exp(0.6 * settings.irregularity * spread[0])))
            depths.append(float(np.clip(1.0 + settings.irregularity * spread[1], 0.3, 1.5)))
        self._starts, self._depths = np.asarray(starts), np.asarray(depths)

    def depth(self, time_s: float) -> float:
        """Depth of the breath: 0 at end-expiration, 1 at the full amplitude."""
        u, depth = self._phase(time_s)
        return float(depth * np.sin(np.pi * u) ** 4)

    def displacement(self, time_s: float) -> Array:
        """(3,) metres from end-expiration."""
        settings = self._settings
        u, depth = self._phase(time_s)
        along = settings.amplitude_mm * depth * np.sin(np.pi * u) ** 4
        along += settings.drift_mm_per_min * time_s / 60.0
        # sin(2πu) sin²(πu), scaled to a maximum of 1, is 0 with its derivative at both ends of the breath.
        across = settings.hysteresis_mm * depth * np.sin(2 * np.pi * u) * np.sin(np.pi * u) ** 2 * 1.5396
        return np.asarray(1e-3 * (along * self._direction + across * self._sideways))

    def transform(self, time_s: float) -> Array:
        """(4, 4) motion of the heart from end-expiration, its rotation about the world origin."""
        settings = self._settings
        angle = np.radians(settings.rotation_deg) * self.depth(time_s)
        return rigid(angle * _unit(settings.rotation_axis), self.displacement(time_s))

    def _phase(self, time_s: float) -> tuple[float, float]:
        index = int(np.clip(np.searchsorted(self._starts, time_s, side="right") - 1, 0, len(self._depths) - 1))
        length = self._starts[index + 1] - self._starts[index]
        return float(np.clip((time_s - self._starts[index]) / length, 0.0, 1.0)), float(self._depths[index])


class Heartbeat:
    """Phase of the heart, and what follows from it.

    Args:
        settings: the scenario's.
        random: draws the beats' lengths.
        duration_s: how long beats are needed for.
    """

    def __init__(self, settings: HeartSettings, random: np.random.Generator, duration_s: float) -> None:
        self._displacement = 1e-3 * settings.amplitude_mm * _unit(settings.direction)
        length = 60.0 / settings.rate_bpm
        peaks = [-float(random.uniform(0.0, length))]
        while peaks[-1] <= duration_s:
            peaks.append(peaks[-1] + length * float(np.clip(random.normal(1.0, settings.variability), 0.5, 2.0)))
        self._peaks = np.asarray(peaks)
        # No two beats of a fibrillating heart pull alike.
        self._strengths = np.clip(random.normal(1.0, settings.strength_spread, len(peaks)), 0.2, 2.0)

    def phase(self, time_s: float) -> float:
        """Part of the beat that has passed since its R peak, 0 to 1."""
        index = self._beat(time_s)
        return float((time_s - self._peaks[index]) / (self._peaks[index + 1] - self._peaks[index]))

    def contraction(self, time_s: float) -> float:
        """Ventricular systole over the first 45 % of the beat, a fourth as much for the atrial kick before the next."""
        phase = self.phase(time_s)
        if phase < 0.45:
            return float(np.sin(np.pi * phase / 0.45) ** 2)
        return float(0.25 * np.sin(np.pi * (phase - 0.8) / 0.2) ** 2) if phase > 0.8 else 0.0

    def displacement(self, time_s: float) -> Array:
        """(3,) translation of the atrium, metres."""
        return np.asarray(self._displacement * self.contraction(time_s) * self._strengths[self._beat(time_s)])

    def swing(self, time_s: float) -> tuple[float, float]:
        """Two periodic signals in −1…1 for the ring's own tilt and stretch."""
        angle = 2.0 * np.pi * self.phase(time_s)
        return float(np.sin(angle)), float(np.sin(angle + 1.0))

    def r_peaks(self, end_s: float) -> list[float]:
        """Times of the R peaks from 0 up to `end_s`, seconds."""
        return [float(peak) for peak in self._peaks if 0.0 <= peak <= end_s]

    def _beat(self, time_s: float) -> int:
        return int(np.clip(np.searchsorted(self._peaks, time_s, side="right") - 1, 0, len(self._peaks) - 2))


@dataclass(frozen=True)
class Motion:
    """Both motions of one sequence; the atrium's pose is relative to time 0."""

    breathing: Breathing
    heartbeat: Heartbeat

    def body_state(self, time_s: float) -> BodyState:
        """Where the moving anatomy is."""
        return BodyState(
            heart=self._absolute(time_s),
            contraction=self.heartbeat.contraction(time_s),
            breath=self.breathing.displacement(time_s),
            depth=self.breathing.depth(time_s),
        )

    def atrium(self, time_s: float) -> Array:
        """(4, 4) p(t) = T · p(0) of the atrium, breathing and heartbeat."""
        return np.asarray(self._absolute(time_s) @ np.linalg.inv(self._absolute(0.0)))

    def respiratory(self, time_s: float) -> Array:
        """(4, 4) likewise, of breathing alone."""
        return np.asarray(self.breathing.transform(time_s) @ np.linalg.inv(self.breathing.transform(0.0)))

    def _absolute(self, time_s: float) -> Array:
        transform = self.breathing.transform(time_s)
        transform[:3, 3] += self.heartbeat.displacement(time_s)
        return transform


def _unit(vector: npt.ArrayLike) -> Array:
    vector = np.asarray(vector, dtype=np.float64)
    return np.asarray(vector / np.linalg.norm(vector))
