"""The damped oscillator: transitions against the matrix exponential, covariance by its fixed point."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from lasso_motion_ros.motion.oscillator import stationary, transition

DAMPING_PER_S, TURNING_RAD_S = 3.0, 7.0
FEEDBACK = np.array([[0.0, 1.0], [-(DAMPING_PER_S**2) - TURNING_RAD_S**2, -2.0 * DAMPING_PER_S]])


@pytest.mark.parametrize("interval_s", [0.0, 0.066, 0.5])
def test_the_transition_is_the_exponential_of_the_feedback(interval_s: float) -> None:
    found = transition(interval_s, DAMPING_PER_S, TURNING_RAD_S)
    np.testing.assert_allclose(found, expm(interval_s * FEEDBACK), rtol=1e-9, atol=1e-12)


def test_the_stationary_covariance_holds_under_the_feedback() -> None:
    held = stationary(DAMPING_PER_S, TURNING_RAD_S)
    rate = FEEDBACK @ held + held @ FEEDBACK.T
    # Noise drives the speed alone.
    np.testing.assert_allclose([rate[0, 0], rate[0, 1]], 0.0, atol=1e-9)
    assert rate[1, 1] < 0.0
    assert held[0, 0] == 1.0


def test_a_value_is_smooth_at_first_and_swings_back() -> None:
    correlation = [transition(interval_s, DAMPING_PER_S, TURNING_RAD_S)[0, 0] for interval_s in (0.0, 0.01, 0.02, 0.45)]
    assert correlation[0] == 1.0
    # It falls off with the square of the interval, not in proportion to it.
    assert (1.0 - correlation[2]) / (1.0 - correlation[1]) == pytest.approx(4.0, rel=0.1)
    assert correlation[3] < -0.1
