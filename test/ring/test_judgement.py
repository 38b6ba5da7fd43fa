import dataclasses

import numpy as np
import pytest
from support.method_inputs import biplane

from lasso_motion_ros.config.ring import JudgementConfig
from lasso_motion_ros.ring.judgement import BreathingEnvelope, epipolar_gap, is_clearly_seen, is_seen
from lasso_motion_ros.ring.loop_views import PlaneFit

# By name, so that the numbers below hold whatever the defaults are.
CONFIG = JudgementConfig(
    smallest_likeness=0.65,
    smallest_visible=0.6,
    full_visible=0.8,
    clear_likeness=0.8,
    largest_speed_mm_s=65.0,
    jump_allowance_mm=2.0,
    longest_jump_interval_s=1.5,
    displaced_mm=8.0,
    repeatable_mm=4.0,
    deeper_breath_mm=20.0,
    longest_breath_s=9.0,
)
GOOD = PlaneFit(np.zeros(3), np.eye(3)[:2], 1e-10 * np.eye(2), 0.2, 0.9, 1.0, 1.0, 0.1, np.zeros((1, 13), np.float32))
UP, ASIDE = np.array([0.0, 0.0, 1e-3]), np.array([1e-3, 0.0, 0.0])  # a millimetre each
INTERVAL_S = 0.3


@pytest.mark.parametrize(
    ("change", "seen", "clearly"),
    [
        ({}, True, True),
        ({"likeness": float("nan")}, False, False),
        ({"likeness": 0.8}, True, True),
        ({"likeness": 0.79}, True, False),
        ({"likeness": 0.65}, True, False),
        ({"likeness": 0.64}, False, False),
        ({"visible": 0.8}, True, True),
        ({"visible": 0.79}, True, False),
        ({"visible": 0.6}, True, False),
        ({"visible": 0.59}, False, False),
    ],
)
def test_thresholds_of_being_seen(change, seen, clearly):
    fit = dataclasses.replace(GOOD, **change)
    assert is_seen(fit, CONFIG) == seen
    assert is_clearly_seen(fit, CONFIG) == clearly


def test_epipolar_gap_by_hand():
    # Rays along x and y; their common perpendicular is z, on which the points are 3 mm apart.
    gap, across = epipolar_gap(
        np.array([2.0, 0.0, 0.0]), np.array([0.0, 0.5, 0.0]), np.zeros(3), np.array([0.7, -0.2, 0.003])
    )
    assert gap == pytest.approx(0.003)
    np.testing.assert_allclose(across, [0.0, 0.0, 1.0])


def test_epipolar_gap_does_not_depend_on_the_points_along_the_rays():
    rays = {name: -view.source for name, view in biplane().items()}
    lift = np.array([0.0, 0.0, 0.0012])
    gaps = [
        epipolar_gap(rays["a"], rays["b"], 0.1 * s * rays["a"], lift + 0.2 * t * rays["b"])[0]
        for s in (-1.0, 0.5)
        for t in (-0.3, 2.0)
    ]
    np.testing.assert_allclose(np.abs(gaps), 0.0012, rtol=1e-9)
    swapped = epipolar_gap(rays["b"], rays["a"], lift, np.zeros(3))[0]
    assert abs(swapped) == pytest.approx(0.0012)


def wave(time_s, depth_mm=12.0, period_s=4.0):
    """Breathing along the patient's axis from the first time on, (3,) metres."""
    return 0.5 * depth_mm * (1.0 - np.cos(2.0 * np.pi * time_s / period_s)) * UP


class Stream:
    """An envelope that is shown displacements in turn, as a tracker would."""

    def __init__(self, config=CONFIG, interval_s=INTERVAL_S):
        self.envelope = BreathingEnvelope(config)
        self.interval_s, self.time_s = interval_s, 0.0

    def show(self, displacement, predicted=None):
        """The judgement of the next pair; what is accepted is learned."""
        self.time_s += self.interval_s
        why = self.envelope.departure(self.time_s, displacement, displacement if predicted is None else predicted)
        if not why:
            self.envelope.accept(self.time_s, displacement)
        return why

    def breathe(self, duration_s, **of_wave):
        return [
            self.show(wave(self.time_s + self.interval_s, **of_wave))
            for _ in range(round(duration_s / self.interval_s))
        ]

    def judge(self, displacement, predicted=None, after_s=INTERVAL_S):
        """The judgement alone."""
        return self.envelope.departure(
            self.time_s + after_s, displacement, displacement if predicted is None else predicted
        )


@pytest.mark.parametrize("depth_mm", [2.0, 12.0, 40.0])
@pytest.mark.parametrize("interval_s", [0.1, 0.3, 1.0])
def test_breathing_is_believed(depth_mm, interval_s):
    stream = Stream(interval_s=interval_s)
    assert not any(stream.breathe(20.0, depth_mm=depth_mm, period_s=4.1))


