"""A breathing lasso is followed; reference, seeds and parameters may change on the way."""

import copy
import dataclasses

import numpy as np
import pytest
from support.breathing_lasso import (
    CONFIG,
    LOST,
    TRACKING,
    WARM,
    assert_no_pose,
    centre_error_mm,
    moved,
    pair,
    warm_up,
)
from support.lasso_inputs import CURVE, LOOP, PERIOD_NS, VIEWS, curve_pair, lasso_pair, lasso_seed, turned

from lasso_motion_ros.config.ring import JudgementConfig
from lasso_motion_ros.core.errors import LassoMotionError, ReconstructionError, SeedError, TrackingError
from lasso_motion_ros.evaluation.measures import centre_covariance
from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.geometry.frames import Seed
from lasso_motion_ros.ring.seat import Seat, SeatTuning
from lasso_motion_ros.ring.tracker import RingTracker


def test_the_first_pair_is_the_identity_and_the_reference():
    first = warm_up()[1][0]
    assert first.state is TRACKING
    assert first.reason == ""
    assert first.stamp_ns == first.reference_stamp_ns == 0
    np.testing.assert_array_equal(first.motion, np.eye(4))
    assert len(first.loop) >= 64
    assert 1e3 * distance_to_curve(CURVE, first.loop).mean() < 0.25


def test_breathing_is_followed_to_a_tenth_of_a_millimetre():
    errors = []
    for index, result in enumerate(warm_up()[1][1:], start=1):
        assert result.state is TRACKING
        assert result.reason == ""
        assert result.stamp_ns == index * PERIOD_NS
        assert result.reference_stamp_ns == 0
        # Half a milliradian is 0.01 mm at the ring, and what a fit to a twentieth of a pixel leaves of its tilt.
        np.testing.assert_allclose(result.motion[:3, :3], np.eye(3), atol=1e-3)
        np.testing.assert_array_equal(result.motion[3], [0.0, 0.0, 0.0, 1.0])
        errors.append(centre_error_mm(result, moved(index)))
        assert 1e3 * distance_to_curve(CURVE + moved(index), result.loop).mean() < 0.25
    assert np.mean(errors) < 0.1
    assert np.max(errors) < 0.2


def test_the_covariance_is_of_the_pose_at_the_world_origin():
    for result in warm_up()[1]:
        np.testing.assert_allclose(result.covariance, result.covariance.T, atol=1e-15)
        assert np.linalg.eigvalsh(result.covariance).min() > -1e-15
        # The rotation is held near zero: nearly its prior, a degree in 14 mm, does not move the ring's own centre.
        rotation = np.radians(70.0) ** 2 * np.sum(result.motion[:3, 3] ** 2) + np.radians(0.25) ** 2
        np.testing.assert_allclose(result.covariance[3:, 3:], rotation * np.eye(3), rtol=0.2, atol=1e-6)
        centre = LOOP.centre + result.motion[:3, 3]
        at_ring = centre_covariance(result.covariance, centre)
        at_origin = result.covariance[:3, :3]
        assert np.trace(at_ring) < np.trace(at_origin)
        assert 1e3 * np.sqrt(np.trace(at_ring)) < 0.4
        # That rotation at the ring's distance from the origin.
        lever = result.covariance[3, 3] * 2.0 * centre @ centre
        assert np.trace(at_origin) == pytest.approx(lever + np.trace(at_ring), rel=0.1)


def test_errors_lie_within_the_covariance():
    normalised, seat = [], Seat.first(SeatTuning())
    for index, result in enumerate(warm_up()[1][1:], start=1):
        error = result.motion[:3, 3] - moved(index)
        spread = centre_covariance(result.covariance, LOOP.centre + moved(index))
        if index < seat.tuning.fewest:  # it lies still on its seat; so long nothing is known of that
            spread -= seat.covariance(1e-9 * result.stamp_ns)
        normalised.append(error @ np.linalg.solve(spread, error))
    assert np.mean(np.array(normalised) < 7.8) > 0.8  # 95 % of three
    assert np.mean(normalised[: seat.tuning.fewest - 1]) > 0.05


def test_set_reference_counts_from_the_present_phase(tracker):
    before = tracker.track(pair(WARM))
    tracker.set_reference()
    after = tracker.track(pair(WARM + 1))
    assert after.state is TRACKING
    assert before.reference_stamp_ns == 0
    assert after.reference_stamp_ns == WARM * PERIOD_NS
    assert centre_error_mm(after, moved(WARM + 1), moved(WARM)) < 0.2
    # The loop is where it is, whatever the reference.
    assert 1e3 * distance_to_curve(CURVE + moved(WARM + 1), after.loop).mean() < 0.25


def test_set_reference_is_refused_where_there_is_no_phase_to_refer_to(tracker):
    with pytest.raises(TrackingError, match="seed the tracker first"):
        RingTracker(CONFIG).set_reference()
    tracker.track(lasso_pair(WARM, None))
    with pytest.raises(TrackingError, match="not being tracked"):
        tracker.set_reference()
    assert tracker.track(pair(WARM + 1)).reference_stamp_ns == 0


