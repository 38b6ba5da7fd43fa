"""Breathing told from heartbeat: with and without R peaks, and where the pairs are too few for it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.motion.heartbeat import HeartPhase, RPeaks
from lasso_motion_ros.motion.respiratory_filter import RespiratoryFilter, Separation
from lasso_motion_ros.phantom.motion import Breathing, Heartbeat, Motion
from lasso_motion_ros.phantom.settings import BreathingSettings, HeartSettings

Array = npt.NDArray[np.float64]
START_NS = 1_760_000_000_000_000_000
NOISE_MM = 0.06


class Sequence:
    """Breathing and heartbeat of the phantom, measured with a little noise, mm since the first exposure."""

    def __init__(self, rate_hz: float, heart_mm: float = 1.2, jitter: float = 0.0) -> None:
        random = np.random.default_rng(1)
        seconds = 24.0
        beat = Heartbeat(HeartSettings(rate_bpm=74.0, amplitude_mm=heart_mm, variability=0.05), random, seconds + 1)
        breath = BreathingSettings(amplitude_mm=15.0, period_s=4.4, hysteresis_mm=1.5, irregularity=0.1, start=0.3)
        self.times_s = np.arange(round(seconds * rate_hz)) / rate_hz
        self.times_s[1:] += jitter / rate_hz * random.uniform(-0.5, 0.5, len(self.times_s) - 1)
        motion = Motion(Breathing(breath, random, seconds + 1), beat)
        origin = motion.atrium(float(self.times_s[0])), motion.respiratory(float(self.times_s[0]))
        self.full_mm, self.breathing_mm = (
            1e3 * np.array([(pose(float(t)) @ np.linalg.inv(first))[:3, 3] for t in self.times_s])
            for pose, first in zip((motion.atrium, motion.respiratory), origin, strict=True)
        )
        self.measured_mm = self.full_mm + random.normal(0.0, NOISE_MM, self.full_mm.shape)
        self.peaks_s = beat.r_peaks(seconds)

    def run(self, *, with_peaks: bool, filter_: RespiratoryFilter | None = None) -> tuple[Array, list[Separation]]:
        """What is left of the measured displacement, and what was told of each."""
        filter_ = filter_ or RespiratoryFilter()
        peaks, waiting = RPeaks(), list(self.peaks_s) if with_peaks else []

        def phase(time_s: float) -> HeartPhase | None:
            while waiting and waiting[0] <= time_s:
                peaks.add(ns(waiting.pop(0)))
            return peaks.phase(ns(time_s))

        filter_.start(ns(self.times_s[0]), phase(self.times_s[0]))
        told = [
            filter_.separate(ns(t), at, np.full(3, NOISE_MM), phase(t))
            for t, at in zip(self.times_s[1:], self.measured_mm[1:], strict=True)
        ]
        return self.measured_mm[1:] - [one.heart_mm for one in told], told

    def share_left(self, breathing_mm: Array) -> float:
        """Root mean square of what is not breathing after 8 s, as a share of what was in the measurement."""
        late = self.times_s[1:] > 8.0
        left, before = (
            np.sqrt(np.mean(np.sum((found - self.breathing_mm[1:])[late] ** 2, axis=1)))
            for found in (breathing_mm, self.measured_mm[1:])
        )
        return float(left / before)


def ns(time_s: float) -> int:
    return START_NS + round(float(time_s) * 1e9)


@pytest.mark.parametrize(
    ("rate_hz", "with_peaks", "most_left"),
    [
        (3.0, True, 0.6),
        (3.75, True, 0.55),
        (7.5, True, 0.4),
        (15.0, True, 0.4),
        (7.5, False, 0.55),
        (15.0, False, 0.55),
    ],
)
def test_the_heartbeat_is_taken_away(rate_hz: float, with_peaks: bool, most_left: float) -> None:
    sequence = Sequence(rate_hz)
    assert sequence.share_left(sequence.run(with_peaks=with_peaks)[0]) < most_left


def test_uneven_exposures_do_as_well() -> None:
    sequence = Sequence(7.5, jitter=0.6)
    assert sequence.share_left(sequence.run(with_peaks=True)[0]) < 0.45


def test_the_heart_rate_is_found_without_r_peaks() -> None:
    told = Sequence(15.0).run(with_peaks=False)[1][-1]
    assert told.heart_hz == pytest.approx(74.0 / 60.0, abs=0.1)
    assert "without R peaks, a heart of about" in told.text


def test_too_few_pairs_are_said_to_be_too_few_and_nothing_is_changed() -> None:
    sequence = Sequence(3.0)
    left, told = sequence.run(with_peaks=False)
    assert np.array_equal(left, sequence.measured_mm[1:])
    assert told[-1].text == (
        "3.0 pairs/s are too few to tell a heart of up to 110/min from breathing without R peaks"
        " (more than 3.7 are needed): motion is motion_raw"
    )
    assert not told[-1].separated


def test_a_heart_that_the_pairs_turn_into_breathing_is_left_in() -> None:
    # 60/min at 2 pairs/s shows two phases, 1 Hz apart from breathing; at 1.25 pairs/s it looks like 0.25 Hz.
    beat_ns = 1_000_000_000
    for rate_hz, apart in ((2.0, True), (1.25, False)):
        filter_ = RespiratoryFilter()
        filter_.start(ns(0.0), HeartPhase(ns(0.0), beat_ns))
        told = [
            filter_.separate(ns(k / rate_hz), np.zeros(3), np.zeros(3), HeartPhase(ns(0.0), beat_ns))
            for k in range(1, 6)
        ]
        assert told[-1].separated == apart
    assert told[-1].text == (
        "at 1.2 pairs/s a heart of 60/min looks like 0.25 Hz, which breathing has, too: motion is motion_raw"
    )


@pytest.mark.parametrize("with_peaks", [True, False])
def test_without_a_heartbeat_breathing_is_left_alone_and_not_delayed(with_peaks: bool) -> None:
    sequence = Sequence(15.0, heart_mm=0.0)
    left, told = sequence.run(with_peaks=with_peaks)
    assert all(one.separated for one in told[-60:])
    late = sequence.times_s[1:] > 5.0
    changed = np.linalg.norm((left - sequence.measured_mm[1:])[late], axis=1)
    assert changed.max() < 0.15
    # A delay would show as a part of the velocity in what was changed.
    velocity = np.gradient(sequence.breathing_mm[1:, 2], sequence.times_s[1:])[late]
    delay_s = float(velocity @ (sequence.breathing_mm[1:, 2] - left[:, 2])[late] / (velocity @ velocity))
    assert abs(delay_s) < 0.005


@pytest.mark.parametrize("with_peaks", [True, False])
def test_its_variance_covers_its_error(with_peaks: bool) -> None:
    sequence = Sequence(7.5)
    left, told = sequence.run(with_peaks=with_peaks)
    variance = np.array([one.variance_mm2 for one in told]) + NOISE_MM**2
    normalised = ((left - sequence.breathing_mm[1:]) ** 2 / variance)[sequence.times_s[1:] > 3.0]
    assert np.mean(normalised) < 1.5


def test_the_first_beats_are_learned_from_once_their_length_is_known() -> None:
    sequence = Sequence(7.5)
    told = sequence.run(with_peaks=True)[1]
    first = next(k for k, one in enumerate(told) if one.text.startswith("by R peaks"))
    assert sequence.times_s[first] < 2.0
    early = RespiratoryFilter()
    phase = RPeaks()
    for peak_s in sequence.peaks_s[:3]:
        phase.add(ns(peak_s))
    known = phase.phase(ns(sequence.times_s[first + 1]))
    early.start(ns(0.0), known)
    for t, at in zip(sequence.times_s[1 : first + 2], sequence.measured_mm[1 : first + 2], strict=True):
        result = early.separate(ns(t), at, np.full(3, NOISE_MM), known)
    np.testing.assert_allclose(told[first].heart_mm, result.heart_mm, atol=1e-9)


def test_a_changed_reference_keeps_what_was_learned_of_the_heart() -> None:
    sequence = Sequence(7.5)
    again, fresh = RespiratoryFilter(), RespiratoryFilter()
    sequence.run(with_peaks=True, filter_=again)
    peaks = RPeaks()
    for peak_s in sequence.peaks_s:
        peaks.add(ns(peak_s))
    uncertain = []
    for filter_, keep in ((again, True), (fresh, False)):
        filter_.start(ns(sequence.times_s[-1]), peaks.phase(ns(sequence.times_s[-1])), keep_heart=keep)
        later = ns(sequence.times_s[-1] + 0.4)
        told = filter_.separate(later, np.zeros(3), np.full(3, NOISE_MM), peaks.phase(later))
        uncertain.append(np.sqrt(told.variance_mm2).max())
    assert uncertain[0] < 0.5 * uncertain[1]


def test_lost_r_peaks_are_said_and_what_was_learned_by_them_is_dropped() -> None:
    sequence = Sequence(3.0)
    sequence.peaks_s = [peak for peak in sequence.peaks_s if not 12.0 < peak < 20.0]
    told = sequence.run(with_peaks=True)[1]
    lost = [one for one, t in zip(told, sequence.times_s[1:], strict=True) if 15.5 < t < 20.0]
    assert not any(one.separated for one in lost)
    assert "too few" in lost[0].text
    before = next(one for one, t in zip(told, sequence.times_s[1:], strict=True) if t > 11.5)
    after = next(one for one, t in zip(told, sequence.times_s[1:], strict=True) if t > 20.0 and one.separated)
    assert np.all(after.variance_mm2 > 2.0 * before.variance_mm2)


def test_a_range_of_rates_upside_down_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="slowest_bpm must be below fastest_bpm, found 120 and 60"):
        RespiratoryFilter(2.0, 1.0)


def test_a_gap_does_not_change_the_frame_rate() -> None:
    filter_ = RespiratoryFilter()
    filter_.start(ns(0.0), None)
    for time_s in (0.25, 0.5, 1.5, 1.75, 2.0):
        filter_.separate(ns(time_s), np.zeros(3), np.zeros(3), None)
    assert filter_.rate_hz == pytest.approx(4.0)
