"""Where breathing has taken the ring, and how far off a place lies: turns, distances, slides."""

import copy

import numpy as np
import pytest

from lasso_motion_ros.ring.breathing_curve import BreathingCurve, CurveTuning, Slide, _median, _speed

TUNING = CurveTuning()
UP, ASIDE = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
PAIR_S = 0.3
SIGMA_M = 1e-4


def wave(time_s, depth_mm=12.0, period_s=4.0, hysteresis_mm=0.0):
    """Breathing along the patient's axis from the first time on, (3,) metres; in on one side and out on the other."""
    phase = 2.0 * np.pi * time_s / period_s
    return 1e-3 * (0.5 * depth_mm * (1.0 - np.cos(phase)) * UP + hysteresis_mm * np.sin(phase) * ASIDE)


def after(places, pair_s=PAIR_S):
    """A curve that has accepted places (N, 3) in turn, and the time of the last."""
    curve = BreathingCurve(np.zeros(3), 0.0, TUNING)
    for index, place in enumerate(places, start=1):
        curve.accept(index * pair_s, place)
    return curve, len(places) * pair_s


def breathed(duration_s=16.0, pair_s=PAIR_S, seed=1, jitter_mm=0.05, **of_wave):
    random = np.random.default_rng(seed)
    times = np.arange(1, round(duration_s / pair_s) + 1) * pair_s
    return after([wave(t, **of_wave) + 1e-3 * jitter_mm * random.normal(size=3) for t in times], pair_s)


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


def slid(speed_mm_s, *, pair_s=PAIR_S, hysteresis_mm=1.5, start_s=12.0, until_mm=4.0, jitter_mm=0.1, seed=2):
    """Pairs from the start of a slide on: (true distance, distance found, its log odds, all departures), mm."""
    curve, time_s = breathed(start_s, pair_s, hysteresis_mm=hysteresis_mm, jitter_mm=jitter_mm)
    random = np.random.default_rng(seed)
    rows = []
    while not rows or rows[-1][0] < until_mm:
        time_s += pair_s
        true_mm = speed_mm_s * (time_s - start_s)
        place = wave(time_s, hysteresis_mm=hysteresis_mm) + 1e-3 * (true_mm * ASIDE + jitter_mm * random.normal(size=3))
        slide = curve.slide(time_s, place)
        departure = curve.departure_sigmas(time_s, place, SIGMA_M, slide)
        rows.append((true_mm, 1e3 * slide.across_m, slide.log_odds, departure))
        curve.accept(time_s, place)  # as long as nobody knows
    return np.array(rows)


@pytest.mark.parametrize("pair_s", [0.1, 0.3])
def test_a_slide_of_half_a_millimetre_a_second_is_told_from_breathing(pair_s):
    rows = slid(0.5, pair_s=pair_s)
    true_mm, found_mm, odds, departure = rows.T
    late = (true_mm > 2.0) & (true_mm < 4.0)
    assert (odds[late] > 5.0).all()
    np.testing.assert_allclose(found_mm[late], true_mm[late], rtol=0.2)
    # Noticed before it is 2 mm, by no more than the odds that a state asks for.
    noticed = true_mm[departure > 3.3]
    assert len(noticed)
    assert noticed[0] < 2.0


@pytest.mark.parametrize("pair_s", [0.1, 0.3])
@pytest.mark.parametrize("hysteresis_mm", [0.0, 1.5, 3.0])
def test_breathing_with_hysteresis_is_no_slide(pair_s, hysteresis_mm):
    rows = slid(0.0001, pair_s=pair_s, hysteresis_mm=hysteresis_mm, until_mm=0.004)  # forty seconds
    assert rows[:, 3].max() < 3.3


def test_a_cough_is_no_slide():
    curve, time_s = breathed(16.0, hysteresis_mm=1.0)
    departures = []
    for index in range(1, 30):
        now_s = time_s + index * PAIR_S
        cough_mm = 10.0 * np.exp(-index * PAIR_S / 0.3) if index else 0.0  # 10 mm, back within a second
        place = wave(now_s, hysteresis_mm=1.0) + 1e-3 * cough_mm * (0.3 * ASIDE + 0.95 * UP)
        found_m, odds = curve.slide(now_s, place)
        if index * PAIR_S > 1.0:
            departures.append(curve.departure_sigmas(now_s, place, SIGMA_M, curve.slide(now_s, place)))
            assert found_m < TUNING.smallest_slide_m or odds < 0.5 * 3.3**2
        curve.accept(now_s, place)
    assert max(departures) < 3.3


def test_a_patient_who_settles_down_is_no_slide():
    # By 0.8 mm in eight seconds, across the breath, and there it stays for good: no pose may be lost by that.
    curve, time_s = breathed(12.0, hysteresis_mm=1.0)
    for index in range(1, 120):
        settled_m = 1e-4 * min(index * PAIR_S, 8.0)
        place = wave(time_s + index * PAIR_S, hysteresis_mm=1.0) + settled_m * ASIDE
        slide = curve.slide(time_s + index * PAIR_S, place)
        assert slide.beyond(2e-3) == 0.0
        assert curve.departure_sigmas(time_s + index * PAIR_S, place, SIGMA_M, slide) < 3.3
        curve.accept(time_s + index * PAIR_S, place)


