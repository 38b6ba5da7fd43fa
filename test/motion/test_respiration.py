import numpy as np
import pytest
from support.method_inputs import biplane

from lasso_motion_ros.motion import respiration
from lasso_motion_ros.motion.respiration import (
    FREEDOM,
    HEARTBEAT_ODDS,
    SURGE_M,
    TIMES_AHEAD,
    Likelihood,
    Observation,
    RespiratoryMotion,
)

SIGHT = {name: -view.source / np.linalg.norm(view.source) for name, view in biplane().items()}
ACROSS = {name: np.linalg.svd(ray[None])[2][1:] for name, ray in SIGHT.items()}
DIRECTION = np.array([0.08, -0.25, -1.0]) / np.linalg.norm([0.08, -0.25, -1.0])
PERIOD_S, AMPLITUDE_M, INTERVAL_S = 4.0, 0.012, 0.3
SIGMA_M = 4e-5
SHAPE = np.array([[0.16, 0.0, 0.0], [0.0, 0.3, 0.25], [0.0, 0.25, 1.0]])
RISE = Observation(np.array([[0.0, 0.0, 1.0]]), np.array([0.004]), np.array([[1e-10]]))


def breathing(time_s):
    """(3,) metres from the first time on: 12 mm along a line, with a little hysteresis aside."""
    phase = 2.0 * np.pi * time_s / PERIOD_S
    along = 0.5 * AMPLITUDE_M * (1.0 - np.cos(phase + 1.0)) - 0.5 * AMPLITUDE_M * (1.0 - np.cos(1.0))
    return along * DIRECTION + 0.0005 * (np.sin(phase + 1.0) - np.sin(1.0)) * np.array([1.0, 0.0, 0.0])


def observation(plane, displacement, random=None, sigma=SIGMA_M):
    noise = np.zeros(2) if random is None else random.normal(scale=sigma, size=2)
    return Observation(ACROSS[plane], ACROSS[plane] @ displacement + noise, sigma**2 * np.eye(2))


def step(motion, time_s, late_s, moved, random=None, planes="ab"):
    """One pair: plane A at a time, plane B late, what each sees of a motion moved(time)."""
    if "a" in planes:
        motion.observe(time_s, a=observation("a", moved(time_s), random))
    motion.mark_a(time_s)
    if "b" in planes:
        # What plane B measures refers to its own first exposure.
        motion.observe(time_s + late_s, b=observation("b", moved(time_s + late_s) - moved(late_s), random))


def run(count, late_s, moved=breathing, seed=0, learn=True):
    """The filter after a number of pairs, and at each the error (3,) and the covariance, with what it knew then."""
    random = np.random.default_rng(seed)
    motion = RespiratoryMotion(0.0, late_s)
    errors, covariances = [], []
    for index in range(1, count + 1):
        step(motion, index * INTERVAL_S, late_s, moved, random)
        if learn:
            motion.learn(motion.at_a.displacement)
        errors.append(motion.at_a.displacement - moved(index * INTERVAL_S))
        covariances.append(motion.at_a.covariance)
    return motion, np.array(errors), np.array(covariances)


def test_it_starts_at_zero_exactly():
    motion = RespiratoryMotion(5.0, 5.0)
    for estimate in (motion.at_a, motion.predict(5.0)):
        np.testing.assert_allclose(estimate.displacement, 0.0, atol=1e-12)
        assert np.trace(estimate.covariance) < 1e-12


def test_planes_exposed_together_are_triangulated():
    motion = RespiratoryMotion(0.0, 0.0)
    truth = np.array([0.003, -0.004, 0.011])
    step(motion, 0.3, 0.0, lambda time_s: truth * (time_s > 0.0))
    np.testing.assert_allclose(motion.at_a.displacement, truth, atol=2e-5)
    np.testing.assert_allclose(motion.predict(0.3).displacement, truth, atol=2e-5)
    # By hand: where both planes measure alike, the variance is half of one's; along a ray only the other one sees.
    up = np.array([0.0, 0.0, 1.0])  # across both rays, since the planes turn about the patient's long axis
    assert up @ motion.at_a.covariance @ up == pytest.approx(SIGMA_M**2 / 2.0, rel=0.02)
    for ray in SIGHT.values():
        assert ray @ motion.at_a.covariance @ ray == pytest.approx(SIGMA_M**2, rel=0.02)


