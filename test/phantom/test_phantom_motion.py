"""Breathing and heartbeat: amplitudes, continuity, references."""

import numpy as np
import pytest

from lasso_motion_ros.phantom.motion import Breathing, Heartbeat, Motion
from lasso_motion_ros.phantom.settings import BreathingSettings, HeartSettings


def breathing(duration_s: float = 30.0, **settings: object) -> Breathing:
    return Breathing(BreathingSettings(**settings), np.random.default_rng(3), duration_s)


def heartbeat(**settings: object) -> Heartbeat:
    return Heartbeat(HeartSettings(**settings), np.random.default_rng(4), 30.0)


def test_a_breath_goes_out_and_back_along_its_direction() -> None:
    breath = breathing(amplitude_mm=40.0, period_s=4.0, direction=(0.0, 0.0, -2.0))
    assert breath.displacement(0.0) == pytest.approx(np.zeros(3), abs=1e-12)
    assert breath.displacement(2.0) == pytest.approx([0.0, 0.0, -0.040])
    assert breath.displacement(1.0) == pytest.approx([0.0, 0.0, -0.010])  # sin⁴(π/4) = 1/4
    assert breath.displacement(4.0) == pytest.approx(np.zeros(3), abs=1e-9)


def test_hysteresis_separates_the_ways_in_and_out() -> None:
    breath = breathing(amplitude_mm=10.0, period_s=4.0, hysteresis_mm=2.0)
    times = np.linspace(0.0, 2.0, 201)
    gap = [np.linalg.norm(breath.displacement(t) - breath.displacement(4.0 - t)) for t in times]
    assert max(gap) == pytest.approx(4e-3, rel=0.01)
    assert gap[0] == pytest.approx(0.0, abs=1e-9)


def test_irregular_breaths_differ_and_stay_smooth() -> None:
    breath = breathing(amplitude_mm=20.0, period_s=4.0, hysteresis_mm=2.0, irregularity=0.2)
    times = np.arange(0.0, 28.0, 0.01)
    path = np.array([breath.displacement(t) for t in times])
    depth = np.array([breath.depth(t) for t in times])
    peaks = depth[1:-1][(depth[1:-1] > depth[:-2]) & (depth[1:-1] >= depth[2:])]
    assert np.ptp(peaks) > 0.1
    acceleration = np.diff(path, 2, axis=0) / 0.01**2
    assert np.abs(acceleration).max() < 0.3  # a jump in velocity of 10 mm/s would show as 1 m/s²


def test_drift_and_rotation() -> None:
    assert breathing(amplitude_mm=0.0, drift_mm_per_min=-6.0, direction=(0, 0, 1)).displacement(10.0) == pytest.approx(
        [0, 0, -1e-3]
    )
    turned = breathing(period_s=4.0, rotation_deg=3.0, rotation_axis=(1, 0, 0)).transform(2.0)
    assert np.degrees(np.arctan2(turned[2, 1], turned[1, 1])) == pytest.approx(3.0)


def test_start_shifts_the_first_breath() -> None:
    assert breathing(period_s=4.0, start=0.5).depth(0.0) == pytest.approx(1.0)


def test_truth_is_relative_to_the_first_pair() -> None:
    motion = Motion(breathing(start=0.4, rotation_deg=2.0), heartbeat(amplitude_mm=2.0))
    assert motion.atrium(0.0) == pytest.approx(np.eye(4), abs=1e-12)
    assert motion.respiratory(0.0) == pytest.approx(np.eye(4), abs=1e-12)
    for time_s in (0.7, 2.3):
        # T(t) maps the atrium's place at time 0 to its place now.
        now, start = motion.body_state(time_s).heart, motion.body_state(0.0).heart
        assert motion.atrium(time_s) @ start == pytest.approx(now, abs=1e-12)


def test_the_respiratory_truth_has_no_heartbeat() -> None:
    still = Motion(breathing(amplitude_mm=0.0), heartbeat(amplitude_mm=2.0, direction=(0, 0, 1)))
    times = np.linspace(0.0, 3.0, 100)
    assert all(still.respiratory(t) == pytest.approx(np.eye(4), abs=1e-12) for t in times)
    heights = [still.body_state(t).heart[2, 3] for t in times]
    assert max(heights) == pytest.approx(2e-3, rel=0.01)
    assert min(heights) == pytest.approx(0.0, abs=1e-6)


def test_r_peaks_start_the_beats() -> None:
    beat = heartbeat(rate_bpm=60.0, variability=0.1)
    peaks = beat.r_peaks(20.0)
    assert 17 <= len(peaks) <= 23
    assert all(beat.phase(peak + 1e-6) == pytest.approx(0.0, abs=1e-4) for peak in peaks)
    assert np.std(np.diff(peaks)) == pytest.approx(0.1, abs=0.05)
    assert beat.contraction(peaks[0] + 0.225) > 0.8
