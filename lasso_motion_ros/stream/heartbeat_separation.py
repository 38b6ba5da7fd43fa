"""From the tracked motion to the published one: gated, filtered, or as it is.

Gated, a pair outside the window gets no `motion`; whoever applies the last one sees its age by its stamp. Repeated
under the new pair's stamp, it would claim that the atrium is where it was up to a beat ago, which in deep breathing is
20 mm off, and no consumer could tell.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.stream import HeartbeatConfig
from lasso_motion_ros.geometry import transforms
from lasso_motion_ros.geometry.covariance import at_point
from lasso_motion_ros.motion.heartbeat import CardiacGate, HeartPhase
from lasso_motion_ros.motion.respiratory_filter import RespiratoryFilter
from lasso_motion_ros.stream.heart_phases import HeartPhases
from lasso_motion_ros.tracking.tracker import TrackResult

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PublishedMotion:
    """What goes out as `motion`.

    Attributes:
        motion: (4, 4) T with p_now = T · p_reference, world metres.
        covariance: (6, 6) of it, as in `TrackResult`, or None.
    """

    motion: Array
    covariance: Array | None


@dataclass(frozen=True)
class HeartbeatStatus:
    """What diagnostics and summaries say of it.

    Attributes:
        works: whether the heartbeat is kept out of `motion` as configured.
        text: how, or why not, with the numbers.
        values: further numbers, by name.
    """

    works: bool
    text: str
    values: Mapping[str, str] = field(default_factory=dict)


class HeartbeatSeparation:
    """Keeps the heartbeat out of `motion`, as configured.

    Args:
        config: mode and parameters.
        phases: the heart's phase at each pair; only read.

    Attributes:
        config: as given.

    Raises:
        ConfigurationError: parameters that contradict each other.
    """

    def __init__(self, config: HeartbeatConfig, phases: HeartPhases) -> None:
        self.config = config
        self._phases = phases
        self._gate = CardiacGate(config.window_start, config.window_end)
        self._filter = RespiratoryFilter(config.slowest_bpm / 60.0, config.fastest_bpm / 60.0, config.excursion_mm)
        self._centre = np.zeros(3)
        self._reference_ns: int | None = None
        self._poses = self._in_window = 0
        self._last_update_ns: int | None = None  # before the first open window, if the gate came in mid-stream
        self._status: HeartbeatStatus | None = None
        self.reset()

    def reset(self) -> None:
        """Forget the reference, with the model."""
        self._reference_ns = None
        self._poses = self._in_window = 0
        self._status = None if self.config.mode == "none" else HeartbeatStatus(True, "no pose yet")

    @property
    def status(self) -> HeartbeatStatus | None:
        """How well it works; None where the mode is `none`."""
        return self._status

    def publish(self, result: TrackResult, *, is_new: bool) -> PublishedMotion | None:
        """What to publish for a result with a pose; None where `motion` is not updated.

        Args:
            result: the tracker's, with a pose.
            is_new: the model was built on this pair.
        """
        if result.motion is None:
            return None
        if self.config.mode == "gate":
            return self._gated(result, result.motion)
        if self.config.mode == "filter":
            return self._filtered(result, result.motion, is_new=is_new)
        return PublishedMotion(result.motion, result.covariance)

    def _gated(self, result: TrackResult, motion: Array) -> PublishedMotion | None:
        stamp_ns = result.stamp_ns
        phase = self._phases.at(stamp_ns)
        is_open = self._gate.is_open(phase, stamp_ns)
        self._poses += 1
        self._in_window += is_open
        # The reference's own motion is the identity by definition, whatever the heart did.
        updated = is_open or stamp_ns == result.reference_stamp_ns
        if updated:
            self._last_update_ns = stamp_ns
        age_s = None if self._last_update_ns is None else 1e-9 * (stamp_ns - self._last_update_ns)
        values = {
            "poses in the window": f"{self._in_window} of {self._poses}",
            "age of motion (s)": "not yet updated" if age_s is None else f"{age_s:.2f}",
            "R peaks": str(self._phases.peaks_received),
        } | _heart_rate(phase)
        reference_ns = result.reference_stamp_ns
        if self._phases.is_remembered(reference_ns):
            inside = self._gate.is_open(self._phases.at(reference_ns), reference_ns)
            # Otherwise what the heart moves between the reference's phase and the window's stays in.
            values["reference in the window"] = "yes" if inside else "no, which leaves a constant part in motion"
        window = f"{self.config.window_start:g} to {self.config.window_end:g} of the beat"
        text = f"motion is updated from {window} only"
        if phase is None:
            text += f", and the heart's phase is not known ({self._phases.peaks_received} R peaks received)"
        elif phase.doubtful:
            text += "; this beat is left out: an R peak came too early"
        self._status = HeartbeatStatus(phase is not None, text, values)
        return PublishedMotion(motion, result.covariance) if updated else None

    def _filtered(self, result: TrackResult, motion: Array, *, is_new: bool) -> PublishedMotion:
        stamp_ns, reference_ns = result.stamp_ns, result.reference_stamp_ns
        if is_new or reference_ns != self._reference_ns:
            self._centre = _reference_centre(result, motion)
            known = not is_new and self._reference_ns is not None
            self._filter.start(reference_ns, self._phases.at(reference_ns), keep_heart=known)
            self._reference_ns = reference_ns
        if stamp_ns <= reference_ns:
            return PublishedMotion(motion, result.covariance)
        place = transforms.apply(motion, self._centre)
        phase = self._phases.at(stamp_ns)
        found = self._filter.separate(
            stamp_ns, 1e3 * (place - self._centre), _noise_mm(result.covariance, place), phase
        )
        heart_rate = {} if found.heart_hz is None else {"heart rate (1/min)": f"{60.0 * found.heart_hz:.0f}"}
        values = {
            "heartbeat taken away (mm)": f"{np.linalg.norm(found.heart_mm):.2f}",
            **heart_rate,
            "R peaks": str(self._phases.peaks_received),
        }
        self._status = HeartbeatStatus(found.separated, found.text, values)
        breathing = motion.copy()
        breathing[:3, 3] -= 1e-3 * found.heart_mm
        covariance = result.covariance
        if covariance is not None:
            covariance = covariance.copy()
            covariance[np.arange(3), np.arange(3)] += 1e-6 * found.variance_mm2
        return PublishedMotion(breathing, covariance)


def _heart_rate(phase: HeartPhase | None) -> dict[str, str]:
    return {} if phase is None else {"heart rate (1/min)": f"{60.0 * phase.frequency_hz:.0f}"}


def _reference_centre(result: TrackResult, motion: Array) -> Array:
    """(3,) the loop's centre at the reference, metres: the place whose displacement is filtered."""
    if result.loop is None:
        return np.zeros(3)
    return np.asarray(transforms.apply(transforms.inverse(motion), result.loop.mean(axis=0)))


def _noise_mm(covariance: Array | None, place: Array) -> Array:
    """(3,) standard deviation of a place moved by the motion, mm."""
    if covariance is None:
        return np.zeros(3)
    return np.asarray(1e3 * np.sqrt(np.maximum(np.diag(at_point(covariance, place)), 0.0)))