def test_a_cough_before_a_breath_that_is_held_is_no_slide():
    # Further than a breath goes, and aside, for two pairs; then ten seconds at rest.
    curve, time_s = breathed(8.0, pair_s=0.5, hysteresis_mm=1.0)
    random = np.random.default_rng(5)
    for index in range(1, 23):
        cough = 5e-3 * ASIDE - 9e-3 * UP if index < 3 else 0.0
        place = wave(8.0, hysteresis_mm=1.0) + cough + 4e-4 * random.normal(size=3)
        assert curve.slide(time_s + 0.5 * index, place).beyond(2e-3) < 0.05
        curve.accept(time_s + 0.5 * index, place)


@pytest.mark.parametrize("gap_s", [0.6, 1.0, 2.0, 5.0])
@pytest.mark.parametrize("hysteresis_mm", [1.0, 2.0, 3.0])
def test_breathing_after_a_gap_is_no_slide(gap_s, hysteresis_mm):
    # Hidden for a while: how fast it breathed in the meantime nobody saw.
    for phase in np.arange(0.0, 4.0, 0.5):
        curve, time_s = breathed(14.0 + phase, hysteresis_mm=hysteresis_mm)
        back = wave(time_s + gap_s, hysteresis_mm=hysteresis_mm)
        assert curve.departure_sigmas(time_s + gap_s, back, SIGMA_M, curve.slide(time_s + gap_s, back)) < 3.3


def test_what_slides_may_slide_along_the_breath_too_where_nothing_shows():
    # Half of all directions are within 60° of a line: of them 1.73 mm across or less are 2 mm of a slide.
    assert Slide(2e-3 * np.sin(np.radians(60.0)), 50.0).beyond(2e-3) == pytest.approx(0.5)
    assert Slide(3e-3, 50.0).beyond(2e-3) == pytest.approx(1.0)
    assert Slide(1e-3, 50.0).beyond(2e-3) == pytest.approx(1.0 - np.cos(np.radians(30.0)))
    assert Slide(3e-3, np.log(3.0)).beyond(2e-3) == pytest.approx(0.75)
    assert Slide(3e-3, 0.0).beyond(2e-3) == Slide(0.0, 9.0).beyond(2e-3) == 0.0
    # Counted: directions drawn at random, each with a slide of which 1 mm shows.
    directions = np.random.default_rng(0).normal(size=(100_000, 3))
    shows = np.linalg.norm(directions[:, :2], axis=1) / np.linalg.norm(directions, axis=1)
    assert np.mean(1e-3 / shows > 2e-3) == pytest.approx(Slide(1e-3, 50.0).beyond(2e-3), abs=0.003)


def test_one_outlier_is_no_slide():
    # What slides does so for a while; 2 mm from one pair to the next is no drift of the last second and a half.
    curve, time_s = breathed(30.0)
    outlier = wave(time_s + PAIR_S) + 3e-3 * ASIDE
    found_m, odds = curve.slide(time_s + PAIR_S, outlier)
    assert found_m < TUNING.smallest_slide_m or odds <= 0.0


def sliding(one_plane):
    """Odds of a slide of which every other half of a breath is seen by one plane; metres found, and true."""
    random, curve = np.random.default_rng(4), BreathingCurve(np.zeros(3), 0.0, TUNING)
    for time_s in np.arange(1, 51) * PAIR_S:
        slid_m = 0.5e-3 * max(time_s - 6.0, 0.0)
        place = wave(time_s, hysteresis_mm=1.5) + slid_m * ASIDE + 1e-4 * random.normal(size=3)
        is_whole = time_s % 4.0 < 2.0
        if is_whole:
            curve.accept(time_s, place)
        elif one_plane == "tells how fast it breathes":
            curve.see(time_s, place, is_whole=False)
        elif one_plane == "errs in depth":
            curve.see(time_s, place + 5e-3 * np.array([0.0, np.sin(9.0 * time_s), 0.0]), is_whole=False)
    found_m, odds = curve.slide(time_s + PAIR_S, wave(time_s + PAIR_S, hysteresis_mm=1.5) + slid_m * ASIDE)
    return odds, found_m, slid_m


def test_what_one_plane_shows_tells_how_fast_it_breathed_beside_a_gap():
    seen, found_m, slid_m = sliding("tells how fast it breathes")
    unseen, _, _ = sliding("is nothing")
    assert seen > unseen + 5.0  # of a gap's two neighbours nobody knows the speed, and half of the places are such
    assert found_m == pytest.approx(slid_m, rel=0.25)


def test_where_one_plane_has_it_does_not_count_for_or_against_a_slide():
    odds, found_m, slid_m = sliding("errs in depth")
    assert odds > 5.0
    assert found_m == pytest.approx(slid_m, rel=0.25)


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


