"""What of the ring's turning is taken for the atrium's: what repeats with the breath, on strong evidence only."""

import numpy as np
import pytest

from lasso_motion_ros.breathing_rotation import STRONG_EVIDENCE, BreathingRotation

AXIS = np.array([0.6, 0.0, 0.8])
DIRECTION = np.array([0.0, 0.28, 0.96])


def learned(pairs, slope_deg_per_mm=0.0, own_deg=0.0, noise_deg=0.0, seed=0):
    """What was learned at 3.7 pairs/s of breaths of 4 s and 14 mm, the heart at 71 a minute."""
    random = np.random.default_rng(seed)
    rotation = BreathingRotation()
    for time_s in 0.27 * np.arange(pairs):
        depth_mm = 14.0 * np.sin(np.pi * time_s / 4.0) ** 4
        beat = 2.0 * np.pi * time_s / 0.85
        own = own_deg * np.sin(beat) * np.array([1.0, 0.0, 0.0]) + noise_deg * random.normal(size=3)
        turn = np.radians(slope_deg_per_mm * depth_mm * AXIS + own)
        rotation.learn(1e-3 * depth_mm * DIRECTION, turn, 0.02 * np.sin(beat + 1.0))
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
    assert rotation.evidence < 0.0
    found = rotation.between(np.zeros(3), 0.014 * DIRECTION)
    np.testing.assert_array_equal(found.vector, np.zeros(3))
    # Held at zero, it has its prior's variance: 0.07 deg/mm and what does not follow the breath.
    assert np.degrees(np.sqrt(found.covariance[1, 1])) == pytest.approx(np.hypot(0.07 * 14.0, 0.25))


def test_the_heartbeat_delays_the_evidence():
    def pairs_needed(own_deg):
        counts = (n for n in range(10, 120) if learned(n, 0.14, own_deg, 0.3).evidence >= STRONG_EVIDENCE)
        return next(counts)

    assert 10 < pairs_needed(0.5) < pairs_needed(2.0) < 60


def test_before_ten_pairs_nothing_is_said():
    assert learned(9, slope_deg_per_mm=0.3).evidence == 0.0
    assert learned(10, slope_deg_per_mm=0.3).evidence > STRONG_EVIDENCE
