"""Rings come to lie on the points about them, and so many points on a ring are told from chance."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import poisson

from lasso_motion_ros.initialisation.circles import Circles
from lasso_motion_ros.initialisation.electrode_spots import ElectrodePoints
from lasso_motion_ros.initialisation.nearby_points import LEVELS, Nearby, PointCloud
from lasso_motion_ros.initialisation.shaped_rings import TUNING, ShapedRings

SIGMAS_M = (1.2e-3, 0.9e-3, 0.6e-3, 0.5e-3, 0.5e-3)
RADIUS = 0.01
CENTRE = np.array([0.01, -0.02, 0.03])
LIFT = 0.3e-3


def _ring(**changes: np.ndarray) -> ShapedRings:
    """A ring about an axis of the world, as it is unless it is changed."""
    parts = {
        "centres": CENTRE[None],
        "normals": np.array([[0.0, 0.0, 1.0]]),
        "first": np.array([[1.0, 0.0, 0.0]]),
        "second": np.array([[0.0, 1.0, 0.0]]),
        "radii": np.array([RADIUS]),
        "lifts": np.array([LIFT]),
        "ellipses": np.zeros((1, 2)),
        "saddles": np.zeros((1, 2)),
    }
    return ShapedRings(**{**parts, **changes})


def _points(places: np.ndarray, strength: float = 2.6, lift: float = LIFT) -> ElectrodePoints:
    count = len(places)
    spots = np.stack([np.arange(count)] * 2, axis=1)
    return ElectrodePoints(places, np.full(count, lift), np.full(count, strength), spots)


def _about(ring: ShapedRings, points: ElectrodePoints) -> Nearby:
    cloud = PointCloud(points, 1.5e-3)
    return cloud.about(ring.centres, ring.radii, ring.lifts, np.zeros((len(ring), 4)), 40)


def _evidence(ring: ShapedRings, nearby: Nearby) -> float:
    return float(ring.support(nearby).evidence(np.full((1, len(LEVELS)), 0.1))[0])


def test_a_ring_beside_its_electrodes_comes_to_lie_on_them_whatever_its_shape() -> None:
    true = _ring(ellipses=np.array([[0.4e-3, -0.3e-3]]), saddles=np.array([[0.2e-3, 0.3e-3]]))
    turns = 2.0 * np.pi * np.arange(14) / 14
    points = _points(true.points(turns)[0])
    normal = np.array([[0.1, -0.08, 1.0]]) / np.linalg.norm([0.1, -0.08, 1.0])
    beside = ShapedRings.of(Circles(CENTRE[None] + 0.8e-3, normal, np.array([0.0105]), np.array([0.1e-3]), np.zeros(1)))
    fitted = beside.fitted(_about(beside, points), SIGMAS_M)
    assert fitted.centres == pytest.approx(true.centres, abs=0.1e-3)
    assert fitted.lifts == pytest.approx(true.lifts, abs=0.02e-3)
    curve = fitted.points(np.linspace(0.0, 2.0 * np.pi, 721))[0]
    assert np.linalg.norm(points.places[:, None] - curve, axis=2).min(axis=1).max() < 0.2e-3


def test_the_ellipse_nearest_to_a_ring() -> None:
    ellipse = _ring(ellipses=np.array([[0.0, 1e-3]])).ellipse(0)
    # Longest at an eighth of a turn.
    assert np.abs(ellipse.semi_major) == pytest.approx([0.011 / np.sqrt(2.0)] * 2 + [0.0])
    assert np.abs(ellipse.semi_minor) == pytest.approx([0.009 / np.sqrt(2.0)] * 2 + [0.0])


def test_a_bent_ring_beside_its_ellipse() -> None:
    ring = _ring(ellipses=np.array([[0.0, 1e-3]]), saddles=np.array([[0.3e-3, 0.2e-3]]))
    # An end of the longer axis lies at an eighth of a turn, where the bend is a sine: 0.2 mm; then at three eighths.
    at = ring.beside_ellipse(0, np.array([0.0, 0.5 * np.pi]))
    ellipse = ring.ellipse(0)
    up = np.array([0.0, 0.0, 0.2e-3])
    assert at == pytest.approx(np.stack([CENTRE + ellipse.semi_major + up, CENTRE + ellipse.semi_minor - up]))


def test_points_all_round_a_ring_are_told_from_chance_by_poissons_law() -> None:
    ring = _ring()
    turns = 2.0 * np.pi * np.arange(8) / 8
    nearby = _about(ring, _points(ring.points(turns)[0]))
    support = ring.support(nearby)
    assert int(support.is_on.sum()) == 8
    assert support.counts[0].tolist() == [8, 8, 8, 0]
    assert support.gaps[0] == pytest.approx(1.0 / 8.0)
    # Eight points as strong as that in all, in a sphere of 22 mm, of a lift of 3 mm.
    density = 8.0 / (4.0 / 3.0 * np.pi * 0.022**3 * 3e-3)
    cloud = PointCloud(_points(ring.points(turns)[0]), 1.5e-3)
    assert cloud.density(ring.centres, ring.radii)[0, LEVELS <= 2.6] == pytest.approx(density)
    tube = 2.0 * np.pi * RADIUS * np.pi * TUNING.on_m**2 * 2.0 * TUNING.on_lift_m
    assert ring.tubes[0] == pytest.approx(tube)
    expected = np.full((1, len(LEVELS)), density * tube)
    assert support.evidence(expected)[0] == pytest.approx(-np.log10(poisson.sf(7, density * tube)), rel=1e-6)


def test_half_a_ring_and_spots_counted_twice_say_less() -> None:
    ring = _ring()
    turns = 2.0 * np.pi * np.arange(8) / 8
    whole = _points(ring.points(turns)[0])
    full = _evidence(ring, _about(ring, whole))
    half = _evidence(ring, _about(ring, _points(ring.points(0.5 * turns)[0])))
    assert half < 0.3 * full
    # Plane A shows one spot only at each end: what plane B shows in two places there is one electrode at most.
    doubled = ElectrodePoints(
        whole.places, whole.lifts, whole.strengths, np.stack([turns < 3.0, np.arange(8)], axis=1).astype(int)
    )
    assert _evidence(ring, _about(ring, doubled)) < 0.4 * full
    assert _evidence(ring, _about(ring, whole[:0])) == 0.0


def test_what_lies_at_another_height_in_plane_b_is_not_on_the_ring() -> None:
    ring = _ring()
    turns = 2.0 * np.pi * np.arange(8) / 8
    assert _evidence(ring, _about(ring, _points(ring.points(turns)[0], lift=LIFT + 0.6e-3))) == 0.0


def test_of_rings_that_are_about_the_same_the_best_is_kept() -> None:
    rings = ShapedRings.joined([_ring(), _ring(centres=CENTRE[None] + 1e-3), _ring(centres=CENTRE[None] + 0.01)])
    assert rings.circles(np.array([1.0, 3.0, 2.0])).distinct_numbers(3, 3e-3, 0.9).tolist() == [1, 2]
