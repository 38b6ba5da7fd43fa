"""The points about rings, moved back with them; and those that a ring's own spots make, left out."""

from __future__ import annotations

import numpy as np
import pytest

from lasso_motion_ros.initialisation.electrode_spots import ElectrodePoints
from lasso_motion_ros.initialisation.nearby_points import Nearby, PointCloud

CENTRES = np.array([[0.0, 0.0, 0.0], [0.05, 0.0, 0.0]])
RADII = np.array([0.01, 0.01])
STILL = np.zeros((2, 4))


def _points(places: np.ndarray, strengths: np.ndarray, lifts: np.ndarray | float = 0.0) -> ElectrodePoints:
    count = len(places)
    return ElectrodePoints(places, lifts + np.zeros(count), strengths, np.stack([np.arange(count)] * 2, axis=1))


def _about(points: ElectrodePoints, moved: np.ndarray = STILL, most: int = 3) -> Nearby:
    return PointCloud(points, 1.5e-3).about(CENTRES, RADII, np.zeros(2), moved, most)


def test_the_strongest_points_near_each_ring_s_circle_stand_side_by_side() -> None:
    # Four beside the first ring's circle, one in its middle, one too far off; of the second ring there is one.
    places = np.array(
        [[9e-3, 0, 0], [0, 11e-3, 0], [-10e-3, 0, 0], [0, 0, 8e-3], [1e-3, 0, 0], [0, 0, 0.02], [0.05, 0.01, 0]]
    )
    nearby = _about(_points(places, np.array([1.6, 3.0, 2.5, 2.0, 9.0, 9.0, 1.8])))
    assert nearby.strengths.tolist() == [[3.0, 2.5, 2.0], [1.8, 0.0, 0.0]]
    assert nearby.spots[0, :, 0].tolist() == [1, 2, 3]
    assert nearby.places[1, 0] == pytest.approx([0.05, 0.01, 0.0])


def test_points_are_moved_back_with_their_ring_and_lifted_with_it() -> None:
    move = np.array([[2e-3, -3e-3, 15e-3, 1e-3], [0.0, 0.0, 0.0, 0.0]])
    places = np.array([[0.01, 0.0, 0.0], [0.0, 0.01, 0.0]]) + move[0, :3]
    nearby = _about(_points(places, np.array([2.0, 3.0]), np.array([1.1e-3, 0.1e-3])), move)
    assert nearby.strengths[0].tolist() == [2.0, 0.0, 0.0]  # the other's lift is not the ring's any more
    assert nearby.places[0, 0] == pytest.approx([0.01, 0.0, 0.0])
    assert nearby.lifts[0, 0] == pytest.approx(0.1e-3)


def test_spots_of_several_pairs_are_not_one() -> None:
    one = _about(_points(np.array([[0.01, 0.0, 0.0]]), np.array([2.0])))
    both = Nearby.joined([one, one])
    assert both.strengths[0].tolist() == [2.0, 0.0, 0.0, 2.0, 0.0, 0.0]
    assert both.spots[0, 0, 0] != both.spots[0, 3, 0]


def test_what_two_spots_of_a_ring_s_own_make_is_left_out_and_what_one_and_another_make_is_not() -> None:
    places = np.array([[0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [-0.01, 0.0, 0.0]])
    own = _about(ElectrodePoints(places[:2], np.zeros(2), np.full(2, 2.0), np.array([[0, 0], [1, 1]])))
    others = _about(ElectrodePoints(places, np.zeros(3), np.array([2.2, 2.1, 2.0]), np.array([[0, 1], [5, 1], [0, 7]])))
    left = others.without(own, own.strengths > 0.0)
    assert left.strengths[0].tolist() == [0.0, 2.1, 2.0]


def test_no_points_at_all() -> None:
    nearby = _about(_points(np.zeros((0, 3)), np.zeros(0)))
    assert nearby.strengths.tolist() == [[0.0] * 3] * 2


def test_the_strongest_points_of_a_sphere_are_found_however_many_there_are() -> None:
    random = np.random.default_rng(5)
    points = _points(random.uniform(-0.02, 0.02, (10_000, 3)), np.round(random.uniform(1.5, 4.0, 10_000), 2))
    cloud, centre = PointCloud(points, 1.5e-3), np.array([5e-3, 0.0, 0.0])
    is_near = np.linalg.norm(cloud.points.places - centre, axis=1) <= 8e-3
    within = np.flatnonzero(is_near & (cloud.points.strengths >= 2.0))
    assert len(within) > 100
    for most in (0, 7, 100, 10_000):
        found = cloud.strongest_within(centre, 8e-3, faintest=2.0, most=most)
        assert found.tolist() == within[:most].tolist()
    assert (np.diff(cloud.points.strengths) <= 0.0).all()
