"""Where breathing has taken the ring, and how far off a place lies: turns and distances."""

import numpy as np
import pytest
from support.breaths import ASIDE, PAIR_S, SIGMA_M, UP, after, breathed, wave

from lasso_motion_ros.ring.breathing_curve import BreathingCurve, CurveTuning

TUNING = CurveTuning()


@pytest.mark.parametrize(("seconds", "is_complete"), [(1.8, False), (3.6, False), (5.0, True), (9.0, True)])
def test_a_breath_is_complete_after_two_turns(seconds, is_complete):
    # Up, down at 4 s, and on its way up again.
    assert breathed(seconds)[0].is_complete == is_complete


@pytest.mark.parametrize("held_s", [10.0, 60.0])
def test_a_breath_that_is_held_is_none(held_s):
    random = np.random.default_rng(3)
    up = [wave(t) for t in np.arange(1, 6) * PAIR_S]
    held = [wave(1.8) + 2e-4 * random.normal(size=3) for _ in range(round(held_s / PAIR_S))]
    assert not after([*up, *held])[0].is_complete
    # And a heartbeat is no turn of the breathing.
    beat = [1e-3 * np.sin(2.0 * np.pi * 1.1 * i * PAIR_S) * UP for i in range(1, 60)]
    assert not after(beat)[0].is_complete


def test_before_any_motion_it_may_go_four_centimetres_in_any_direction():
    curve = BreathingCurve(np.zeros(3), 0.0, TUNING)
    for direction in (UP, -UP, ASIDE):
        # 3 standard deviations at 40 mm.
        assert curve.distance_sigmas(0.3, 0.020 * direction, SIGMA_M) == pytest.approx(1.5)


def test_in_the_first_breath_what_counts_is_the_distance_off_its_line_by_hand():
    curve, time_s = after([2e-3 * i * UP for i in range(1, 6)])
    at = time_s + PAIR_S
    across = curve.distance_sigmas(at, 6e-3 * UP + 5e-3 * ASIDE, 0.0)
    drift_m = TUNING.drift_m_s * at
    assert across == pytest.approx(5e-3 / np.hypot(2.5e-3, drift_m), rel=0.02)
    # Along it, beyond the deepest so far, 10 mm are one standard deviation.
    deepest = curve.distance_sigmas(at, 20e-3 * UP, 0.0)
    assert 1.0 <= deepest <= 1.5


@pytest.mark.parametrize("sigma_mm", [1.0, 2.0])
def test_in_the_first_breath_a_strong_heart_widens_what_is_borne_across_by_hand(sigma_mm):
    # Six places 2 mm apart: 3.42 mm root mean square along the axis. Of 5 mm across, a heart of 2 mm may be
    # 1.5 · 2 / 3.42 · 5 mm: its share of what was seen is its share of the direction.
    curve, time_s = after([2e-3 * i * UP for i in range(1, 6)])
    at, sigma_m = time_s + PAIR_S, 1e-3 * sigma_mm
    spread_m = 2e-3 * np.sqrt(35.0 / 12.0)
    wider_m = 1.5 * sigma_m / spread_m * 5e-3
    scale_m = np.sqrt(2.5e-3**2 + sigma_m**2 + wider_m**2 + (TUNING.drift_m_s * at) ** 2)
    found = curve.distance_sigmas(at, 6e-3 * UP + 5e-3 * ASIDE, sigma_m)
    assert found == pytest.approx(5e-3 / scale_m, rel=0.02)


def test_off_a_curve_of_breaths_that_repeat_the_distance_in_sigmas_by_hand():
    curve, time_s = breathed(jitter_mm=0.0)
    assert curve.is_complete
    on = curve.distance_sigmas(time_s + 0.05, 6e-3 * UP, SIGMA_M)
    assert on < 0.1
    off = curve.distance_sigmas(time_s + 0.05, 6e-3 * UP + 3e-3 * ASIDE, SIGMA_M)
    drift_m = TUNING.drift_m_s * min(time_s + 0.05, TUNING.drift_s)
    assert off == pytest.approx(3e-3 / np.sqrt(curve.sigma_m**2 + SIGMA_M**2 + drift_m**2), rel=0.02)
    # What is known less well is less far off.
    loose = curve.distance_sigmas(time_s + 0.05, 6e-3 * UP + 3e-3 * ASIDE, 2e-3)
    assert loose == pytest.approx(3e-3 / np.sqrt(curve.sigma_m**2 + 2e-3**2 + drift_m**2), rel=0.02)


