"""The compiled kernels of the search for rings against the plain versions."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from support.lasso_inputs import lasso_pair

from lasso_motion_ros.core.compiled import has_kernels, plain
from lasso_motion_ros.initialisation.carried_rings import carried
from lasso_motion_ros.initialisation.circle_fit import find_circles
from lasso_motion_ros.initialisation.circle_search import search_circles
from lasso_motion_ros.initialisation.circles import Circles
from lasso_motion_ros.initialisation.direction_maps import curvature, direction_maps
from lasso_motion_ros.initialisation.laid_pair import LaidPair
from lasso_motion_ros.initialisation.nearby_points import PointCloud
from lasso_motion_ros.initialisation.ring_search import Shown
from lasso_motion_ros.initialisation.shaped_rings import ShapedRings
from lasso_motion_ros.initialisation.spot_circles import _through_triples, circles_of_spots

pytestmark = pytest.mark.skipif(not has_kernels(), reason="the extra `fast` is not installed")

PAIR = LaidPair.of(lasso_pair(0), bright=False)
SHOWN = Shown.by(PAIR)


def _assert_same(one: Circles, other: Circles) -> None:
    for part in fields(Circles):
        assert getattr(one, part.name) == pytest.approx(getattr(other, part.name), rel=1e-6, abs=1e-6), part.name


def test_a_pair_is_laid_out_alike() -> None:
    with plain():
        plainly = LaidPair.of(PAIR.pair, bright=False)
    for plane, laid in PAIR.laid.items():
        assert laid.inside.min() == 0.0
        np.testing.assert_array_equal(laid.inside, plainly.laid[plane].inside)
        np.testing.assert_allclose(laid.values, plainly.laid[plane].values, atol=1e-5)


@pytest.mark.parametrize("bright", [False, True])
def test_lines_are_seen_alike(bright: bool) -> None:
    seen = curvature(PAIR.laid["a"])
    compiled = direction_maps(seen, bright=bright).responses
    assert compiled.max() == 1.0
    with plain():
        np.testing.assert_allclose(compiled, direction_maps(seen, bright=bright).responses, atol=1e-6)


def test_rays_cross_in_the_same_places() -> None:
    random = np.random.default_rng(3)
    columns = {"a": random.uniform(-0.05, 0.05, 50), "b": random.uniform(-0.05, 0.05, 50)}
    rows = random.uniform(-0.04, 0.04, 50)
    compiled = PAIR.grid.places(columns, rows)
    with plain():
        np.testing.assert_allclose(compiled, PAIR.grid.places(columns, rows), atol=1e-12)


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


def test_all_circles_through_three_electrodes() -> None:
    compiled = _through_triples(PAIR.points)
    assert len(compiled) > 1000
    with plain():
        _assert_same(compiled, _through_triples(PAIR.points))


def _cloud() -> PointCloud:
    return PointCloud(PAIR.points, PAIR.largest_lift_m)


def _rings(count: int) -> ShapedRings:
    """Rings through electrodes, bent and squeezed."""
    random = np.random.default_rng(1)
    rings = ShapedRings.of(circles_of_spots(PAIR.points, PAIR.spots, PAIR.grid)[:count])
    shape = [random.normal(0.0, 0.5e-3, (len(rings), 2)) for _ in range(2)]
    return replace(rings, ellipses=shape[0], saddles=shape[1])


def _assert_alike(one: object, other: object) -> None:
    for part in fields(one):  # type: ignore[arg-type]
        np.testing.assert_allclose(getattr(one, part.name), getattr(other, part.name), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("extent_m", [0.03, 0.3])  # about them, and beyond all cells
def test_how_densely_points_lie(extent_m: float) -> None:
    random = np.random.default_rng(0)
    about = random.uniform(-extent_m, extent_m, (20, 3)), random.uniform(6e-3, 16e-3, 20)
    compiled = _cloud().density(*about)
    with plain():
        assert compiled == pytest.approx(_cloud().density(*about))


@pytest.mark.parametrize("most", [5, 96])
def test_the_same_points_are_about_rings(most: int) -> None:
    random, rings = np.random.default_rng(2), _rings(30)
    moved = random.normal(0.0, 5e-3, (len(rings), 4)) * (1.0, 1.0, 1.0, 0.1)
    compiled = _cloud().about(rings.centres, rings.radii, rings.lifts, moved, most)
    with plain():
        _assert_alike(compiled, _cloud().about(rings.centres, rings.radii, rings.lifts, moved, most))


def test_rings_come_to_lie_on_points_alike_and_have_the_same_support() -> None:
    rings = _rings(30)
    nearby = _cloud().about(rings.centres, rings.radii, rings.lifts, np.zeros((len(rings), 4)), 96)
    compiled = rings.fitted(nearby, (1.2e-3, 0.6e-3))
    support = compiled.support(nearby)
    left = nearby.without(nearby, support.is_on)
    assert support.counts.max() > 3
    assert (left.strengths != nearby.strengths).any()
    with plain():
        _assert_alike(compiled, rings.fitted(nearby, (1.2e-3, 0.6e-3)))
        _assert_alike(support, compiled.support(nearby))
        _assert_alike(left, nearby.without(nearby, support.is_on))


@pytest.mark.parametrize("is_later", [False, True])
def test_rings_are_carried_alike(is_later: bool) -> None:
    rings, later = _rings(12), LaidPair.of(lasso_pair(1), bright=False)

    def clouds() -> list[PointCloud]:
        return [_cloud(), PointCloud(later.points, later.largest_lift_m)]

    compiled = carried(rings, clouds(), is_later=is_later)
    assert abs(compiled.moved[1]).max() > 1e-3
    with plain():
        plainly = carried(rings, clouds(), is_later=is_later)
    _assert_alike(compiled.rings, plainly.rings)
    np.testing.assert_allclose(compiled.moved, plainly.moved, rtol=1e-9, atol=1e-12)
    assert compiled.evidence == pytest.approx(plainly.evidence)