def test_irregular_breathing_is_believed():
    stream = Stream()
    random = np.random.default_rng(1)
    phase, displacements = 0.0, []
    for _ in range(100):
        phase += 2.0 * np.pi * INTERVAL_S / 4.0 * random.uniform(0.7, 1.3)
        depth = 12.0 + 3.0 * np.sin(phase / 2.7)
        hysteresis = 1.2 * np.sin(phase) * ASIDE
        displacements.append(0.5 * depth * (1.0 - np.cos(phase)) * UP + hysteresis + random.normal(scale=2e-4, size=3))
    assert not any(stream.show(d) for d in displacements)


def test_jump_by_hand():
    # In 0.3 s: 65 · 0.3 + 2 = 21.5 mm.
    fresh = Stream()
    assert fresh.judge(21.4 * UP) == ""
    assert fresh.judge(21.6 * UP) == "jumped 22 mm in 0.30 s, faster than breathing"
    # In 1 s it may be 67 mm, but not from where it was at rest; after 1.5 s speed says nothing.
    assert fresh.judge(39.0 * UP, after_s=1.0) == ""
    assert fresh.judge(39.0 * UP, after_s=0.3).startswith("jumped")
    assert fresh.judge(39.0 * UP, after_s=2.0) == ""


def test_a_jump_counts_from_the_last_pair_accepted():
    stream = Stream()
    stream.breathe(1.8)  # now about 12 mm up
    here = wave(stream.time_s)
    assert stream.judge(here - 21.6 * UP).startswith("jumped")


def test_a_leap_by_hand():
    # Where the last two lead in 0.3 s, ± 140 · 0.3 · 0.3 + 2 + 3 = 17.6 mm.
    stream = Stream()
    stream.breathe(1.8)
    led = 2.0 * wave(stream.time_s) - wave(stream.time_s - INTERVAL_S)
    assert stream.judge(led - 17.5 * UP) == ""
    assert stream.judge(led - 17.7 * UP) == "18 mm from where its motion led 0.30 s before, which no breath does"


def test_before_any_motion_the_loop_may_go_four_centimetres_in_any_direction():
    stream = Stream()
    for direction in (UP, -UP, ASIDE, (UP + ASIDE) / np.sqrt(2.0)):
        assert stream.judge(39.0 * direction, after_s=2.0) == ""
        assert stream.judge(41.0 * direction, after_s=2.0) == "41 mm from where it was"


def test_in_the_first_breath_it_may_go_far_along_its_axis_only():
    stream = Stream()
    stream.breathe(1.5)  # 11 mm along the axis
    mean = 5.0 * UP
    assert stream.judge(mean + 38.0 * UP, after_s=2.0) == ""
    assert stream.judge(mean + 7.5 * ASIDE) == ""
    assert stream.judge(mean + 8.6 * ASIDE) == "9 mm off the breathing curve"
    assert stream.judge(mean + 30.0 * UP + 8.6 * ASIDE, after_s=2.0) != ""


def test_once_breaths_have_repeated_it_must_stay_near_its_curve():
    stream = Stream()
    stream.breathe(12.0)
    for height in (0.0, 6.0, 12.0):
        assert stream.judge(height * UP + 3.8 * ASIDE) == ""
        # Repeated to within nothing: 4 mm across the axis and no more.
        assert stream.judge(height * UP + 4.3 * ASIDE) == "4 mm off the breathing curve"
        assert stream.judge(height * UP - 25.0 * ASIDE, after_s=2.0) == "25 mm off the breathing curve"


def test_breaths_that_repeat_badly_allow_for_more():
    stream = Stream()
    random = np.random.default_rng(2)
    for index in range(1, 60):
        # A millimetre and a half to either side, at random.
        stream.show(wave(index * INTERVAL_S) + random.uniform(-1.5, 1.5) * ASIDE)
    assert stream.judge(6.0 * UP + 5.5 * ASIDE) == ""
    # Never more than `displaced_mm`.
    assert stream.judge(6.0 * UP + 10.0 * ASIDE).endswith("off the breathing curve")


def test_a_deeper_breath_is_believed_where_it_was_foreseen():
    stream = Stream()
    stream.breathe(12.0)
    # 15 mm beyond the deepest: along the axis and as predicted, or nearly.
    assert stream.judge(27.0 * UP, predicted=26.0 * UP, after_s=2.0) == ""
    assert stream.judge(27.0 * UP, predicted=20.0 * UP, after_s=2.0) == ""
    assert stream.judge(27.0 * UP, predicted=10.0 * UP, after_s=2.0) == "15 mm off the breathing curve"
    # A little deeper may come unforeseen, sideways with it not.
    assert stream.judge(19.0 * UP, predicted=5.0 * UP, after_s=2.0) == ""
    assert stream.judge(27.0 * UP + 5.0 * ASIDE, predicted=27.0 * UP, after_s=2.0) != ""
    # But no breath goes 20 mm beyond those before.
    assert stream.judge(33.0 * UP, predicted=33.0 * UP, after_s=2.0) == "21 mm off the breathing curve"