def test_few_places_tell_of_no_slide():
    curve, time_s = after([wave(t) for t in np.arange(1, 6) * PAIR_S])
    assert curve.slide(time_s + PAIR_S, 5e-3 * ASIDE) == (0.0, 0.0)


def test_after_minutes_out_of_sight_nothing_tells_of_a_slide():
    curve, time_s = breathed(30.0)
    assert curve.slide(time_s + 200.0, 5e-3 * ASIDE) == (0.0, 0.0)


def test_what_is_kept_of_the_past_is_renewed_with_every_place():
    curve, time_s = breathed(30.0)
    curve.slide(time_s, wave(time_s))
    for index in range(1, 40):
        now_s = time_s + index * PAIR_S
        place = wave(now_s) + 4e-4 * index * PAIR_S * ASIDE
        curve.see(now_s, place)
        fresh = copy.copy(curve)
        fresh._past = (np.inf, -np.inf), 0.0
        assert curve.slide(now_s + PAIR_S, place) == fresh.slide(now_s + PAIR_S, place)


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


@pytest.mark.parametrize("pair_s", [0.1, 0.3])
def test_a_slide_that_is_known_stays_known_while_it_goes_on_and_while_it_stands(pair_s):
    # Half a millimetre a second for ten seconds, then nothing for ten: what is displaced is seen, and not accepted.
    curve, time_s = breathed(16.0, pair_s, hysteresis_mm=1.5, jitter_mm=0.1)
    start_s, random = time_s, np.random.default_rng(2)
    departures, slid_mm = [], []
    while time_s < start_s + 20.0:
        time_s += pair_s
        true_mm = 0.5 * min(time_s - start_s, 10.0)
        place = wave(time_s, hysteresis_mm=1.5) + 1e-3 * (true_mm * ASIDE + 0.1 * random.normal(size=3))
        found_m, _ = curve.slide(time_s, place)
        departures.append(curve.departure_sigmas(time_s, place, SIGMA_M, curve.slide(time_s, place)))
        if max(departures) < 3.3:
            curve.accept(time_s, place)
        else:
            curve.see(time_s, place)
            if 3.2 < time_s - start_s < 10.0:
                slid_mm.append((true_mm, 1e3 * found_m))
    # About where it is noticed what is found is sometimes less than the least slide, sometimes more.
    assert min(departures[round(3.2 / pair_s) :]) > 3.3
    # And how far it has gone is known as well.
    true_mm, found_mm = np.array(slid_mm).T
    np.testing.assert_allclose(found_mm, true_mm, rtol=0.2)


def test_a_slide_that_outgrows_a_small_breath_is_not_taken_for_it():
    # A jet ventilator moves the ring by 2 mm; it slides by 10 mm, which is then the direction it has moved in most.
    curve, time_s = breathed(8.0, depth_mm=2.0, period_s=1.7, jitter_mm=0.1)
    start_s, random, departures = time_s, np.random.default_rng(6), []
    while time_s < start_s + 20.0:
        time_s += PAIR_S
        slid_m = 0.5e-3 * (time_s - start_s) * np.array([0.3, 0.95, 0.0])
        place = wave(time_s, depth_mm=2.0, period_s=1.7) + slid_m + 1e-4 * random.normal(size=3)
        departures.append(curve.departure_sigmas(time_s, place, SIGMA_M, curve.slide(time_s, place)))
        if max(departures) < 3.3:
            curve.accept(time_s, place)
        else:
            curve.see(time_s, place)
    assert min(departures[round(5.0 / PAIR_S) :]) > 3.3


def test_places_nearer_in_time_than_a_heartbeat_count_as_one():
    usual, crowded = (BreathingCurve(np.zeros(3), 0.0, TUNING) for _ in range(2))
    for index in range(1, 61):
        time_s = index * PAIR_S
        place = wave(time_s, hysteresis_mm=1.5) + 0.5e-3 * max(time_s - 10.0, 0.0) * ASIDE
        usual.see(time_s, place)
        crowded.see(time_s, place)
        for later_s in (0.05, 0.1, 0.2):  # and where the heart has it meanwhile
            crowded.see(time_s + later_s, place + 2e-3 * np.sin(9.0 * (time_s + later_s)) * ASIDE)
    now_s = 61 * PAIR_S
    place = wave(now_s, hysteresis_mm=1.5) + 0.5e-3 * (now_s - 10.0) * ASIDE
    assert usual.slide(now_s, place)[1] > 5.0
    assert crowded.slide(now_s, place) == usual.slide(now_s, place)


def test_speed_and_median_are_numpys():
    random = np.random.default_rng(2)
    times = np.cumsum(0.1 + random.random(9))
    along = random.normal(size=9)
    np.testing.assert_allclose(_speed(along, np.diff(times)), np.gradient(along, times), rtol=1e-12)
    for count in (1, 2, 7, 8):
        assert _median(along[:count]) == np.median(along[:count])
