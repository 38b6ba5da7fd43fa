"""The bank of filters: how the heart's size is learned, how likely a measurement is, and ways that are tried."""

from dataclasses import replace

import numpy as np
import pytest
from support.respiration_inputs import DIRECTION, INTERVAL_S, RISE, SIGHT, breathing, observation, run, step

from lasso_motion_ros.geometry.covariance import largest_sigma, probability_beyond
from lasso_motion_ros.geometry.directions import half_sphere
from lasso_motion_ros.motion.motion_model import TUNING
from lasso_motion_ros.motion.respiration import RespiratoryMotion

ALIKE = replace(TUNING, heartbeats_any_way=((4e-4, 0.25),) * 4, heartbeats_one_way=())
ANY_WAY = replace(TUNING, heartbeats_one_way=())


OBLIQUE = np.array([0.5, -0.5, 0.7]) / np.linalg.norm([0.5, -0.5, 0.7])


def beating(heart_m, late_s, pairs=60, seed=0, tuning=TUNING, way=None):
    """A motion whose heart moves the ring at random, no two exposures alike, and the errors in units of the covariance.

    The heart's standard deviation, in each direction or (3,) of them, changes to nothing in the time in which one
    exposure is taken. With a way (3,) it moves to and fro on that alone.
    """
    random = np.random.default_rng(seed)

    def beats():
        if way is None:
            return random.normal(scale=heart_m, size=(2, 3))
        return random.normal(scale=heart_m, size=(2, 1)) * way

    motion = RespiratoryMotion(0.0, late_s, tuning=tuning)
    first = beats()
    if late_s == 0.0:
        first[1] = first[0]
    normalised = []
    for index in range(1, pairs + 1):
        time_s = index * INTERVAL_S
        heart = beats()
        if late_s == 0.0:
            heart[1] = heart[0]
        now = breathing(time_s) + heart[0] - first[0]
        later = breathing(time_s + late_s) - breathing(late_s) + heart[1] - first[1]
        motion.observe(time_s, a=observation("a", now, random))
        motion.observe(time_s + late_s, b=observation("b", later, random))
        error = motion.at_a.displacement - now
        normalised.append(error @ np.linalg.solve(motion.at_a.covariance, error))
        motion.learn(motion.at_a.displacement)
    return motion, np.array(normalised)


def heart(motion):
    """(3, 3) covariance of the heart's motion that was learned, m²."""
    return np.tensordot(motion.weights, motion.hearts.covariances, 1)


@pytest.mark.parametrize("late_s", [0.0, 0.15])
@pytest.mark.parametrize(("heart_mm", "least_mm", "most_mm"), [(0.0, 0.0, 0.35), (1.0, 0.6, 1.4), (2.0, 1.4, 2.5)])
def test_the_hearts_size_is_learned_from_the_measurements(heart_mm, least_mm, most_mm, late_s):
    for seed in range(3):
        motion, _ = beating(1e-3 * heart_mm, late_s, seed=seed)
        assert least_mm < 1e3 * largest_sigma(heart(motion)) < most_mm


@pytest.mark.parametrize("heart_mm", [0.0, 1.0, 2.0])
def test_the_covariance_follows_the_heart_that_was_learned(heart_mm):
    # With plane B half a frame late depth and heart are told apart only as well as that; worst where the heart goes any
    # way, as none does.
    normalised = np.concatenate([beating(1e-3 * heart_mm, 0.15, seed=seed)[1][15:] for seed in range(4)])
    assert 0.5 < np.mean(normalised) < 5.0
    assert np.mean(normalised < 7.8) > 0.8  # 95 % of three
    to_and_fro = [beating(1e-3 * heart_mm, 0.15, seed=seed, way=OBLIQUE)[1][15:] for seed in range(4)]
    assert np.mean(np.concatenate(to_and_fro) < 7.8) > 0.9


