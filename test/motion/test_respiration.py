"""The filter in time: what two planes' exposures, taken at different times, tell of one displacement."""

import numpy as np
import pytest
from support.respiration_inputs import INTERVAL_S, SIGHT, SIGMA_M, breathing, observation, run, step

from lasso_motion_ros.motion.heartbeat import Beats
from lasso_motion_ros.motion.motion_model import Estimate
from lasso_motion_ros.motion.respiration import RespiratoryMotion


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


def test_a_surprise_is_what_no_breath_explains():
    motion, _, _ = run(20, 0.0)
    later_s = 21 * INTERVAL_S
    foretold, surely = motion.predict(later_s), 1e-12 * np.eye(3)
    breath = np.linalg.eigh(motion.spread)[1][:, -1]
    deep = Estimate(foretold.displacement + 0.030 * breath, surely)
    assert motion.sideways_sigmas(later_s, deep) == pytest.approx(0.0, abs=1e-3)
    # By hand: C w / √(wᵀ C w) is one standard deviation away, and nothing of it along the breath, if w is across.
    across = np.cross(breath, [1.0, 0.0, 0.0])
    sigma = foretold.covariance @ across / np.sqrt(across @ foretold.covariance @ across)
    aside = Estimate(foretold.displacement + 5.0 * sigma + 0.010 * breath, surely)
    assert motion.sideways_sigmas(later_s, aside) == pytest.approx(5.0, rel=1e-3)
    vague = Estimate(aside.displacement, 3.0 * foretold.covariance)
    assert motion.sideways_sigmas(later_s, vague) == pytest.approx(2.5, rel=1e-3)


def test_the_same_motion_later_foretells_the_same():
    motion, _, _ = run(20, 0.05)
    time_s = 20 * INTERVAL_S
    later = motion.later(time_s + 0.2)
    for one, other in ((motion, later), (motion.later(time_s + 0.1), later)):
        a, b = one.predict(time_s + 0.5), other.predict(time_s + 0.5)
        np.testing.assert_allclose(a.displacement, b.displacement, atol=1e-12)
        np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-9, atol=1e-18)


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
    split.observe(0.3, a=observation("a", truth))
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


@pytest.mark.parametrize("has_peaks", [False, True])
def test_what_is_foreseen_is_what_is_there_later(has_peaks):
    motion, *_ = run(5, 0.02)
    now = motion._time_s
    beats = Beats.of(now + 0.8 * np.arange(-3.0, 1.0)) if has_peaks else None
    motion = motion.hearing(beats).later(now + 0.1)
    assert motion.beats == beats
    for later_s in (0.2, 0.7, 4.0):  # where R peaks tell the phase, and where they no longer do
        later = motion.later(now + later_s)
        if (later.beats is None) == (beats is None):
            later._weigh(motion._log_weights)  # what was learned of the heart does not fade before it is asked for
        for at_once, foretell in zip(
            motion.copy().foresee(now + later_s, now + later_s),
            (RespiratoryMotion.predict, RespiratoryMotion.expected_between),
            strict=True,
        ):
            apart = foretell(motion, now + later_s)
            np.testing.assert_allclose(at_once.displacement, apart.displacement, atol=1e-12)
            np.testing.assert_allclose(at_once.covariance, apart.covariance, rtol=1e-9, atol=1e-15)
            foreseen, there = foretell(motion, now + later_s), foretell(later, now + later_s)
            np.testing.assert_allclose(foreseen.displacement, there.displacement, atol=1e-12)
            np.testing.assert_allclose(foreseen.covariance, there.covariance, rtol=1e-9, atol=1e-15)
