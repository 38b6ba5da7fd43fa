"""The triangle mesh: what is one, which edges its triangles share, how it is cleaned and moved."""

import numpy as np
import pytest
from support.rendering_inputs import is_closed

from lasso_motion_ros.core.errors import SurfaceError
from lasso_motion_ros.geometry import transforms
from lasso_motion_ros.overlay.triangle_mesh import TriangleMesh, clean_mesh

CORNERS = np.array([[0, 0, 0], [10, 0, 0], [0, 20, 0], [0, 0, 30]], dtype=float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def test_vertices_at_one_place_are_joined():
    soup = TriangleMesh(CORNERS[FACES].reshape(-1, 3), np.arange(12).reshape(-1, 3))
    assert not is_closed(soup)
    joined = clean_mesh(soup.vertices, soup.triangles)
    assert len(joined.vertices) == 4
    assert is_closed(joined)


@pytest.mark.parametrize(
    ("vertices", "triangles", "reason"),
    [
        (CORNERS[:, :2], FACES, r"are \(V, 3\)"),
        (CORNERS, FACES[:, :2], r"are \(T, 3\)"),
        (CORNERS, FACES + 1, "does not exist"),
        (CORNERS, FACES[:0], "no triangle"),
        (np.where(CORNERS > 0.0, np.inf, CORNERS), FACES, "not finite"),
    ],
)
def test_a_mesh_that_is_none_is_refused(vertices, triangles, reason):
    with np.errstate(invalid="ignore"), pytest.raises(SurfaceError, match=reason):
        TriangleMesh(vertices, triangles)


def test_edges_of_a_tetrahedron():
    mesh = TriangleMesh(CORNERS, FACES)
    assert len(mesh.edges.ends) == 6
    np.testing.assert_array_equal(np.bincount(mesh.edges.of_triangle.ravel()), [2] * 6)
    # Each edge is run along once and against once.
    balance = np.bincount(mesh.edges.of_triangle.ravel(), weights=mesh.edges.direction.ravel())
    np.testing.assert_array_equal(balance, np.zeros(6))


def test_moving_keeps_the_triangles():
    mesh = TriangleMesh(1e-3 * CORNERS, FACES)
    moved = mesh.moved(transforms.rigid((0.0, 0.0, np.pi / 2), (1.0, 0.0, 0.0)))
    np.testing.assert_allclose(moved.vertices[1], [1.0, 0.010, 0.0], atol=1e-12)
    np.testing.assert_array_equal(moved.triangles, mesh.triangles)
