"""The compiled distances between curves against the plain version."""

from __future__ import annotations

import numpy as np
import pytest

from lasso_motion_ros.core.compiled import has_kernels, plain
from lasso_motion_ros.geometry.curves import distance_to_curve

pytestmark = pytest.mark.skipif(not has_kernels(), reason="the extra `fast` is not installed")


@pytest.mark.parametrize("seed", range(20))
def test_points_are_as_far_from_a_curve(seed: int) -> None:
    generator = np.random.default_rng(seed)
    dimensions, count = 2 + seed % 2, int(generator.integers(2, 200))
    curve = np.cumsum(generator.normal(size=(count, dimensions)), axis=0)
    curve[generator.integers(count)] = curve[generator.integers(count)]  # a step of no length, now and then
    points = curve[generator.integers(count, size=50)] + generator.normal(size=(50, dimensions))
    compiled = distance_to_curve(points, curve)
    with plain():
        # Which segment is the nearest is asked in single precision there.
        np.testing.assert_allclose(compiled, distance_to_curve(points, curve), rtol=1e-5, atol=1e-6)
    assert compiled.max() > 0.1
