"""The Matérn process: transitions against the matrix exponential, covariance by its fixed point."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from lasso_motion_ros.motion.matern import stationary, transition


@pytest.mark.parametrize("scale_s", [0.7, 1.5])
@pytest.mark.parametrize("interval_s", [0.0, 0.066, 0.5])
def test_the_transition_is_the_exponential_of_the_feedback(interval_s: float, scale_s: float) -> None:
    lam = np.sqrt(5.0) / scale_s
    feedback = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-(lam**3), -3.0 * lam**2, -3.0 * lam]])
    np.testing.assert_allclose(transition(interval_s, scale_s), expm(interval_s * feedback), rtol=1e-9, atol=1e-12)


def test_the_stationary_covariance_holds_under_the_feedback() -> None:
    lam = np.sqrt(5.0) / 1.2
    feedback = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-(lam**3), -3.0 * lam**2, -3.0 * lam]])
    held = stationary(1.2)
    rate = feedback @ held + held @ feedback.T
    # Noise drives the curvature alone.
    np.testing.assert_allclose(rate[:2], 0.0, atol=1e-9)
    assert rate[2, 2] < 0.0
    assert held[0, 0] == 1.0
