"""The compiled breathing curve against the plain one."""

from __future__ import annotations

import numpy as np
import pytest

from lasso_motion_ros.core.compiled import has_kernels, plain
from lasso_motion_ros.ring.breathing_curve import BreathingCurve, CurveTuning, _principal_axis

pytestmark = pytest.mark.skipif(not has_kernels(), reason="the extra `fast` is not installed")


@pytest.mark.parametrize("seed", range(8))
def test_a_breath_is_followed_alike(seed: int) -> None:
    """Before and after the first breath is complete; places on it, beyond its ends and beside it."""
    generator = np.random.default_rng(seed)
    compiled, plainly = (BreathingCurve(np.zeros(3), 0.0, CurveTuning()) for _ in range(2))
    ways = generator.normal(size=(2, 3)) * [[8e-3], [1e-3]]
    complete = 0
    for number in range(1, 60):
        time_s = number * 0.25
        place = ways.T @ [np.sin(1.5 * time_s), np.cos(1.5 * time_s) - 1.0] + generator.normal(size=3) * 2e-4
        asked = place + generator.normal(size=3) * generator.choice([1e-4, 1e-2])
        off = compiled.distance_sigmas(time_s, asked, 3e-4)
        compiled.accept(time_s, place)
        with plain():
            assert off == pytest.approx(plainly.distance_sigmas(time_s, asked, 3e-4), rel=1e-9, abs=1e-9)
            plainly.accept(time_s, place)
        assert compiled.is_complete == plainly.is_complete
        assert compiled.sigma_m == pytest.approx(plainly.sigma_m, rel=1e-9)
        complete += compiled.is_complete
    assert 10 < complete < 59


@pytest.mark.parametrize("count", [1, 2, 3, 50])
def test_the_direction_of_places_is_the_same(count: int) -> None:
    points = np.random.default_rng(count).normal(size=(count, 3)) * [0.009, 0.002, 0.001]
    axis, spread = _principal_axis(points)
    with plain():
        plain_axis, plain_spread = _principal_axis(points)
    assert abs(axis @ plain_axis) == pytest.approx(1.0, abs=1e-12)
    assert spread == pytest.approx(plain_spread, rel=1e-9)