def test_a_sharper_plane_weighs_more():
    motion = RespiratoryMotion(0.0, 0.0)
    up = np.array([0.0, 0.0, 1.0])
    motion.observe(0.3, a=observation("a", 0.001 * up, sigma=2e-5))
    motion.mark_a(0.3)
    motion.observe(0.3, b=observation("b", 0.002 * up, sigma=4e-5))
    # (4 · 1 + 1 · 2) / 5 mm.
    assert up @ motion.at_a.displacement == pytest.approx(0.0012, abs=2e-6)


@pytest.mark.parametrize("late_s", [0.05, 0.15])
def test_exposures_of_b_bracket_those_of_a(late_s):
    _, errors, _ = run(40, late_s)
    late_mm = 1e3 * np.linalg.norm(errors[14:], axis=1)
    # After a breath; taking B for simultaneous would be 9.4 mm/s · 0.15 s = 1.4 mm off at the steepest.
    assert late_mm.mean() < 0.15
    assert late_mm.max() < 0.4
    simultaneous = [
        np.linalg.norm(breathing(t + late_s) - breathing(late_s) - breathing(t)) for t in np.arange(15, 41) * INTERVAL_S
    ]
    assert late_mm.mean() < 0.4 * 1e3 * np.mean(simultaneous)


def test_what_was_learned_sharpens_the_first_exposures():
    # In which direction the loop moved between the first two exposures shows only later.
    late_s = 0.15
    motion, _, _ = run(40, late_s)
    before = np.sqrt(np.trace(RespiratoryMotion(0.0, late_s).origin_b.covariance))
    after = np.sqrt(np.trace(motion.origin_b.covariance))
    assert after < 0.5 * before
    assert np.linalg.norm(motion.origin_b.displacement - breathing(late_s)) < min(3.0 * after, 4e-4)


def test_origins_are_the_same_where_the_planes_are_exposed_together():
    motion, _, _ = run(10, 0.0)
    np.testing.assert_allclose(motion.origin_b.displacement, 0.0, atol=1e-6)


def test_depth_is_carried_over_a_missing_plane():
    for missing, present in (("b", "a"), ("a", "b")):
        for late_s in (0.0, 0.15):
            motion, _, covariances = run(30, late_s)
            errors = []
            for index in range(31, 41):  # three seconds
                step(motion, index * INTERVAL_S, late_s, breathing, np.random.default_rng(index), planes=present)
                estimate = motion.at_a
                error = estimate.displacement - breathing(index * INTERVAL_S)
                errors.append(1e3 * np.linalg.norm(error))
                assert error @ np.linalg.solve(estimate.covariance, error) < 16.3  # 99.9 % for three
            assert np.mean(errors) < 0.8, (missing, late_s)
            # Less is known than with both, and it says so.
            assert np.trace(motion.at_a.covariance) > 2.0 * np.trace(covariances[-1])


def test_prediction_follows_the_motion():
    motion, _, _ = run(30, 0.0)
    now, ahead = 30 * INTERVAL_S, 31 * INTERVAL_S
    here, there = motion.at_a, motion.predict(ahead)
    held = np.linalg.norm(here.displacement - breathing(ahead))
    foreseen = np.linalg.norm(there.displacement - breathing(ahead))
    assert foreseen < 0.5 * held
    sizes = [np.trace(motion.predict(now + t).covariance) for t in (0.0, 0.1, 0.3, 1.0, 3.0)]
    assert sizes == sorted(sizes)


