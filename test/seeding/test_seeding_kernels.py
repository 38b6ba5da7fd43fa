"""The compiled walk and ways of a seed against the plain versions: the same to the last bit."""

from __future__ import annotations

import numpy as np
import pytest

from lasso_motion_ros.core.compiled import has_kernels, plain
from lasso_motion_ros.seeding import loop_outline, minimal_path

pytestmark = pytest.mark.skipif(not has_kernels(), reason="the extra `fast` is not installed")


@pytest.mark.parametrize("seed", range(20))
def test_a_walk_goes_the_same_way(seed: int) -> None:
    generator = np.random.default_rng(seed)
    rows, columns = np.mgrid[:40, :60]
    goal, start = generator.uniform(5.0, 35.0, 2), generator.uniform([30.0, 5.0], [59.0, 39.0])
    arrival = np.hypot(columns - goal[0], rows - goal[1]) + generator.choice([0.0, 0.3, 3.0]) * generator.random(
        (40, 60)
    )
    compiled = minimal_path._descend(arrival, start, goal)
    with plain():
        plainly = minimal_path._descend(arrival, start, goal)
    assert (compiled is None) == (plainly is None)
    if plainly is not None:
        np.testing.assert_array_equal(compiled, plainly)


def test_a_walk_on_level_ground_ends() -> None:
    assert minimal_path._descend(np.ones((20, 20)), np.array([15.0, 15.0]), np.array([3.0, 3.0])) is None


@pytest.mark.parametrize("seed", range(20))
def test_outlines_go_round_their_ellipse_alike(seed: int) -> None:
    generator = np.random.default_rng(seed)
    cost = generator.random((int(generator.integers(2, 40)), 1 + seed % 2, 2, 48))
    if seed % 3 == 0:  # many that are alike
        cost = np.round(4.0 * cost)
    compiled = loop_outline._cheapest_ways(cost, 6)
    with plain():
        np.testing.assert_array_equal(compiled, loop_outline._cheapest_ways(cost, 6))
