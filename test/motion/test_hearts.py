"""What a heart may do: sizes, ways and their odds."""

import numpy as np
import pytest

from lasso_motion_ros.geometry.directions import half_sphere
from lasso_motion_ros.motion.hearts import hearts
from lasso_motion_ros.motion.motion_model import TUNING


@pytest.mark.parametrize("count", [1, 48, 300])
def test_directions_are_spread_evenly(count):
    directions = half_sphere(count)
    assert directions.shape == (count, 3)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    if count > 1:
        # To and fro, the mean of u uᵀ over all directions is a third of the identity.
        np.testing.assert_allclose(directions.T @ directions / count, np.eye(3) / 3.0, atol=0.02)


def test_some_way_is_near_to_any_direction():
    directions = half_sphere(TUNING.heartbeat_ways)
    random = np.random.default_rng(0).normal(size=(2000, 3))
    random /= np.linalg.norm(random, axis=1, keepdims=True)
    farthest_deg = np.degrees(np.arccos(np.abs(random @ directions.T).max(axis=1))).max()
    assert farthest_deg < 20.0


def test_sizes_ways_and_odds_by_hand():
    some = hearts(((1e-3, 0.5),), ((2e-3, 0.3), (3e-3, 0.2)), ways=4, across_share=0.1)
    assert len(some) == 1 + 2 * 4
    np.testing.assert_allclose(some.odds, [0.5, *[0.3 / 4] * 4, *[0.2 / 4] * 4])
    np.testing.assert_allclose(some.log_odds, np.log(some.odds))
    np.testing.assert_array_equal(some.is_any_way, [True] + [False] * 8)
    np.testing.assert_allclose(some.covariances[0], 1e-6 * np.eye(3))
    for covariance, size_m in zip(some.covariances[1:], [2e-3] * 4 + [3e-3] * 4, strict=True):
        np.testing.assert_allclose(np.linalg.eigvalsh(covariance), size_m**2 * np.array([0.01, 0.01, 1.0]))


def test_what_is_left_of_them_knows_which_it_is():
    every = TUNING.hearts(0.1)
    kept = np.zeros(len(every), bool)
    kept[[0, 7, 50]] = True
    left = every.only(kept)
    np.testing.assert_array_equal(left.number, [0, 7, 50])
    np.testing.assert_allclose(left.covariances, every.covariances[left.number])
    np.testing.assert_allclose(left.odds, every.odds[left.number] / every.odds[left.number].sum())
    np.testing.assert_array_equal(left.only(np.array([False, True, True])).number, [7, 50])


def test_fewer_ways_will_do_where_both_planes_are_exposed_together():
    in_step, late = TUNING.hearts(0.0), TUNING.hearts(0.02)
    assert len(in_step) == 4 + 4 * TUNING.heartbeat_ways_in_step
    assert len(late) == 4 + 4 * TUNING.heartbeat_ways
    assert TUNING.hearts(0.03) is late