@pytest.mark.parametrize("seed", range(3))
def test_which_way_the_heart_goes_is_learned_and_tells_the_depth(seed):
    motion, _ = beating(1.6e-3, 0.15, pairs=25, seed=seed, way=OBLIQUE)
    spreads, ways = np.linalg.eigh(heart(motion))
    assert abs(ways[:, -1] @ OBLIQUE) > 0.9  # all ways were as likely before
    assert spreads[-2] < 0.3 * spreads[-1]
    blind, _ = beating(1.6e-3, 0.15, pairs=25, seed=seed, way=OBLIQUE, tuning=ANY_WAY)
    depth, blind_depth = (np.sqrt(SIGHT["a"] @ one.at_a.covariance @ SIGHT["a"]) for one in (motion, blind))
    assert depth < 0.75 * blind_depth


def test_a_heart_that_goes_all_ways_has_a_round_shape():
    motion, _ = beating(1.6e-3, 0.0)
    spreads = np.linalg.eigvalsh(heart(motion))
    assert spreads[-2] > 0.5 * spreads[-1]


def test_whichever_way_a_strong_heart_goes_the_first_poses_are_as_far_off_as_they_say():
    # From the second pair on, plane B half a frame late, before the way can be known: a filter that takes the first
    # beats for its way is surer than it may be.
    normalised = np.concatenate(
        [beating(1.4e-3, 0.15, pairs=8, seed=seed, way=way)[1][1:] for seed, way in enumerate(half_sphere(40))]
    )
    assert np.mean(normalised < 7.8) > 0.88  # 95 % of three, were hearts not mostly weaker
    assert np.mean(normalised) < 4.5


def test_what_is_seldom_but_far_off_is_more_probable_than_the_covariance_says():
    motion, _ = beating(0.0, 0.15, pairs=2)
    covariance, nothing = motion.at_a.covariance, np.zeros((3, 3))
    sigma_m = largest_sigma(covariance)
    for sigmas in (4.0, 6.0):
        assert motion.beyond(sigmas * sigma_m, nothing) > 3.0 * probability_beyond(sigmas * sigma_m, covariance)
    # All hearts alike, there is but one normal distribution; what else it may be off by counts with it.
    alike, *_ = run(6, 0.15, tuning=ALIKE)
    more = 1e-6 * np.diag([1.0, 2.0, 3.0])
    likely = probability_beyond(2e-3, alike.at_a.covariance + more)
    assert alike.beyond(2e-3, more) == pytest.approx(likely, rel=1e-6)
    # Asked of no direction, the filters have no say.
    flat = np.zeros((3, 3))
    assert alike.beyond(2e-3, more, flat) == pytest.approx(probability_beyond(2e-3, more), rel=1e-6)


def test_the_heart_across_the_breath_by_hand():
    motion, _ = beating(1.6e-3, 0.15, pairs=25, way=OBLIQUE)
    sideways = motion.heartbeat_sideways
    breath = np.linalg.eigh(motion.spread)[1][:, -1]
    np.testing.assert_allclose(breath @ sideways @ breath, 0.0, atol=1e-12)
    for across in np.linalg.svd(breath[None])[2][1:]:
        assert across @ sideways @ across == pytest.approx(across @ heart(motion) @ across)


def test_ways_that_the_heart_does_not_go_are_dropped():
    motion, _ = beating(1.6e-3, 0.15, pairs=25, way=OBLIQUE)
    assert len(motion.weights) < 0.2 * len(TUNING.hearts(0.15))
    assert np.count_nonzero(motion.hearts.is_any_way) == len(TUNING.heartbeats_any_way)  # of which any may come again
    assert motion.weights.sum() == pytest.approx(1.0)


def test_after_a_while_all_ways_are_taken_up_again_and_nothing_jumps():
    soon = replace(TUNING, heartbeat_memory_s=60 * INTERVAL_S)
    motion, _ = beating(1.6e-3, 0.15, pairs=59, tuning=soon, way=OBLIQUE)
    few, before = len(motion.hearts), motion.at_a
    assert few < 0.2 * len(TUNING.hearts(0.15))
    later = motion.later(61 * INTERVAL_S)
    later.learn(later.at_a.displacement)
    assert len(later.hearts) == len(TUNING.hearts(0.15))
    assert later.weights.sum() == pytest.approx(1.0)
    np.testing.assert_array_equal(np.sort(later.hearts.number), np.arange(len(later.hearts)))
    # The dropped ones begin where all the others have it.
    np.testing.assert_allclose(later.at_a.displacement, before.displacement, atol=1e-5)
    assert largest_sigma(later.at_a.covariance) == pytest.approx(largest_sigma(before.covariance), rel=0.2)


