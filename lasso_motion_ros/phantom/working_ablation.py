"""The path of an ablation catheter's tip that works at the ring."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.phantom.catheters import Loop, curve_length
from lasso_motion_ros.phantom.lab_settings import WorkSettings

Array = npt.NDArray[np.float64]

LONGEST_WAY = 0.35  # of the loop, from one place to the next
SHORTEST_WAY_S = 0.4


@dataclass(frozen=True)
class _Place:
    """Where the tip stays for a while.

    Attributes:
        arrives_s, leaves_s: seconds.
        along: share of the loop's length from its tip, at arrival.
        distance_m: from the loop's centreline.
        elevation_rad: 0 radially outward, π/2 along the loop's axis towards the shaft.
    """

    arrives_s: float
    leaves_s: float
    along: float
    distance_m: float
    elevation_rad: float


class WorkingTip:
    """Where the tip is before any motion of the heart.

    It walks from place to place round the ring, each at its own distance from the wire and on its own side of it
    (outward, or on the side of the atrium, where tissue is ablated), dwells there, and creeps along meanwhile.

    Args:
        settings: of the work.
        loop: the ring before any motion.
        random: draws the places.
        duration_s: how long places are needed for.
    """

    def __init__(self, settings: WorkSettings, loop: Loop, random: np.random.Generator, duration_s: float) -> None:
        self._settings, self._loop = settings, loop
        self._length = curve_length(loop.points)
        self._tremor = random.uniform(0.0, 2.0 * np.pi, (3, 2))
        along, time_s = float(random.uniform(0.05, 0.95)), -float(random.uniform(0.0, settings.dwell_s))
        self._places: list[_Place] = []
        while not self._places or self._places[-1].leaves_s <= duration_s:
            leaves = time_s + settings.dwell_s * float(random.uniform(0.4, 1.6))
            distance = 1e-3 * float(random.uniform(settings.nearest_mm, settings.farthest_mm))
            elevation = float(random.uniform(-0.2, 0.5 * np.pi))
            self._places.append(_Place(time_s, leaves, along, distance, elevation))
            left = self._crept(self._places[-1], leaves)
            along = float(np.clip(left + random.uniform(-LONGEST_WAY, LONGEST_WAY), 0.03, 0.97))
            time_s = leaves + max(SHORTEST_WAY_S, 1e3 * abs(along - left) * self._length / settings.speed_mm_s)

    def at(self, time_s: float, contraction: float) -> tuple[Array, Array]:
        """Tip and heading.

        Args:
            time_s: since the first pair.
            contraction: of the heart, 0 to 1: the tissue pushes the tip off.

        Returns:
            (3,) metres; (3,) unit vector along the loop, in which a dragged tip lies.
        """
        settings = self._settings
        along, distance, elevation = self._state(time_s)
        index = along * (len(self._loop.points) - 1)
        place, tangent = self._curve(index), self._curve(index + 0.5) - self._curve(index - 0.5)
        tangent = tangent / np.linalg.norm(tangent)
        outward = place - self._loop.centre
        outward -= (outward @ tangent) * tangent
        outward -= (outward @ self._loop.normal) * self._loop.normal
        outward = outward / np.linalg.norm(outward)
        away = np.cos(elevation) * outward + np.sin(elevation) * self._loop.normal
        waves = np.sin(self._tremor[:, 0] + 2.6 * time_s) + 0.6 * np.sin(self._tremor[:, 1] + 7.1 * time_s)
        lifted = distance + 1e-3 * settings.bounce_mm * contraction
        return place + lifted * away + 1e-3 * settings.tremor_mm * waves / np.sqrt(3.0), tangent

    def distance_m(self, time_s: float) -> float:
        """Distance from the loop's centreline that the work asks for; bounce and tremor come on top."""
        return self._state(time_s)[1]

    def _state(self, time_s: float) -> tuple[float, float, float]:
        """Share of the loop, distance (m) and elevation (rad) at a time."""
        number = next(
            (number for number, place in enumerate(self._places) if time_s < place.leaves_s), len(self._places) - 1
        )
        place = self._places[number]
        if time_s >= place.arrives_s or number == 0:
            return self._crept(place, time_s), place.distance_m, place.elevation_rad
        last = self._places[number - 1]
        part = (time_s - last.leaves_s) / (place.arrives_s - last.leaves_s)
        part = part * part * (3.0 - 2.0 * part)
        left = np.array([self._crept(last, last.leaves_s), last.distance_m, last.elevation_rad])
        reached = np.array([place.along, place.distance_m, place.elevation_rad])
        along, distance, elevation = left + part * (reached - left)
        return float(along), float(distance), float(elevation)

    def _crept(self, place: _Place, time_s: float) -> float:
        crept = 1e-3 * self._settings.drag_mm_s * max(time_s - place.arrives_s, 0.0) / self._length
        return min(place.along + crept, 0.98)

    def _curve(self, index: float) -> Array:
        points = self._loop.points
        return np.array([np.interp(index, np.arange(len(points)), points[:, axis]) for axis in range(3)])