def test_far_ahead_only_the_spread_is_known():
    motion, _, _ = run(30, 0.0)
    far = motion.predict(1000.0)
    times = np.arange(0, 31) * INTERVAL_S
    seen = np.array([breathing(t) for t in times])
    # Where it has been, on the average, give or take as much as it has moved.
    assert 1e3 * np.linalg.norm(far.displacement - seen.mean(axis=0)) < 4.0
    size = np.sqrt(DIRECTION @ far.covariance @ DIRECTION)
    assert 0.5 * AMPLITUDE_M / np.sqrt(2.0) < size < 3.0 * AMPLITUDE_M / np.sqrt(2.0)


def test_prediction_changes_nothing():
    motion, _, _ = run(5, 0.1)
    before = motion.at_a.displacement, motion.at_a.covariance
    motion.predict(9.0)
    motion.expected_between(9.0)
    np.testing.assert_array_equal(motion.at_a.displacement, before[0])
    np.testing.assert_array_equal(motion.at_a.covariance, before[1])


def test_what_b_measures_is_the_displacement_since_its_own_first_exposure():
    late_s = 0.15
    motion, _, _ = run(20, late_s)
    time_s = 20 * INTERVAL_S + late_s
    between = motion.expected_between(time_s)
    np.testing.assert_allclose(between.displacement, breathing(time_s) - breathing(late_s), atol=3e-4)
    np.testing.assert_allclose(
        between.displacement, motion.predict(time_s).displacement - motion.origin_b.displacement, atol=1e-12
    )


def test_the_spread_is_learned_along_the_motion():
    motion, _, _ = run(30, 0.0)
    values, axes = np.linalg.eigh(motion.spread)
    assert abs(axes[:, -1] @ DIRECTION) > 0.99
    # A sinusoid of 12 mm has a standard deviation of 4.2 mm.
    assert 1e3 * np.sqrt(values[-1]) == pytest.approx(12.0 / np.sqrt(8.0), rel=0.3)
    assert 1e3 * np.sqrt(values[0]) < 1.5
    times = np.arange(0, 31) * INTERVAL_S  # the reference's zero counts, too
    np.testing.assert_allclose(motion.mean, np.mean([breathing(t) for t in times], axis=0), atol=5e-5)


def test_before_anything_is_learned_every_direction_is_open():
    values = np.linalg.eigvalsh(RespiratoryMotion(0.0, 0.0).spread)
    assert values[0] == pytest.approx(values[-1])
    assert 0.005 < np.sqrt(values[0]) < 0.02


def test_a_copy_is_independent():
    motion, _, _ = run(6, 0.15)
    other, twin = motion.copy(), motion.copy()
    before = motion.at_a
    step(other, 7 * INTERVAL_S, 0.15, breathing)
    other.learn(other.at_a.displacement)
    np.testing.assert_array_equal(motion.at_a.displacement, before.displacement)
    np.testing.assert_array_equal(motion.at_a.covariance, before.covariance)
    # And what the original then does is what it would have done without the copy.
    step(motion, 7 * INTERVAL_S, 0.15, breathing)
    motion.learn(motion.at_a.displacement)
    np.testing.assert_array_equal(motion.at_a.displacement, other.at_a.displacement)
    np.testing.assert_array_equal(motion.spread, other.spread)
    np.testing.assert_array_equal(twin.at_a.displacement, before.displacement)


def test_results_do_not_alias_the_state():
    motion, _, _ = run(3, 0.0)
    before = motion.at_a.displacement.copy(), motion.mean.copy()
    motion.at_a.displacement[:] = 7.0
    motion.at_a.covariance[:] = 7.0
    motion.mean[:] = 7.0
    np.testing.assert_array_equal(motion.at_a.displacement, before[0])
    np.testing.assert_array_equal(motion.mean, before[1])


