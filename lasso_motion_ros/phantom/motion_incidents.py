"""What interrupts breathing, and what moves the patient or the ring besides breath and heart, over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.transforms import rigid
from lasso_motion_ros.phantom.lab_settings import Incident
from lasso_motion_ros.phantom.motion import Breathing
from lasso_motion_ros.phantom.settings import BreathingSettings, LassoSettings

Array = npt.NDArray[np.float64]


class DisturbedBreathing(Breathing):
    """Breathing with coughs, pauses and sighs; the same as `Breathing` where there is none of them.

    A pause stops the breathing's clock where its velocity is 0: an apnoea at the next end-expiration, a held breath
    at the next full inspiration. A sigh makes the next whole breath as deep as it says. A cough is a short push
    against the direction of inspiration on top of all that, out and back within its duration.

    Args:
        settings: of the undisturbed breathing.
        random: draws the irregular breaths.
        duration_s: how long breaths are needed for.
        incidents: of the scenario; those that are not about breathing are ignored.
    """

    def __init__(
        self,
        settings: BreathingSettings,
        random: np.random.Generator,
        duration_s: float,
        incidents: Sequence[Incident] = (),
    ) -> None:
        super().__init__(settings, random, duration_s)
        ordered = sorted(incidents, key=lambda incident: incident.start_s)
        self._coughs = [incident for incident in ordered if incident.kind == "cough"]
        self._pauses: list[tuple[float, float]] = []  # start and length, seconds
        for incident in ordered:
            if incident.kind in ("apnoea", "breath_hold"):
                middle = 0.5 if incident.kind == "breath_hold" else 0.0
                begins = self._starts[:-1] + middle * np.diff(self._starts)
                self._pauses.append((self._next(begins, incident.start_s), incident.duration_s))
            elif incident.kind == "sigh" and settings.amplitude_mm > 0.0:
                index = int(np.searchsorted(self._starts, self._clock(incident.start_s)))
                if index < len(self._depths):
                    self._depths[index] = incident.amount / settings.amplitude_mm

    def displacement(self, time_s: float) -> Array:
        """(3,) metres from end-expiration."""
        push = sum(
            incident.amount * np.sin(np.pi * (time_s - incident.start_s) / incident.duration_s) ** 2
            for incident in self._coughs
            if incident.lasts(time_s)
        )
        return np.asarray(super().displacement(time_s) - 1e-3 * push * self._direction)

    def _phase(self, time_s: float) -> tuple[float, float]:
        return super()._phase(self._clock(time_s))

    def _clock(self, time_s: float) -> float:
        """Time that breathing has gone on for."""
        return time_s - sum(min(max(time_s - start, 0.0), length) for start, length in self._pauses)

    def _next(self, moments: Array, time_s: float) -> float:
        """The first of the breathing clock's moments that is not before a time, as a time."""
        index = int(np.searchsorted(moments, self._clock(time_s)))
        if index == len(moments):
            return time_s
        return time_s + float(moments[index]) - self._clock(time_s)


def patient_pose(incidents: Sequence[Incident], time_s: float) -> Array:
    """(4, 4) where the whole patient lies on the table, relative to the first pair."""
    shift = np.zeros(3)
    for incident in incidents:
        if incident.kind == "shift":
            direction = np.asarray(incident.direction, dtype=np.float64)
            shift += 1e-3 * incident.amount * incident.progress(time_s) * direction / np.linalg.norm(direction)
    return rigid(np.zeros(3), shift)


def ring_slide(incidents: Sequence[Incident], out_of_vein: Array, time_s: float) -> Array:
    """(3,) how far the ring has slid from its place, metres in the atrium's axes.

    Args:
        incidents: of the scenario.
        out_of_vein: (3,) unit vector, the ring's axis towards the shaft.
        time_s: since the first pair.
    """
    slid = np.zeros(3)
    for incident in incidents:
        if incident.kind == "slide":
            direction = np.asarray(incident.direction, dtype=np.float64)
            unit = direction / np.linalg.norm(direction) if any(direction) else out_of_vein
            seconds = max(time_s - incident.start_s, 0.0)
            slid += (
                1e-3 * incident.amount * (min(seconds, incident.duration_s) if incident.duration_s else seconds) * unit
            )
    return slid


def seat_motion(lasso: LassoSettings, time_s: float) -> Array:
    """(3,) how far the ring lies to one side on its seat, metres in the atrium's axes: nothing at the first pair.

    It is pressed to the tissue by its shaft, and is not fixed to it.
    """
    direction = np.asarray(lasso.seat_direction, dtype=np.float64)
    off_m = 1e-3 * lasso.seat_mm * np.sin(2.0 * np.pi * time_s / lasso.seat_period_s)
    return np.asarray(off_m * direction / np.linalg.norm(direction))


def withdrawn_share(incidents: Sequence[Incident], time_s: float) -> float:
    """How much of the loop has been pulled into its sheath, 0 to 1."""
    return max((incident.progress(time_s) for incident in incidents if incident.kind == "withdraw"), default=0.0)


def ring_growth(incidents: Sequence[Incident], time_s: float) -> float:
    """Diameter of a variable loop by that in the first pair."""
    growth = 1.0
    for incident in incidents:
        if incident.kind == "resize":
            growth *= 1.0 + (incident.amount - 1.0) * incident.progress(time_s)
    return growth
