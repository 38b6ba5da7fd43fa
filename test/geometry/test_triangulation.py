import numpy as np
import pytest
from support.method_inputs import plane

from lasso_motion_ros.core.errors import GeometryError
from lasso_motion_ros.geometry.triangulation import nearest_to_rays, triangulate

POINT = np.array([0.01, -0.02, 0.03])


def test_triangulation_finds_the_point_and_the_middle_between_skew_rays():
    a, b = plane(0.0), plane(90.0)
    np.testing.assert_allclose(triangulate((a, b), (a.project(POINT), b.project(POINT))), POINT, atol=1e-9)
    # Both rays are horizontal at the iso-centre's height up to 76.43 px = 10 mm in A: the middle is 5 mm up.
    up = a.project(np.array([0.0, 0.0, 0.01]))
    np.testing.assert_allclose(triangulate((a, b), (up, b.project(np.zeros(3)))), [0.0, 0.0, 0.005], atol=1e-4)


def test_no_geometry_from_one_view():
    a = plane(0.0)
    with pytest.raises(GeometryError, match="parallel"):
        triangulate((a, a), (np.array([500.0, 500.0]), np.array([500.0, 500.0])))


def test_the_point_nearest_to_rays_through_points_is_the_middle_between_them():
    rays = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    # Along x at a height of 1, along y at a height of 3; the points lie anywhere on them.
    points = np.array([[-7.0, 2.0, 1.0], [5.0, 40.0, 3.0]])
    np.testing.assert_allclose(nearest_to_rays(points, rays), [5.0, 2.0, 2.0], atol=1e-12)
    with pytest.raises(GeometryError, match="parallel"):
        nearest_to_rays(points, rays[[0, 0]])