@pytest.mark.parametrize("late_s", [0.0, 0.15])
def test_covariances_stay_positive_and_symmetric(late_s):
    motion, _, covariances = run(60, late_s)
    for covariance in (*covariances, motion.predict(30.0).covariance, motion.expected_between(30.0).covariance):
        np.testing.assert_allclose(covariance, covariance.T, atol=1e-15)
        assert np.linalg.eigvalsh(covariance)[0] > 0.0


@pytest.mark.parametrize("late_s", [0.0, 0.15])
def test_covariance_fits_the_errors(late_s):
    normalised = []
    for seed in range(4):
        _, errors, covariances = run(30, late_s, seed=seed)
        normalised += [e @ np.linalg.solve(c, e) for e, c in zip(errors, covariances, strict=True)]
    # Three on the average for a perfect model; the motion here is smoother than the process allows.
    assert 0.2 < np.mean(normalised) < 4.5
    assert np.mean(np.array(normalised) < 7.8) > 0.9  # 95 % of three
    if late_s == 0.0:
        assert np.mean(normalised) == pytest.approx(3.0, rel=0.35)


def test_the_same_observations_give_the_same_state():
    first, second = run(12, 0.15)[0], run(12, 0.15)[0]
    np.testing.assert_array_equal(first.at_a.displacement, second.at_a.displacement)
    np.testing.assert_array_equal(first.at_a.covariance, second.at_a.covariance)


def test_observations_at_one_time_are_taken_together():
    # Plane B first, or later by nothing: the same.
    both, split = RespiratoryMotion(0.0, 0.0), RespiratoryMotion(0.0, 0.0)
    truth = np.array([0.003, -0.004, 0.011])
    both.observe(0.3, a=observation("a", truth), b=observation("b", truth))
    both.mark_a(0.3)
    split.observe(0.3, a=observation("a", truth))
    split.mark_a(0.3)
    split.observe(0.3, b=observation("b", truth))
    np.testing.assert_allclose(both.at_a.displacement, split.at_a.displacement, atol=1e-9)
    np.testing.assert_allclose(both.at_a.covariance, split.at_a.covariance, rtol=1e-3, atol=1e-13)


def test_what_was_foreseen_is_not_kept_once_more_is_known():
    motion, *_ = run(5, 0.02)
    later = 6 * INTERVAL_S
    before, other = motion.predict(later), motion.copy()
    step(other, later, 0.02, breathing)
    np.testing.assert_array_equal(motion.predict(later).displacement, before.displacement)
    assert np.trace(other.predict(later + 0.05).covariance) < np.trace(motion.predict(later + 0.05).covariance)
    other = motion.copy()
    other.learn(np.array([0.0, 0.0, 0.03]))
    assert np.trace(other.predict(later).covariance) != np.trace(before.covariance)
    np.testing.assert_array_equal(motion.predict(later).covariance, before.covariance)


def test_of_what_was_foreseen_little_is_kept():
    # A lasso that stays away is asked after at ever new times, for hours.
    motion, *_ = run(5, 0.02)
    for step in range(100):
        motion.predict(2.0 + 0.3 * step)
    assert len(motion._ahead) <= TIMES_AHEAD
    again = motion.copy().predict(2.3)
    np.testing.assert_array_equal(motion.predict(2.3).covariance, again.covariance)


@pytest.mark.parametrize("scale_s", [0.03, 1.0])
def test_whatever_the_time_scale_the_future_has_a_positive_covariance(scale_s, monkeypatch):
    monkeypatch.setattr(respiration, "TIME_SCALE_S", scale_s)
    motion = RespiratoryMotion(0.0, 0.05)
    for interval_s in (0.01, 0.07, 0.13):
        covariance = motion.predict(0.05 + interval_s).covariance
        assert np.linalg.eigvalsh(covariance).min() > 0.0
        assert np.sqrt(np.trace(covariance)) < 0.03