def test_how_far_breaths_are_apart_is_learned():
    exact, loose = (breathed(40.0, jitter_mm=jitter)[0].sigma_m for jitter in (0.02, 1.0))
    # Six pairs of 1 mm, and all later ones: 1 / √(1 + 60/6) of it where breaths repeat exactly; never below 0.4 mm.
    assert TUNING.smallest_sigma_m <= exact < 0.5e-3
    assert 0.6e-3 < loose < 1.6e-3
    first, _ = breathed(3.0)
    assert first.sigma_m == TUNING.first_sigma_m


@pytest.mark.parametrize("beyond_mm", [3.0, 8.0])
def test_a_deeper_breath_along_the_axis_is_in_place(beyond_mm):
    curve, time_s = breathed()
    deeper = 1e-3 * (12.0 + beyond_mm) * UP
    # 10 mm are one standard deviation: a deeper breath is nothing to wonder at.
    assert curve.distance_sigmas(time_s + PAIR_S, deeper, SIGMA_M) == pytest.approx(beyond_mm / 10.0, abs=0.15)
    assert curve.distance_sigmas(time_s + PAIR_S, deeper + 6e-3 * ASIDE, SIGMA_M) > 3.0


def test_hysteresis_is_a_part_of_the_curve():
    curve, time_s = breathed(hysteresis_mm=2.0)
    for later in (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5):
        place = wave(time_s + later, hysteresis_mm=2.0)
        assert curve.distance_sigmas(time_s + PAIR_S, place, SIGMA_M) < 0.5


def test_the_first_inspiration_after_a_pause_goes_where_it_likes():
    # Two seconds at rest: half a millimetre of heart tells no direction.
    random = np.random.default_rng(5)
    rest = [5e-4 * random.normal(size=3) for _ in range(7)]
    breath = 0.9 * UP - 0.43 * np.array([0.0, 1.0, 0.0])
    curve, time_s = after(rest)
    for index in range(1, 6):
        place = 3.5e-3 * index * breath
        assert curve.distance_sigmas(time_s + index * PAIR_S, place, 4e-4) < 3.3
        curve.accept(time_s + index * PAIR_S, place)


def drawn_aside(steps=20):
    """A curve whose ring is drawn aside by 0.25 mm a pair, each step accepted; its sigma before; the time."""
    curve, time_s = breathed(16.0)
    before_m = curve.sigma_m
    for index in range(1, steps + 1):
        time_s += PAIR_S
        curve.accept(time_s, wave(time_s) + 0.25e-3 * index * ASIDE)
    return curve, before_m, time_s + PAIR_S


def test_the_curve_of_a_breath_ago_is_not_drawn_along():
    curve, _, time_s = drawn_aside()
    place = wave(time_s) + 5e-3 * ASIDE
    # What is known of the place itself outweighs all else: it is 5 mm off the curve as it was.
    assert 50.0 * curve.distance_sigmas(time_s, place, 50e-3) == pytest.approx(5.0, rel=0.05)


def test_what_just_happened_does_not_widen_what_is_borne():
    curve, before_m, time_s = drawn_aside()
    assert curve.sigma_m < 2.0 * before_m
    assert curve.distance_sigmas(time_s, wave(time_s) + 5e-3 * ASIDE, SIGMA_M) > 2.0


def test_what_comes_too_soon_or_too_often_is_not_kept():
    curve = BreathingCurve(np.zeros(3), 0.0, TUNING)
    for index in range(1, 1000):
        curve.accept(0.06 * index, wave(0.06 * index))
        curve.accept(0.06 * index + 0.01, np.ones(3))
    assert len(curve._points) <= TUNING.points
    assert np.abs(curve._points).max() < 0.1


def test_the_input_is_not_kept():
    place = 1e-3 * UP
    curve = BreathingCurve(np.zeros(3), 0.0, TUNING)
    curve.accept(0.3, place)
    place += 1.0
    assert np.abs(curve._points).max() < 0.01
