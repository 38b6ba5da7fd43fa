"""What of the ring's turning is taken for the atrium's: what repeats with the breath, as far as it is probable."""

import numpy as np
import pytest

from lasso_motion_ros.motion.breathing_rotation import BreathingRotation

AXIS = np.array([0.6, 0.0, 0.8])
DIRECTION = np.array([0.0, 0.28, 0.96])


def learned(pairs, slope_deg_per_mm=0.0, own_deg=0.0, noise_deg=0.0, seed=0, period_s=0.27):
    """What was learned at 3.7 pairs/s of breaths of 4 s and 14 mm, the heart at 71 a minute."""
    random = np.random.default_rng(seed)
    rotation = BreathingRotation()
    for time_s in period_s * np.arange(pairs):
        depth_mm = 14.0 * np.sin(np.pi * time_s / 4.0) ** 4
        beat = 2.0 * np.pi * time_s / 0.85
        own = own_deg * np.sin(beat) * np.array([1.0, 0.0, 0.0]) + noise_deg * random.normal(size=3)
        turn = np.radians(slope_deg_per_mm * depth_mm * AXIS + own)
        rotation.learn(time_s, 1e-3 * depth_mm * DIRECTION, turn, 0.02 * np.sin(beat + 1.0))
    return rotation


def test_a_rotation_that_goes_with_the_breath_is_found():
    found = learned(60, slope_deg_per_mm=0.14, noise_deg=0.3).between(np.zeros(3), 0.014 * DIRECTION)
    # 0.14 deg/mm at 14 mm are 1.96 degrees.
    np.testing.assert_allclose(np.degrees(found.vector), 1.96 * AXIS, atol=0.1)
    assert np.degrees(np.sqrt(np.diag(found.covariance))) == pytest.approx([0.3] * 3, abs=0.1)


def test_it_counts_from_the_reference():
    rotation = learned(60, slope_deg_per_mm=0.14)
    there = rotation.between(0.005 * DIRECTION, 0.009 * DIRECTION).vector
    back = rotation.between(0.009 * DIRECTION, 0.005 * DIRECTION).vector
    np.testing.assert_allclose(np.degrees(there), 0.56 * AXIS, atol=0.03)
    np.testing.assert_array_equal(there, -back)


@pytest.mark.parametrize("seed", range(10))
def test_a_ring_that_tilts_by_itself_turns_no_atrium(seed):
    rotation = learned(150, own_deg=2.0, noise_deg=0.5, seed=seed)
    assert rotation.probability < 0.05
    found = rotation.between(np.zeros(3), 0.014 * DIRECTION)
    assert np.degrees(np.linalg.norm(found.vector)) < 0.02
    # Held at zero, it has its prior's variance: 0.07 deg/mm and what does not follow the breath.
    assert np.degrees(np.sqrt(found.covariance[1, 1])) == pytest.approx(np.hypot(0.07 * 14.0, 0.25), rel=0.03)


def test_the_heartbeat_delays_the_evidence():
    def pairs_needed(own_deg):
        return next(n for n in range(5, 120) if learned(n, 0.14, own_deg, 0.3).probability >= 0.95)

    assert 5 < pairs_needed(0.5) < pairs_needed(2.0) < 60


def test_what_is_as_probable_as_not_is_taken_half():
    """The mean over both models, and the variance of a mixture: p C + p (1 - p) s sᵀ, and the prior's for the rest."""
    count = min(range(3, 60), key=lambda n: abs(learned(n, 0.14, 2.0, 0.3).probability - 0.5))
    rotation = learned(count, 0.14, 2.0, 0.3)
    p = rotation.probability
    assert 0.2 < p < 0.8
    fit = rotation._fit
    moved = 0.01 * fit.axis
    slope = 0.01 * fit.slope
    found = rotation.between(np.zeros(3), moved)
    np.testing.assert_allclose(found.vector, p * slope)
    prior = np.radians(0.7) ** 2 * np.eye(3)
    within = 1e-4 * fit.slope_covariance + (1.0 - p) * np.outer(slope, slope)
    np.testing.assert_allclose(
        found.covariance, p * within + (1.0 - p) * prior + np.radians(0.25) ** 2 * np.eye(3), rtol=1e-9
    )


@pytest.mark.parametrize("pairs", [0, 1])
def test_before_two_pairs_nothing_is_said(pairs):
    rotation = learned(pairs, slope_deg_per_mm=0.14)
    assert rotation.probability == 0.5
    found = rotation.between(np.zeros(3), 0.014 * DIRECTION)
    np.testing.assert_array_equal(found.vector, np.zeros(3))
    variance = np.radians(0.98) ** 2 + np.radians(0.25) ** 2
    np.testing.assert_allclose(found.covariance, variance * np.eye(3), rtol=1e-12)


def test_across_the_breath_nothing_is_known():
    across = np.array([0.014, 0.0, 0.0])
    found = learned(60, slope_deg_per_mm=0.14, noise_deg=0.3).between(np.zeros(3), across)
    assert np.degrees(np.linalg.norm(found.vector)) < 0.05
    assert np.degrees(np.sqrt(found.covariance[0, 0])) == pytest.approx(np.hypot(0.98, 0.25), rel=0.01)


def test_pairs_of_the_same_heartbeat_count_for_less():
    """Four times as many pairs of the same four seconds are hardly more evidence."""
    few = learned(15, own_deg=1.5, slope_deg_per_mm=0.05, period_s=0.28)
    many = learned(60, own_deg=1.5, slope_deg_per_mm=0.05, period_s=0.07)
    odds = [np.log(one.probability / (1.0 - one.probability)) for one in (few, many)]
    assert odds[1] == pytest.approx(odds[0], abs=0.5)


def test_the_pose_does_not_jump_as_the_evidence_grows():
    """At the depth of a breath, from pair to pair."""
    turned = [learned(n, 0.14, 1.0, 0.3).between(np.zeros(3), 0.01 * DIRECTION).vector for n in range(1, 61)]
    steps = np.degrees(np.linalg.norm(np.diff(turned, axis=0), axis=1))
    assert steps.max() < 0.6
    assert np.degrees(np.linalg.norm(turned[-1])) == pytest.approx(1.4, abs=0.15)