def test_what_is_seen_along_the_body_tells_the_depth_before_any_breath(monkeypatch):
    # Of a still heart: what a heartbeat may have risen tells no depth, and takes a sixth of it.
    beating = RespiratoryMotion(0.0, 0.15, shape=SHAPE, between=RISE).origin_b
    assert 0.7e-3 < beating.displacement[1] < 0.95e-3
    monkeypatch.setattr(respiration, "HEARTBEATS_M", np.full(respiration.FILTERS, 1e-4))
    told = RespiratoryMotion(0.0, 0.15, shape=SHAPE, between=RISE).origin_b
    np.testing.assert_allclose(told.displacement, [0.0, 0.001, 0.004], atol=1e-4)
    untold = RespiratoryMotion(0.0, 0.15, shape=SHAPE).origin_b
    assert told.covariance[2, 2] < 1e-9 < untold.covariance[2, 2]
    # Of 4 mm along the body a quarter, give or take what the shape leaves open.
    open_share = np.sqrt((0.3 - 0.25**2) / 0.3)
    assert np.sqrt(told.covariance[1, 1] / untold.covariance[1, 1]) == pytest.approx(open_share, rel=0.05)


def test_a_direction_that_has_been_seen_outweighs_the_one_expected():
    expected = np.array([0.0, -0.26, -1.0])
    motion = RespiratoryMotion(0.0, 0.0, shape=np.outer(expected, expected) + 0.05 * np.eye(3))
    other = np.array([0.0, 1.0, -1.0]) / np.sqrt(2.0)
    for millimetres in (2.0, 5.0, 9.0, 12.0, 8.0, 3.0):
        motion.learn(1e-3 * millimetres * other)
    main = np.linalg.eigh(motion.spread)[1][:, -1]
    assert abs(main @ other) > 0.99


def beating(heart_m, late_s, pairs=60, seed=0):
    """A motion whose heart moves the ring at random, no two exposures alike, and the errors in units of the covariance.

    The heart's standard deviation (in each direction) changes to nothing in the time in which one exposure is taken.
    """
    random = np.random.default_rng(seed)
    motion = RespiratoryMotion(0.0, late_s)
    first = random.normal(scale=heart_m, size=(2, 3))
    if late_s == 0.0:
        first[1] = first[0]
    normalised = []
    for index in range(1, pairs + 1):
        time_s = index * INTERVAL_S
        heart = random.normal(scale=heart_m, size=(2, 3))
        if late_s == 0.0:
            heart[1] = heart[0]
        now = breathing(time_s) + heart[0] - first[0]
        later = breathing(time_s + late_s) - breathing(late_s) + heart[1] - first[1]
        motion.observe(time_s, a=observation("a", now, random))
        motion.mark_a(time_s)
        motion.observe(time_s + late_s, b=observation("b", later, random))
        error = motion.at_a.displacement - now
        normalised.append(error @ np.linalg.solve(motion.at_a.covariance, error))
        motion.learn(motion.at_a.displacement)
    return motion, np.array(normalised)


@pytest.mark.parametrize("late_s", [0.0, 0.15])
@pytest.mark.parametrize(("heart_mm", "least_mm", "most_mm"), [(0.0, 0.0, 0.35), (1.0, 0.6, 1.4), (2.0, 1.4, 2.5)])
def test_the_hearts_size_is_learned_from_the_measurements(heart_mm, least_mm, most_mm, late_s):
    for seed in range(3):
        motion, _ = beating(1e-3 * heart_mm, late_s, seed=seed)
        assert least_mm < 1e3 * motion.heartbeat_m < most_mm


@pytest.mark.parametrize("heart_mm", [0.0, 1.0, 2.0])
def test_the_covariance_follows_the_heart_that_was_learned(heart_mm):
    # With plane B half a frame late depth and heart are told apart only as well as that.
    normalised = np.concatenate([beating(1e-3 * heart_mm, 0.15, seed=seed)[1][15:] for seed in range(4)])
    assert 0.5 < np.mean(normalised) < 4.5
    assert np.mean(normalised < 7.8) > 0.88  # 95 % of three


