import numpy as np
import pytest
from support.method_inputs import angle_deg, biplane, ring

from lasso_motion_ros.geometry.ellipse import fit_ellipse
from lasso_motion_ros.seeding.cones import cone, cut, quan_planes

NORMAL = np.array([0.3, -0.5, 0.8])
CENTRE = np.array([0.012, -0.020, 0.015])


def test_the_ring_lies_in_a_plane_of_the_rank_two_quadric():
    loop = ring(NORMAL, CENTRE)
    cones = []
    for view in biplane().values():
        # Metres about the ring, so that the cones are well scaled.
        frame = np.diag([0.01, 0.01, 0.01, 1.0])
        frame[:3, 3] = CENTRE
        matrix = view.matrix @ frame
        cones.append(cone(fit_ellipse(view.project(loop.points(60))).conic, matrix))
    planes = quan_planes(*cones)
    assert len(planes) == 2
    # In these coordinates the ring's plane passes through the origin with its own normal.
    space_plane = min(planes, key=lambda p: angle_deg(p[:3], NORMAL))
    assert angle_deg(space_plane[:3], NORMAL) < 1e-4
    assert abs(space_plane[3]) / np.linalg.norm(space_plane[:3]) < 1e-6
    # The order and the scale of the cones mean nothing.
    for other in (quan_planes(cones[1], cones[0]), quan_planes(-3.0 * cones[0], 1e5 * cones[1])):
        assert min(angle_deg(p[:3], NORMAL) for p in other) < 1e-4


def test_cuts_by_hand():
    # The cone x² + y² = z², cut at the height 2: a circle of radius 2; upright through its axis: no ellipse.
    upright = np.diag([1.0, 1.0, -1.0, 0.0])
    (circle,) = cut(upright, np.array([0.0, 0.0, 3.0, -6.0]), np.eye(4))
    np.testing.assert_allclose(circle.centre, [0.0, 0.0, 2.0], atol=1e-12)
    assert np.linalg.norm(circle.semi_major) == pytest.approx(2.0)
    assert circle.circularity == pytest.approx(1.0)
    assert angle_deg(circle.normal, [0.0, 0.0, 1.0]) < 1e-6
    assert cut(upright, np.array([1.0, 0.0, 0.0, -1.0]), np.eye(4)) == []
    assert cut(upright, np.zeros(4), np.eye(4)) == []
