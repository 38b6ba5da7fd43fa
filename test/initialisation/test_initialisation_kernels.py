"""The compiled kernels of the search for rings against the plain versions."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from support.lasso_inputs import lasso_pair

from lasso_motion_ros.core.compiled import has_kernels, plain
from lasso_motion_ros.initialisation.circle_fit import find_circles
from lasso_motion_ros.initialisation.circle_search import search_circles
from lasso_motion_ros.initialisation.circles import Circles
from lasso_motion_ros.initialisation.laid_pair import LaidPair
from lasso_motion_ros.initialisation.nearby_points import PointCloud
from lasso_motion_ros.initialisation.ring_search import Shown
from lasso_motion_ros.initialisation.spot_circles import circles_of_spots

pytestmark = pytest.mark.skipif(not has_kernels(), reason="the extra `fast` is not installed")

PAIR = LaidPair.of(lasso_pair(0), bright=False)
SHOWN = Shown.by(PAIR)


def _assert_same(one: Circles, other: Circles) -> None:
    for part in fields(Circles):
        assert getattr(one, part.name) == pytest.approx(getattr(other, part.name), rel=1e-6, abs=1e-6), part.name


def test_all_circles_that_a_ring_can_be() -> None:
    compiled = search_circles(SHOWN.maps, PAIR.grid, 0.0)
    with plain():
        _assert_same(compiled, search_circles(SHOWN.maps, PAIR.grid, 0.0))


@pytest.mark.slow
def test_circles_that_are_fitted_to_lines() -> None:
    compiled = find_circles(SHOWN.maps, PAIR.grid, 0.1)
    with plain():
        _assert_same(compiled, find_circles(SHOWN.maps, PAIR.grid, 0.1))


def test_circles_through_electrodes() -> None:
    compiled = circles_of_spots(PAIR.points, PAIR.spots, PAIR.grid)
    with plain():
        _assert_same(compiled, circles_of_spots(PAIR.points, PAIR.spots, PAIR.grid))


def test_how_densely_points_lie() -> None:
    cloud = PointCloud(PAIR.points, PAIR.largest_lift_m)
    random = np.random.default_rng(0)
    about = random.uniform(-0.03, 0.03, (20, 3)), random.uniform(6e-3, 16e-3, 20)
    compiled = cloud.density(*about)
    with plain():
        assert compiled == pytest.approx(cloud.density(*about))