def test_before_any_measurement_the_heart_is_of_any_size():
    np.testing.assert_allclose(RespiratoryMotion(0.0, 0.0).weights, HEARTBEAT_ODDS, atol=1e-12)
    np.testing.assert_allclose(RespiratoryMotion(0.0, 0.15, between=RISE).weights, HEARTBEAT_ODDS, atol=1e-12)


def test_what_was_learned_of_the_heart_fades():
    motion, _ = beating(0.0, 0.0)
    learned = motion.weights
    assert np.abs(learned - HEARTBEAT_ODDS).max() > 0.3
    motion.mark_a(60 * INTERVAL_S + 1000.0)
    np.testing.assert_allclose(motion.weights, HEARTBEAT_ODDS, atol=1e-3)


def test_likelihoods_by_hand(monkeypatch):
    # Filters that are all alike are one: Student's density in two dimensions, whose peak is the normal one's.
    monkeypatch.setattr(respiration, "HEARTBEATS_M", np.full(respiration.FILTERS, 4e-4))
    motion, *_ = run(10, 0.0)
    time_s = 11 * INTERVAL_S
    foreseen = motion.predict(time_s)
    for away in (np.zeros(3), np.array([0.002, -0.001, 0.004])):
        seen = observation("a", foreseen.displacement + away)
        spread = seen.across @ foreseen.covariance @ seen.across.T + seen.covariance
        off = seen.across @ away
        distance = off @ np.linalg.solve(spread, off)
        peak = -np.log(2.0 * np.pi * np.sqrt(np.linalg.det(spread)))
        likelihood = motion.copy().observe(time_s, a=seen)
        assert likelihood.peak == pytest.approx(peak, rel=1e-6)
        assert likelihood.density == pytest.approx(
            peak - 0.5 * (FREEDOM + 2.0) * np.log1p(distance / FREEDOM), rel=1e-6
        )


def test_the_likelihood_of_a_pair_is_that_of_its_planes_one_after_the_other():
    motion, *_ = run(10, 0.0)
    time_s, place = 11 * INTERVAL_S, breathing(11 * INTERVAL_S)
    both, split = motion.copy(), motion.copy()
    together = both.observe(time_s, a=observation("a", place), b=observation("b", place))
    apart = split.observe(time_s, a=observation("a", place)) + split.observe(time_s, b=observation("b", place))
    assert together.density == pytest.approx(apart.density)
    assert together.peak == pytest.approx(apart.peak)
    assert Likelihood(1.0, 2.0) + Likelihood(0.5, 0.25) == Likelihood(1.5, 2.25)


def test_the_likelihood_is_greatest_where_it_was_foretold():
    motion, *_ = run(20, 0.0)
    time_s = 21 * INTERVAL_S
    densities = [
        motion.copy().observe(time_s, a=observation("a", motion.predict(time_s).displacement + 1e-3 * mm * DIRECTION))
        for mm in (0.0, 1.0, 4.0, 16.0)
    ]
    assert [one.density for one in densities] == sorted((one.density for one in densities), reverse=True)
    for one in densities:
        assert one.density <= one.peak + 1e-9


def test_a_surge_by_hand():
    motion, *_ = run(20, 0.0)
    now_s = 20 * INTERVAL_S
    here, surged = motion.predict(now_s), motion.surged().predict(now_s)
    np.testing.assert_allclose(surged.displacement, here.displacement, atol=1e-12)
    np.testing.assert_allclose(surged.covariance - here.covariance, SURGE_M**2 * np.eye(3), atol=1e-12)
    # It goes on for a while, and is over in the end: breathing is what it was.
    soon, never = (np.trace(m.predict(now_s + 0.3).covariance) for m in (motion.surged(), motion))
    assert soon > never + 3.0 * (2.0 * SURGE_M) ** 2
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