def test_a_heart_that_takes_another_way_while_it_is_followed_is_found_again():
    soon = replace(TUNING, heartbeat_memory_s=30 * INTERVAL_S)
    motion, _ = beating(1.6e-3, 0.0, pairs=40, tuning=soon, way=OBLIQUE)
    other = np.cross(OBLIQUE, [1.0, 0.0, 0.0])
    other /= np.linalg.norm(other)
    random = np.random.default_rng(2)
    for index in range(41, 120):
        time_s = index * INTERVAL_S
        now = breathing(time_s) + random.normal(scale=1.6e-3) * other
        motion.observe(time_s, a=observation("a", now, random), b=observation("b", now, random))
        motion.mark_a(time_s)
        motion.learn(motion.at_a.displacement)
    along = np.linalg.eigh(heart(motion))[1][:, -1]
    assert abs(along @ other) > 0.9


def test_before_any_measurement_the_heart_is_of_any_size():
    for late_s, between in ((0.0, None), (0.15, RISE)):
        weights = RespiratoryMotion(0.0, late_s, between=between).weights
        np.testing.assert_allclose(weights, TUNING.hearts(late_s).odds, atol=1e-12)


def test_what_was_learned_of_the_heart_fades():
    motion, _ = beating(0.0, 0.0)
    odds = motion.hearts.odds
    assert np.abs(motion.weights - odds).max() > 0.3
    motion.mark_a(60 * INTERVAL_S + 1000.0)
    np.testing.assert_allclose(motion.weights, odds, atol=1e-3)


def test_which_way_the_heart_went_fades_with_its_size():
    motion, _ = beating(1.6e-3, 0.0, way=OBLIQUE)
    along = np.linalg.eigh(heart(motion))[1][:, -1]
    assert abs(along @ OBLIQUE) > 0.9
    other = np.cross(OBLIQUE, [1.0, 0.0, 0.0])
    other /= np.linalg.norm(other)
    random = np.random.default_rng(1)
    for index in range(1, 40):  # the rhythm has changed while nobody looked
        time_s = 60 * INTERVAL_S + 1000.0 + index * INTERVAL_S
        now = breathing(time_s) + random.normal(scale=1.6e-3) * other
        motion.observe(time_s, a=observation("a", now, random), b=observation("b", now, random))
        motion.learn(motion.at_a.displacement)
    along = np.linalg.eigh(heart(motion))[1][:, -1]
    assert abs(along @ other) > 0.9


def test_likelihoods_by_hand():
    # Filters that are all alike are one: Student's density in two dimensions, whose peak is the normal one's.
    freedom = TUNING.freedom
    motion, *_ = run(10, 0.0, tuning=ALIKE)
    time_s = 11 * INTERVAL_S
    foreseen = motion.predict(time_s)
    for away in (np.zeros(3), np.array([0.002, -0.001, 0.004])):
        seen = observation("a", foreseen.displacement + away)
        spread = seen.across @ foreseen.covariance @ seen.across.T + seen.covariance
        off = seen.across @ away
        distance = off @ np.linalg.solve(spread, off)
        peak = -np.log(2.0 * np.pi * np.sqrt(np.linalg.det(spread)))
        likelihood = motion.copy().observe(time_s, a=seen)
        density = peak - 0.5 * (freedom + 2.0) * np.log1p(distance / freedom)
        assert likelihood == pytest.approx(density, rel=1e-6)