@pytest.mark.parametrize("speed_mm_s", [1.0, 2.0, 6.0, 25.0])
def test_a_slow_departure_is_noticed_and_does_not_carry_the_curve_along(speed_mm_s):
    # To another vein, slower than breathing, across its axis: each step is a little one.
    stream = Stream()
    stream.breathe(12.0)
    aside_mm, why = 0.0, ""
    while not why and aside_mm < 30.0:
        aside_mm += speed_mm_s * INTERVAL_S
        why = stream.show(wave(stream.time_s + INTERVAL_S) + aside_mm * ASIDE)
    assert why.endswith("off the breathing curve")
    assert aside_mm < 8.0 + speed_mm_s * INTERVAL_S + 0.5


@pytest.mark.parametrize("direction", [UP, ASIDE])
def test_a_drift_of_the_breathing_is_followed(direction):
    # 12 mm a minute, for three minutes.
    stream = Stream()
    for index in range(1, 600):
        assert stream.show(wave(index * INTERVAL_S) + 0.2 * index * INTERVAL_S * direction) == ""


def test_one_breath_is_a_whole_one_after_two_turns():
    # Up, down and on its way up again, 3 mm at the least: two turns.
    stream = Stream()
    stream.breathe(3.0)
    assert stream.judge(-15.0 * UP, predicted=10.0 * UP, after_s=2.0) == ""  # no second turn yet: anywhere on the axis
    stream.breathe(2.1)
    assert stream.judge(-15.0 * UP, predicted=10.0 * UP, after_s=2.0) == "15 mm off the breathing curve"


def test_jitter_is_no_turn():
    stream = Stream()
    random = np.random.default_rng(3)
    for index in range(1, 9):
        stream.show(1.2 * index * UP + random.normal(scale=1e-4, size=3))
        stream.show((1.2 * index - 0.8) * UP + random.normal(scale=1e-4, size=3))
    assert stream.judge(30.0 * UP, predicted=10.0 * UP, after_s=2.0) == ""


def test_a_breath_is_over_after_its_longest_time():
    # Held breath: nothing moves, and after nine seconds that is what is known.
    stream = Stream()
    for _ in range(29):
        assert stream.show(np.zeros(3)) == ""
    assert stream.judge(30.0 * UP, predicted=np.zeros(3), after_s=2.0) == ""
    for _ in range(3):
        stream.show(np.zeros(3))
    assert stream.judge(9.0 * UP, predicted=np.zeros(3)) == "9 mm off the breathing curve"


def test_what_is_refused_is_not_learned():
    stream = Stream()
    stream.breathe(12.0)
    away = 6.0 * UP + 12.0 * ASIDE
    for _ in range(20):
        assert stream.show(away) != ""
    assert stream.show(wave(stream.time_s)) == ""


def test_a_new_start_elsewhere():
    # After `set_reference` on a lasso that was moved: from there on, at that time.
    place = 25.0 * ASIDE
    envelope = BreathingEnvelope(CONFIG, place, 30.0)
    assert envelope.departure(30.3, place + 10.0 * UP, place) == ""
    assert envelope.departure(30.3, np.zeros(3), place).startswith("jumped")
    envelope.accept(30.3, place + UP)
    # The clock of the first breath starts anew.
    assert envelope.departure(33.0, place + 38.0 * UP, place) == ""


def test_input_is_not_kept():
    envelope = BreathingEnvelope(CONFIG)
    displacement = np.zeros(3)
    envelope.accept(0.3, displacement)
    displacement += 1.0
    assert envelope.departure(0.6, UP, UP) == ""


def test_memory_is_bounded():
    stream = Stream(interval_s=0.1)
    for index in range(1200):
        assert stream.show(wave(0.1 * index)) == ""
    assert len(stream.envelope._points) <= 600


def test_many_pairs_in_a_long_breath_are_judged():
    # 1500 pairs, more than are kept, in one longest breath.
    stream = Stream(dataclasses.replace(CONFIG, longest_breath_s=30.0), interval_s=0.02)
    for index in range(3000):
        assert stream.show(wave(0.02 * index, period_s=30.0)) == ""


def test_breaths_that_passed_unseen_have_taught_nothing():
    envelope = BreathingEnvelope(CONFIG)
    envelope.accept(20.0, 3.0 * UP)  # the clicks took their time; nobody has seen a breath yet
    assert envelope.departure(20.3, 13.0 * UP, 3.0 * UP) == ""
