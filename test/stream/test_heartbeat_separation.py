"""What is published as motion: as tracked, gated, filtered; what is said of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lasso_motion_ros.config.stream import HeartbeatConfig
from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.geometry.transforms import apply, rigid
from lasso_motion_ros.stream.heart_phases import HeartPhases
from lasso_motion_ros.stream.heartbeat_separation import HeartbeatSeparation, PublishedMotion, _noise_mm
from lasso_motion_ros.tracking.tracker import TrackerState, TrackResult

START_NS = 1_760_000_000_000_000_000
RATE_HZ = 8.0
CENTRE = np.array([0.01, -0.02, 0.03])
LOOP = CENTRE + 0.01 * np.array([[1.0, 0, 0], [0, 1.0, 0], [-1.0, 0, 0], [0, -1.0, 0]])
COVARIANCE = np.diag([1e-8, 2e-8, 3e-8, 1e-6, 1e-6, 1e-6])


def ns(time_s: float) -> int:
    return START_NS + round(time_s * 1e9)


class Separation(HeartbeatSeparation):
    """With the phases that it reads."""

    def __init__(self, **values: Any) -> None:
        phases = HeartPhases(remembered=100)
        super().__init__(HeartbeatConfig(**values), phases)
        self.add_r_peak, self.add_pair = phases.add_r_peak, phases.add_pair


def separation(**values: Any) -> Separation:
    return Separation(**values)


def result(time_s: float, x_mm: float, reference_s: float = 0.0, motion: np.ndarray | None = None) -> TrackResult:
    motion = rigid((0, 0, 0), (1e-3 * x_mm, 0, 0)) if motion is None else motion
    return TrackResult(ns(time_s), TrackerState.TRACKING, "", motion, COVARIANCE, apply(motion, LOOP), ns(reference_s))


def beat_mm(time_s: float) -> float:
    """1 mm at the R peak, at 75/min; 0 on the mean."""
    return float(np.cos(2 * np.pi * time_s / 0.8))


def run(line: Separation, times_s: Any, displacement_mm: Any, peaks_s: Any = ()) -> list[Any]:
    """What is published for each; the first is the reference."""
    waiting, published = list(peaks_s), []
    for k, time_s in enumerate(times_s):
        while waiting and waiting[0] <= time_s:
            line.add_r_peak(ns(waiting.pop(0)))
        line.add_pair(ns(time_s), new_run=False)
        published.append(line.publish(result(time_s, displacement_mm(time_s)), is_new=k == 0))
    return published


TIMES_S = np.arange(81) / RATE_HZ
PEAKS_S = 0.8 * np.arange(-3, 13)


def test_by_default_motion_is_what_was_tracked() -> None:
    line = separation()
    tracked = result(1.0, 3.0)
    line.add_pair(ns(1.0), new_run=False)
    published = line.publish(tracked, is_new=False)
    assert isinstance(published, PublishedMotion)
    assert published.motion is tracked.motion
    assert published.covariance is tracked.covariance
    assert line.status is None


def test_gated_the_pairs_in_the_window_and_the_reference_have_a_motion() -> None:
    line = separation(mode="gate", window_start=0.5, window_end=0.75)
    published = run(line, TIMES_S, beat_mm, PEAKS_S)
    parts = (TIMES_S / 0.8 + 1e-9) % 1.0
    expected = (parts >= 0.5) & (parts < 0.75)
    expected[0] = True
    assert [one is not None for one in published] == expected.tolist()
    assert published[4].motion[0, 3] == pytest.approx(1e-3 * beat_mm(0.5))
    assert published[4].covariance is COVARIANCE
    status = line.status
    assert status is not None
    assert status.works
    assert status.values["poses in the window"] == f"{expected.sum() - 1} of 81"
    assert status.values["heart rate (1/min)"] == "75"
    assert status.values["reference in the window"].startswith("no")
    last = TIMES_S[np.flatnonzero(expected)[-1]]
    assert status.values["age of motion (s)"] == f"{TIMES_S[-1] - last:.2f}"


def test_gated_what_is_left_of_the_heartbeat_is_a_constant() -> None:
    published = run(
        separation(mode="gate", window_start=0.45, window_end=0.55), np.arange(200) / 50.0, beat_mm, PEAKS_S
    )
    found = np.array([1e3 * one.motion[0, 3] for one in published[1:] if one is not None])
    assert len(found) > 15
    np.testing.assert_allclose(found, -1.0, atol=0.06)


def test_gated_without_r_peaks_only_the_reference_has_a_motion_and_it_is_said() -> None:
    line = separation(mode="gate")
    published = run(line, TIMES_S[:20], beat_mm)
    assert [one is not None for one in published] == [True] + 19 * [False]
    status = line.status
    assert status is not None
    assert not status.works
    assert "the heart's phase is not known (0 R peaks received)" in status.text


def test_the_phase_is_that_of_the_time_when_the_pair_came() -> None:
    line, late = separation(mode="gate"), separation(mode="gate")
    for one in (line, late):
        for peak_s in (0.0, 0.8, 1.6):
            one.add_r_peak(ns(peak_s))
        one.add_pair(ns(2.1), new_run=False)  # 0.625 of the beat
    late.add_r_peak(ns(2.05))  # the pair waited for the tracker meanwhile
    assert line.publish(result(2.1, 1.0), is_new=False) is not None
    assert late.publish(result(2.1, 1.0), is_new=False) is not None


@pytest.mark.parametrize("peaks_s", [PEAKS_S, ()])
def test_filtered_the_heartbeat_is_taken_away_and_its_uncertainty_added(peaks_s: Any) -> None:
    def breathing(time_s: float) -> float:
        return 6.0 * (1.0 - np.cos(2 * np.pi * time_s / 4.5))

    line = separation(mode="filter")
    published = run(line, TIMES_S, lambda t: breathing(t) + beat_mm(t) - beat_mm(0.0), peaks_s)
    error = np.array([1e3 * one.motion[0, 3] - breathing(t) for one, t in zip(published, TIMES_S, strict=True)])
    assert error[0] == 0.0
    assert np.abs(error[TIMES_S > 6.0]).max() < 0.4  # of 2.0
    added = published[-1].covariance - COVARIANCE
    assert np.array_equal(np.flatnonzero(added), [0, 7, 14])
    assert 0.0 < added[0, 0] < 0.5e-6
    status = line.status
    assert status is not None
    assert status.works
    assert status.text.startswith("by R peaks" if len(peaks_s) else "without R peaks")


def test_filtered_at_too_few_pairs_motion_is_what_was_tracked_and_it_is_said() -> None:
    line = separation(mode="filter")
    published = run(line, np.arange(20) / 3.0, beat_mm)
    assert published[-1].motion[0, 3] == pytest.approx(1e-3 * beat_mm(19 / 3.0))
    assert np.array_equal(published[-1].covariance, COVARIANCE)
    status = line.status
    assert status is not None
    assert not status.works
    assert "3.0 pairs/s are too few" in status.text
    assert "more than 3.7 are needed" in status.text


def test_a_rotation_stays_and_the_centre_is_what_is_filtered() -> None:
    line = separation(mode="filter")
    waiting = list(PEAKS_S)
    for k, time_s in enumerate(TIMES_S):
        while waiting and waiting[0] <= time_s:
            line.add_r_peak(ns(waiting.pop(0)))
        line.add_pair(ns(time_s), new_run=False)
        # It turns with the heartbeat about the loop's centre, which rests.
        turned = rigid((0, 0, 0.05 * (beat_mm(time_s) - beat_mm(0.0))), (0, 0, 0), CENTRE)
        published = line.publish(result(time_s, 0.0, motion=turned), is_new=k == 0)
        assert published is not None
        np.testing.assert_allclose(published.motion, turned, atol=1e-5)


def test_the_noise_is_that_of_the_loops_place() -> None:
    covariance = np.diag([4e-8, 0.0, 0.0, 0.0, 0.0, 9e-6])
    # 0.2 mm along x; 3 mrad about z move a place 0.1 m off along x by 0.3 mm along y.
    np.testing.assert_allclose(_noise_mm(covariance, np.array([0.1, 0.0, 0.0])), [0.2, 0.3, 0.0], atol=1e-12)
    np.testing.assert_allclose(_noise_mm(np.diag([0, 0, 0, 0, 4e-6, 0.0]), np.array([0.1, 0.0, 0.0])), [0, 0, 0.2])
    np.testing.assert_allclose(_noise_mm(np.diag([0, 0, 0, 1e-6, 0, 0.0]), np.array([0.0, 0.0, 0.1])), [0, 0.1, 0])


def test_a_new_run_does_not_count_from_the_r_peaks_of_the_last() -> None:
    line = separation(mode="gate")
    for peak_s in (100.0, 101.0, 102.0):
        line.add_r_peak(ns(peak_s))
    line.add_pair(ns(50.0), new_run=True)
    line.add_pair(ns(102.6), new_run=False)
    assert line.publish(result(102.6, 1.0, reference_s=50.0), is_new=False) is None


def test_a_new_reference_is_zero_again() -> None:
    line = separation(mode="filter")
    run(line, TIMES_S, beat_mm, PEAKS_S)
    last_s = TIMES_S[-1]
    later = last_s + 0.125
    line.add_pair(ns(later), new_run=False)
    moved = beat_mm(later) - beat_mm(last_s)
    published = line.publish(result(later, moved, reference_s=last_s), is_new=False)
    assert published is not None
    # What was learned of the heart holds on: its 0.7 mm within this step are seen for what they are.
    assert abs(moved) > 0.3
    assert abs(1e3 * published.motion[0, 3]) < 0.3 * abs(moved)


def test_reset_forgets() -> None:
    line = separation(mode="gate")
    run(line, TIMES_S, beat_mm, PEAKS_S)
    line.reset()
    assert line.status is not None
    assert line.status.text == "no pose yet"


def test_contradictions_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="must differ"):
        separation(window_start=0.3, window_end=0.3)