def test_the_likelihood_of_a_pair_is_that_of_its_planes_one_after_the_other():
    motion, *_ = run(10, 0.0)
    time_s, place = 11 * INTERVAL_S, breathing(11 * INTERVAL_S)
    both, split = motion.copy(), motion.copy()
    together = both.observe(time_s, a=observation("a", place), b=observation("b", place))
    apart = split.observe(time_s, a=observation("a", place)) + split.observe(time_s, b=observation("b", place))
    assert together == pytest.approx(apart)


def test_the_likelihood_is_greatest_where_it_was_foretold():
    motion, *_ = run(20, 0.0)
    time_s = 21 * INTERVAL_S
    densities = [
        motion.copy().observe(time_s, a=observation("a", motion.predict(time_s).displacement + 1e-3 * mm * DIRECTION))
        for mm in (0.0, 1.0, 4.0, 16.0)
    ]
    assert densities == sorted(densities, reverse=True)
    assert densities[0] - densities[-1] > 10.0


def test_a_surge_by_hand():
    motion, *_ = run(20, 0.0)
    now_s = 20 * INTERVAL_S
    here, surged = motion.predict(now_s), motion.surged().predict(now_s)
    np.testing.assert_allclose(surged.displacement, here.displacement, atol=1e-12)
    np.testing.assert_allclose(surged.covariance - here.covariance, TUNING.surge_m**2 * np.eye(3), atol=1e-12)
    # It goes on for a while, along breathing's way and hardly across; and is over in the end: breathing is what it was.
    across = np.linalg.svd(DIRECTION[None])[2][1]
    soon = motion.surged().predict(now_s + 0.3).covariance - motion.predict(now_s + 0.3).covariance
    assert DIRECTION @ soon @ DIRECTION > (2.0 * TUNING.surge_m) ** 2
    assert across @ soon @ across < 0.25 * (DIRECTION @ soon @ DIRECTION)
    long_after = now_s + 1000.0
    np.testing.assert_allclose(
        motion.surged().predict(long_after).covariance, motion.predict(long_after).covariance, rtol=1e-6, atol=1e-12
    )


def test_moved_by_hand_by_hand():
    motion, *_ = run(20, 0.0)
    now_s, reach_m = 20 * INTERVAL_S, 0.024
    moved = motion.moved_by_hand(reach_m)
    for time_s in (now_s, now_s + 1000.0):  # it stays where it was put
        before, after = motion.predict(time_s), moved.predict(time_s)
        np.testing.assert_allclose(after.displacement, before.displacement, atol=1e-12)
        np.testing.assert_allclose(after.covariance - before.covariance, reach_m**2 * np.eye(3), atol=1e-10)
    # What is seen there is followed there, and breathes on about it.
    aside = np.array([0.020, 0.012, 0.009])
    time_s = now_s + INTERVAL_S
    step(moved, time_s, 0.0, lambda t: breathing(t) + aside * (t > 0.0))
    assert np.linalg.norm(moved.at_a.displacement - breathing(time_s) - aside) < 2e-4
    ahead = moved.predict(time_s + INTERVAL_S).displacement
    assert np.linalg.norm(ahead - breathing(time_s + INTERVAL_S) - aside) < 3e-3


def test_a_way_that_is_tried_changes_nothing():
    motion, *_ = run(10, 0.15)
    before = motion.predict(4.0)
    for way in (motion.surged(), motion.moved_by_hand(0.02)):
        step(way, 11 * INTERVAL_S, 0.15, breathing)
        way.learn(way.at_a.displacement)
    after = motion.predict(4.0)
    np.testing.assert_array_equal(before.displacement, after.displacement)
    np.testing.assert_array_equal(before.covariance, after.covariance)


def test_moved_elsewhere_it_breathes_on_there():
    motion, *_ = run(30, 0.0)
    aside = np.array([0.010, 0.0, 0.0])
    before, mean = motion.predict(31 * INTERVAL_S), motion.mean
    motion.move(motion.predict(30 * INTERVAL_S).displacement + aside)
    np.testing.assert_allclose(motion.predict(31 * INTERVAL_S).displacement, before.displacement + aside, atol=1e-3)
    np.testing.assert_allclose(motion.mean, mean + aside, atol=1e-3)