def test_reset_forgets_the_model(tracker):
    tracker.reset()
    with pytest.raises(TrackingError, match="seed the tracker first"):
        tracker.track(pair(WARM))
    with pytest.raises(TrackingError, match="seed the tracker first"):
        tracker.set_reference()
    assert tracker.initialise(pair(WARM + 6), lasso_seed()).reference_stamp_ns == (WARM + 6) * PERIOD_NS


def test_a_refused_seed_leaves_the_model_as_it_was(tracker):
    other = copy.deepcopy(tracker)
    away = np.array([0.020, 0.015, -0.030])  # a ring, but where there is none
    with pytest.raises(SeedError, match="no catheter is seen along the clicks"):
        tracker.initialise(pair(WARM), lasso_seed(curve=CURVE + away))
    good = lasso_seed()
    line = np.full((8, 2), 100.0) + 5.0 * np.arange(8)[:, None]
    with pytest.raises(LassoMotionError):
        tracker.initialise(pair(WARM), Seed(line, np.full((8, 2), 300.0)))
    with pytest.raises(SeedError, match="at least 6"):
        tracker.initialise(pair(WARM), Seed(good.points_a[:4], good.points_b))
    with pytest.raises(SeedError, match="lacks plane A"):
        tracker.initialise(pair(WARM, planes="b"), good)
    elsewhere = Seed(good.points_a, VIEWS["b"].project(LOOP.centre + 0.02 + 0.3 * (CURVE[::40] - LOOP.centre)))
    with pytest.raises(ReconstructionError):
        tracker.initialise(pair(WARM), elsewhere)
    here, there = tracker.track(pair(WARM)), other.track(pair(WARM))
    assert here.state is TRACKING
    assert here.reference_stamp_ns == 0
    np.testing.assert_array_equal(here.motion, there.motion)


def test_the_same_pairs_give_the_same_answers(tracker):
    other = copy.deepcopy(tracker)
    for index in range(WARM, WARM + 3):
        here, there = tracker.track(pair(index)), other.track(pair(index))
        np.testing.assert_array_equal(here.motion, there.motion)
        np.testing.assert_array_equal(here.covariance, there.covariance)
        np.testing.assert_array_equal(here.loop, there.loop)
    fresh = RingTracker(CONFIG)
    fresh.initialise(pair(0), lasso_seed())
    for index in range(1, 4):
        np.testing.assert_array_equal(fresh.track(pair(index)).motion, warm_up()[1][index].motion)


@pytest.mark.parametrize("refers", [False, True])
def test_what_it_looks_like_is_learned_after_the_answer_and_before_the_next_whenever_there_is_time(refers):
    def answers(rests):
        tracker = RingTracker(CONFIG)
        tracker.initialise(pair(0), lasso_seed())
        for index in range(1, 7):
            count = tracker.known.template.count
            yield tracker.track(pair(index)).motion
            if rests:
                assert tracker.known.template.count == count
                tracker.learn()
                assert tracker.known.template.count == count + 1
            if refers and index == 4:
                tracker.set_reference()

    np.testing.assert_array_equal([*answers(True)], [*answers(False)])


def test_a_pause_or_a_large_breath_is_no_jump(tracker):
    # Two seconds without a pair; the loop is elsewhere on its way.
    result = tracker.track(pair(WARM + 6))
    assert result.state is TRACKING
    assert centre_error_mm(result, moved(WARM + 6)) < 0.2


def test_other_limits_can_be_set_while_it_runs(tracker):
    def tilted(index):
        return curve_pair(index, turned((4.0, 0.0, 0.0)) + moved(index))

    strict = dataclasses.replace(CONFIG, judgement=JudgementConfig(degraded_turn_deg=1.0, lost_turn_deg=2.0))
    tracker.reconfigure(strict)
    assert_no_pose(tracker.track(tilted(WARM)), LOST)
    tracker.reconfigure(CONFIG)
    result = tracker.track(tilted(WARM + 1))
    assert result.state is TRACKING
    assert centre_error_mm(result, moved(WARM + 1)) < 0.2


def test_pairs_are_not_changed(tracker):
    seen = pair(WARM)
    before = seen.a.pixels.copy(), seen.b.pixels.copy()
    tracker.track(seen)
    np.testing.assert_array_equal(seen.a.pixels, before[0])
    np.testing.assert_array_equal(seen.b.pixels, before[1])


def test_a_ring_that_is_begun_with_must_show_as_much_as_is_asked(tracker):
    before = tracker.known
    with pytest.raises(SeedError, match=r"shows [\d.]+ of the ring, expected at least 9.00"):
        tracker.begin(pair(0), before.model, least_support=9.0)
    assert tracker.known is before
    assert tracker.begin(pair(0), before.model, least_support=1.0) is tracker.known
