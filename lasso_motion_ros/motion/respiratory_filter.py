"""Breathing and heartbeat in one measured displacement, separated as it comes.

A Kalman filter over the sum of two processes: breathing, which is smooth (Matérn-5/2), and the heartbeat, three
harmonics that turn with the heart's phase (the periodic process of Solin and Särkkä, "Explicit link between periodic
covariance functions and state space models", AISTATS 2014, cut after its third harmonic). With R peaks the phase is
known. Without, a row of heart rates is tried side by side, "none" among them, and weighted by how well each predicts
the measurements.

Only the estimated heartbeat is subtracted, so breathing is not delayed as by a low-pass filter: 0.3 s of delay at
breathing's fastest 40 mm/s is 12 mm, more than the heartbeat ever moves.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.motion.heartbeat import HeartPhase
from lasso_motion_ros.motion.matern import stationary, transition

Array = npt.NDArray[np.float64]

# Layout of the state; each axis of the world has one. Breathing is VALUE + MEAN, the heartbeat the sum of the COSINES.
VALUE, SLOPE, CURVATURE, MEAN, HEART, ORIGIN, SIZE = 0, 1, 2, 3, slice(4, 10), 10, 11
COSINES = slice(4, 10, 2)
HARMONICS = np.array([1, 2, 3])


@dataclass(frozen=True)
class FilterTuning:
    """What the filter expects of breathing, heart and stream.

    Attributes:
        time_scale_s: of breathing, seconds: inspiration sets in faster than its period suggests.
        first_spread_mm: standard deviation of breathing along an axis before any has been seen, mm; it counts as one
            measurement.
        smallest_spread_mm: the least it can be learned to be, mm.
        harmonic_shares: standard deviation of each of the heartbeat's harmonics, relative to the first.
        coherence_s: with R peaks, time after which a beat looks different, seconds.
        coherence_untimed_s: without, where the beats' irregularity counts too, seconds.
        evidence_s: the time over which heart rates are judged, seconds: the rate changes.
        step_hz: between the rates tried, Hz.
        smallest_noise_mm: of a measurement, mm.
        log_odds: for a heartbeat where there are R peaks: a few beats show too little of it to be seen.
        breathing_band_hz: up to here breathing itself has power, Hz.
        intervals: between exposures, whose median gives the frame rate.
        longest_replay: measurements kept until the first beat's length is known.
    """

    time_scale_s: float = 1.2
    first_spread_mm: float = 12.0
    smallest_spread_mm: float = 0.5
    harmonic_shares: tuple[float, ...] = (1.0, 0.5, 0.4)
    coherence_s: float = 60.0
    coherence_untimed_s: float = 15.0
    evidence_s: float = 30.0
    step_hz: float = 0.05
    smallest_noise_mm: float = 0.03
    log_odds: float = 10.0
    breathing_band_hz: float = 0.5
    intervals: int = 9
    longest_replay: int = 64


TUNING = FilterTuning()


@dataclass(frozen=True, eq=False)
class Separation:
    """The heartbeat's part of one displacement.

    Attributes:
        heart_mm: (3,) what the heartbeat added since the reference, mm; zero where it cannot be separated.
        variance_mm2: (3,) its variance, mm².
        separated: whether it could be separated.
        text: how it was, or why it could not be, with the numbers.
        heart_hz: the heart's frequency, measured (R peaks) or found; None where it is not known.
    """

    heart_mm: Array
    variance_mm2: Array
    separated: bool
    text: str
    heart_hz: float | None = None


class RespiratoryFilter:
    """Separates breathing from heartbeat; causal, for exposures at any intervals.

    Args:
        slowest_hz: slowest heart looked for where there are no R peaks.
        fastest_hz: fastest; more than twice as many exposures a second are needed then.
        excursion_mm: rough size of the heartbeat's motion along an axis, mm.

    Raises:
        ConfigurationError: a slowest rate that is not below the fastest.
    """

    def __init__(self, slowest_hz: float = 0.75, fastest_hz: float = 1.83, excursion_mm: float = 0.8) -> None:
        if not slowest_hz < fastest_hz:
            raise ConfigurationError(
                f"heartbeat.slowest_bpm must be below fastest_bpm, found {60 * slowest_hz:g} and {60 * fastest_hz:g}"
            )
        self._fastest_hz = fastest_hz
        # Hypotheses: no heartbeat, each of the rates, and last the phase by the R peaks.
        rates = np.arange(slowest_hz, fastest_hz + TUNING.step_hz / 2, TUNING.step_hz)
        self._rates_hz = np.concatenate([[0.0], rates])
        count = len(self._rates_hz) + 1
        amplitude = np.repeat((excursion_mm * np.array(TUNING.harmonic_shares)) ** 2 / 2.0, 2)
        self._prior = np.tile(amplitude, (count, 1))
        self._prior[0] = 0.0
        self._coherence_s = np.full(count, TUNING.coherence_untimed_s)
        self._coherence_s[-1] = TUNING.coherence_s
        self._heart = np.zeros((count, 3, 6))
        self._heart_covariance = self._unknown_heart()
        self._intervals: deque[float] = deque(maxlen=TUNING.intervals)
        self._start_ns = self._time_ns = 0
        self._phase: HeartPhase | None = None

    def start(self, stamp_ns: int, phase: HeartPhase | None, *, keep_heart: bool = False) -> None:
        """Begin at the reference, where the displacement is zero by definition.

        Args:
            stamp_ns: the reference's time.
            phase: the heart's phase there, or None.
            keep_heart: what was learned of the heart holds on: only the reference was changed.
        """
        if keep_heart:
            turn, decay = self._turned(stamp_ns, phase)
            self._heart, self._heart_covariance = self._advanced_heart(turn, decay)
        else:
            self._heart, self._heart_covariance = np.zeros_like(self._heart), self._unknown_heart()
            self._intervals.clear()
        self._replay: list[tuple[int, Array, Array]] | None = [] if phase is None and not keep_heart else None
        self._begin(stamp_ns, phase)

    def separate(self, stamp_ns: int, displacement_mm: Array, noise_mm: Array, phase: HeartPhase | None) -> Separation:
        """Take in the displacement at the next exposure, and say which part of it is the heartbeat's.

        Args:
            stamp_ns: its time, later than the last.
            displacement_mm: (3,) since the reference, mm.
            noise_mm: (3,) its standard deviation from exposure to exposure.
            phase: the heart's phase, or None where it is not known.
        """
        self._intervals.append(1e-9 * (stamp_ns - self._time_ns))
        if self._replay is not None:
            if phase is not None:
                self._again(phase)
            elif len(self._replay) < TUNING.longest_replay:
                self._replay.append((stamp_ns, displacement_mm, noise_mm))
            else:
                self._replay = None
        self._take_in(stamp_ns, displacement_mm, noise_mm, phase)
        return self._result(phase)

    @property
    def rate_hz(self) -> float | None:
        """Exposures a second: by the median of the last intervals; None before the second."""
        return None if not self._intervals else 1.0 / max(float(np.median(self._intervals)), 1e-6)

    def _again(self, phase: HeartPhase) -> None:
        """Go through the past again, now that the beat's length is known: it held then, too."""
        past, self._replay = self._replay or [], None
        self._heart, self._heart_covariance = np.zeros_like(self._heart), self._unknown_heart()
        self._begin(self._start_ns, phase)
        for stamp_ns, displacement_mm, noise_mm in past:
            self._take_in(stamp_ns, displacement_mm, noise_mm, phase)

    def _result(self, phase: HeartPhase | None) -> Separation:
        rate = self.rate_hz or 0.0
        if phase is not None:
            heart_hz = phase.frequency_hz
            apparent_hz = abs(heart_hz - rate * round(heart_hz / rate))
            beats = f"a heart of {60 * heart_hz:.0f}/min"
            if apparent_hz < TUNING.breathing_band_hz:
                return _nothing(
                    f"at {rate:.1f} pairs/s {beats} looks like {apparent_hz:.2f} Hz, which breathing has, too:"
                    " motion is motion_raw",
                    heart_hz,
                )
            return self._weighted(self._weights([0, -1]), f"by R peaks, {beats}, {rate:.1f} pairs/s", heart_hz)
        if rate <= 2.0 * self._fastest_hz:
            return _nothing(
                f"{rate:.1f} pairs/s are too few to tell a heart of up to {60 * self._fastest_hz:.0f}/min from"
                f" breathing without R peaks (more than {2.0 * self._fastest_hz:.1f} are needed):"
                " motion is motion_raw"
            )
        weights = self._weights(slice(0, -1))
        sure = 1.0 - float(weights[0])
        found_hz = float(weights[:-1] @ self._rates_hz) / sure if sure > 0.5 else None
        found = "no heartbeat found" if found_hz is None else f"a heart of about {60 * found_hz:.0f}/min"
        return self._weighted(weights, f"without R peaks, {found}, {rate:.1f} pairs/s", found_hz)

    def _weights(self, members: slice | list[int]) -> Array:
        """How far each hypothesis is to be believed, among some of them; the others get 0."""
        evidence = self._evidence + np.append(np.zeros(len(self._rates_hz)), TUNING.log_odds)
        weights = np.zeros(len(evidence))
        weights[members] = np.exp(evidence[members] - evidence[members].max())
        return weights / float(weights.sum())

    def _weighted(self, weights: Array, text: str, heart_hz: float | None) -> Separation:
        """The heartbeat now less that at the reference, over all hypotheses."""
        row = np.zeros(SIZE)
        row[COSINES] = 1.0
        row[ORIGIN] = 1.0  # breathing's share of zero at the reference: less the heartbeat's there
        each = self._state @ row
        mean = weights @ each
        variance = weights @ (row @ self._covariance @ row + (each - mean) ** 2)
        return Separation(mean, variance, True, text, heart_hz)

    def _unknown_heart(self) -> Array:
        return np.broadcast_to(_diagonal(self._prior)[:, None], (len(self._prior), 3, 6, 6)).copy()

    @property
    def _spread_mm2(self) -> Array:
        """(3,) variance of breathing along each axis, learned so far."""
        return np.asarray((self._scatter + TUNING.first_spread_mm**2) / (self._seen + 1) + TUNING.smallest_spread_mm**2)

    def _begin(self, stamp_ns: int, phase: HeartPhase | None) -> None:
        self._seen, self._mean, self._scatter = 0, np.zeros(3), np.zeros(3)
        self._evidence = np.zeros(len(self._prior))
        self._start_ns = self._time_ns = stamp_ns
        self._phase = phase
        shape = (len(self._prior), 3)
        self._state, self._covariance = np.zeros((*shape, SIZE)), np.zeros((*shape, SIZE, SIZE))
        spread = self._spread_mm2
        self._covariance[:, :, :3, :3] = spread[:, None, None] * stationary(TUNING.time_scale_s)
        self._covariance[:, :, MEAN, MEAN] = spread
        self._state[:, :, HEART] = self._heart
        self._covariance[:, :, HEART, HEART] = self._heart_covariance
        self._update(np.zeros(3), np.full(3, 1e-3))
        self._evidence[:] = 0.0
        copy = np.eye(SIZE)
        copy[ORIGIN] = 0.0
        copy[ORIGIN, [VALUE, MEAN]] = 1.0
        self._state, self._covariance = self._state @ copy.T, copy @ self._covariance @ copy.T

    def _take_in(self, stamp_ns: int, displacement_mm: Array, noise_mm: Array, phase: HeartPhase | None) -> None:
        interval_s = 1e-9 * (stamp_ns - self._time_ns)
        turn, decay = self._turned(stamp_ns, phase)
        forward, noise = np.zeros((len(self._prior), SIZE, SIZE)), np.zeros((len(self._prior), 3, SIZE, SIZE))
        breathing, unmoved = transition(interval_s, TUNING.time_scale_s), stationary(TUNING.time_scale_s)
        forward[:, :3, :3] = breathing
        forward[:, MEAN, MEAN] = forward[:, ORIGIN, ORIGIN] = 1.0
        forward[:, HEART, HEART] = turn * decay[:, None, None]
        driven = unmoved - breathing @ unmoved @ breathing.T
        noise[:, :, :3, :3] = self._spread_mm2[:, None, None] * driven
        noise[:, :, HEART, HEART] = _diagonal((1.0 - decay[:, None] ** 2) * self._prior)[:, None]
        self._state = (forward[:, None] @ self._state[..., None])[..., 0]
        self._covariance = forward[:, None] @ self._covariance @ np.swapaxes(forward, 1, 2)[:, None] + noise
        self._evidence *= np.exp(-interval_s / TUNING.evidence_s)
        self._time_ns, self._phase = stamp_ns, phase
        self._update(displacement_mm, np.maximum(noise_mm, TUNING.smallest_noise_mm))
        self._heart = self._state[:, :, HEART]
        self._heart_covariance = self._covariance[:, :, HEART, HEART]
        self._seen += 1
        delta = displacement_mm - self._mean
        self._mean = self._mean + delta / (self._seen + 1)
        self._scatter = self._scatter + delta * (displacement_mm - self._mean)

    def _turned(self, stamp_ns: int, phase: HeartPhase | None) -> tuple[Array, Array]:
        """How the harmonics turn since the last exposure: (F, 6, 6) rotations, (F,) what remains of them."""
        interval_s = 1e-9 * (stamp_ns - self._time_ns)
        angle = np.append(2.0 * np.pi * self._rates_hz * interval_s, 0.0)
        decay = np.exp(-abs(interval_s) / self._coherence_s)
        if phase is None or self._phase is None:
            decay[-1] = 0.0  # what phase the measurements before belong to is not known
        else:
            angle[-1] = 2.0 * np.pi * (phase.at(stamp_ns) - self._phase.at(self._time_ns))
        turn = np.zeros((len(angle), 6, 6))
        for harmonic in HARMONICS:
            at = 2 * (harmonic - 1)
            cosine, sine = np.cos(harmonic * angle), np.sin(harmonic * angle)
            turn[:, at, at] = turn[:, at + 1, at + 1] = cosine
            turn[:, at, at + 1], turn[:, at + 1, at] = sine, -sine
        return turn, decay

    def _advanced_heart(self, turn: Array, decay: Array) -> tuple[Array, Array]:
        forward = (turn * decay[:, None, None])[:, None]
        mean = (forward @ self._heart[..., None])[..., 0]
        noise = _diagonal((1.0 - decay[:, None] ** 2) * self._prior)[:, None]
        return mean, forward @ self._heart_covariance @ np.swapaxes(forward, -1, -2) + noise

    def _update(self, measured_mm: Array, noise_mm: Array) -> None:
        row = np.zeros(SIZE)
        row[[VALUE, MEAN]] = 1.0
        row[COSINES] = 1.0
        variance = self._covariance @ row @ row + noise_mm**2
        innovation = measured_mm - self._state @ row
        self._evidence = self._evidence - 0.5 * np.sum(innovation**2 / variance + np.log(variance), axis=1)
        gain = self._covariance @ row / variance[..., None]
        self._state = self._state + gain * innovation[..., None]
        keep = np.eye(SIZE) - gain[..., :, None] * row
        # Joseph's form stays positive where the reference's noise-free zero would not.
        self._covariance = keep @ self._covariance @ np.swapaxes(keep, -1, -2) + (
            noise_mm[:, None, None] ** 2 * gain[..., :, None] * gain[..., None, :]
        )


def _nothing(text: str, heart_hz: float | None = None) -> Separation:
    return Separation(np.zeros(3), np.zeros(3), False, text, heart_hz)


def _diagonal(values: Array) -> Array:
    """(..., N, N) with (..., N) on the diagonal."""
    return np.asarray(values[..., None] * np.eye(values.shape[-1]))
