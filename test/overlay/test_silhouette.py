"""The silhouette against formulas and against every triangle painted by itself."""

import cv2
import numpy as np
import pytest
from scipy.ndimage import map_coordinates
from support.rendering_inputs import (
    ellipsoid_mesh,
    ellipsoid_outline,
    torus_mesh,
    torus_outline,
    views,
)

from lasso_motion_ros.geometry import transforms
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.overlay.compositing import blend, surface_mask
from lasso_motion_ros.overlay.silhouette import WALL_CELL_PX, silhouette
from lasso_motion_ros.overlay.style import OverlayStyle
from lasso_motion_ros.overlay.triangle_mesh import TriangleMesh

VIEWS = views()
ELLIPSOID_M = (0.030, 0.018, 0.022)


def full_coverage(shape, projection):
    full = np.zeros((projection.height, projection.width), dtype=np.float32)
    rows, columns = shape.coverage.shape
    full[shape.top : shape.top + rows, shape.left : shape.left + columns] = shape.coverage
    return full


def drawn_outline(shape, projection, width_px=2.0):
    picture = np.zeros((projection.height, projection.width, 3), dtype=np.uint8)
    blend(picture, surface_mask(shape, OverlayStyle(fill=False), width_px), (255, 255, 255))
    return picture[..., 0].astype(np.float64)


def offsets_px(image, curve, normals, reach=4.0):
    """How far along each normal the brightness' centre lies from the curve, for points well inside the image."""
    along = np.linspace(-reach, reach, 65)
    at = curve[:, None, :] + along[None, :, None] * normals[:, None, :]
    # Folds inside the region are drawn with less than half of the outline's brightness: not what is measured.
    values = np.clip(map_coordinates(image, [at[..., 1], at[..., 0]], order=1) - 128.0, 0.0, None)
    return (values * along).sum(axis=1) / values.sum(axis=1)


def normals_of(curve):
    tangent = np.roll(curve, -1, axis=0) - np.roll(curve, 1, axis=0)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


@pytest.mark.parametrize("radii_m", [(0.025, 0.025, 0.025), ELLIPSOID_M], ids=["sphere", "ellipsoid"])
@pytest.mark.parametrize("view", VIEWS)
def test_outline_of_an_ellipsoid_is_the_conic_of_its_quadric(view, radii_m):
    projection, centre = VIEWS[view], (0.004, -0.003, 0.006)
    shape = silhouette(ellipsoid_mesh(radii_m, centre), projection, np.eye(4))
    curve = ellipsoid_outline(projection, radii_m, centre)
    inside = ((curve > 6) & (curve < [projection.width - 7, projection.height - 7])).all(axis=1)
    assert inside.sum() > 200
    offsets = offsets_px(drawn_outline(shape, projection), curve[inside], normals_of(curve)[inside])
    assert np.abs(offsets).max() < 0.25
    # The area under the coverage is the ellipse's own, to a thousandth (shoelace).
    if inside.all():
        x, y = curve.T
        area = 0.5 * abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
        assert shape.coverage.sum() == pytest.approx(area, rel=2e-3)


@pytest.mark.parametrize("view", VIEWS)
def test_outline_of_a_torus_is_where_rays_touch_it(view):
    projection = VIEWS[view]
    tilt = transforms.rigid((0.5, 0.3, 0.0), (0.0, 0.0, 0.0))
    shape = silhouette(torus_mesh(), projection, tilt)
    # The formula is for a torus about the z axis: turn the view instead of the body.
    turned = Projection(projection.matrix @ tilt, projection.width, projection.height)
    curve = torus_outline(turned)
    full = full_coverage(shape, projection)
    # The outline proper, not the folds inside the region: covered on one side, free on the other.
    half = len(curve) // 2
    normals = np.concatenate([normals_of(curve[:half]), normals_of(curve[half:])])
    outer = np.ones(len(curve), dtype=bool)
    for reach in (1.5, 4.5):
        left, right = (
            map_coordinates(full, (curve + s * reach * normals)[:, ::-1].T, order=1, mode="constant")
            for s in (-1.0, 1.0)
        )
        outer &= (np.minimum(left, right) < 0.01) & (np.maximum(left, right) > 0.99)
    outer &= ((curve > 8) & (curve < [projection.width - 9, projection.height - 9])).all(axis=1)
    assert outer.sum() > 400
    offsets = offsets_px(drawn_outline(shape, projection), curve[outer], normals[outer], reach=3.0)
    assert np.abs(offsets).max() < 0.5


@pytest.mark.parametrize("seed", range(4))
def test_any_heap_of_triangles_is_covered_as_if_painted_one_by_one(seed):
    rng = np.random.default_rng(seed)
    mesh = TriangleMesh(rng.uniform(-0.03, 0.03, (30, 3)), rng.permuted(np.tile(np.arange(30), (25, 1)), axis=1)[:, :3])
    projection = list(VIEWS.values())[seed]
    shape = silhouette(mesh, projection, np.eye(4))
    painted = np.zeros((projection.height, projection.width), dtype=np.float32)
    for corners in projection.project(mesh.vertices[mesh.triangles]):
        one = np.zeros(painted.shape, dtype=np.uint8)
        cv2.fillConvexPoly(one, np.rint(corners * 16).astype(np.int32), 1, cv2.LINE_8, 4)
        painted += one
    full = full_coverage(shape, projection)
    # Painting takes every touched pixel whole, so only pixels off all edges can be compared.
    edges = np.zeros(painted.shape, dtype=np.uint8)
    for corners in projection.project(mesh.vertices[mesh.triangles]):
        cv2.polylines(edges, [np.rint(corners).astype(np.int32)], True, 1, 5)
    clear = edges == 0
    assert clear.sum() > 10_000
    np.testing.assert_allclose(full[clear], painted[clear] > 0, atol=1e-4)
    assert shape.wall_count.max() <= painted.max() + 1e-3


def test_orientation_of_the_triangles_does_not_matter():
    mesh, projection = ellipsoid_mesh(ELLIPSOID_M, rows=40, columns=21), VIEWS["oblique"]
    flipped = mesh.triangles.copy()
    flipped[::3] = flipped[::3, ::-1]
    expected = silhouette(mesh, projection, np.eye(4))
    found = silhouette(TriangleMesh(mesh.vertices, flipped), projection, np.eye(4))
    np.testing.assert_array_equal(found.coverage, expected.coverage)
    np.testing.assert_array_equal(found.wall_count, expected.wall_count)


def test_the_walls_along_a_ray_are_counted():
    """A ray through a sphere meets two walls, through two spheres behind each other four."""
    front, back = ellipsoid_mesh((0.01,) * 3, (0.0, -0.03, 0.0)), ellipsoid_mesh((0.01,) * 3, (0.0, 0.03, 0.0))
    both = TriangleMesh(
        np.concatenate([front.vertices, back.vertices]),
        np.concatenate([front.triangles, back.triangles + len(front.vertices)]),
    )
    projection = VIEWS["plain"]
    for mesh, walls in ((front, 2.0), (both, 4.0)):
        shape = silhouette(mesh, projection, np.eye(4))
        x, y = projection.project(np.zeros(3))
        row, column = int(y - shape.top) // WALL_CELL_PX, int(x - shape.left) // WALL_CELL_PX
        assert shape.wall_count[row, column] == pytest.approx(walls, abs=1e-3)


def test_motion_moves_the_silhouette_as_it_moves_the_surface():
    mesh, projection = ellipsoid_mesh(ELLIPSOID_M), VIEWS["oblique"]
    motion = transforms.rigid((0.1, -0.2, 0.05), (0.004, -0.002, 0.012))
    moved = silhouette(mesh.moved(motion), projection, np.eye(4))
    found = silhouette(mesh, projection, motion)
    assert (found.left, found.top) == (moved.left, moved.top)
    np.testing.assert_allclose(found.coverage, moved.coverage, atol=1e-5)


def test_what_is_outside_the_image_is_cut_and_nothing_breaks():
    projection = VIEWS["zoomed"]
    large = silhouette(ellipsoid_mesh((0.2, 0.2, 0.2)), projection, np.eye(4))
    assert large.coverage.shape == (512, 512)
    assert large.coverage.min() > 0.999
    away = silhouette(ellipsoid_mesh((0.01,) * 3, (0.0, 0.0, 0.3)), projection, np.eye(4))
    assert away.coverage.size == 0
    picture = np.zeros((512, 512, 3), dtype=np.uint8)
    blend(picture, surface_mask(away, OverlayStyle(), 2.0), (255, 255, 255))
    assert not picture.any()


def test_what_lies_behind_the_source_is_not_drawn():
    projection = VIEWS["plain"]
    behind = projection.source - 0.1 * projection.viewing_direction
    assert silhouette(ellipsoid_mesh((0.01,) * 3, behind), projection, np.eye(4)).coverage.size == 0


def test_walls_face_the_ray_in_the_middle_and_are_edge_on_at_the_rim():
    projection = VIEWS["plain"]
    shape = silhouette(ellipsoid_mesh((0.02,) * 3), projection, np.eye(4))
    distance = np.linalg.norm(shape.centroids - projection.project(np.zeros(3)), axis=1)
    radius = distance.max()
    assert shape.facing[distance < 0.2 * radius].min() > 0.95
    assert shape.facing[distance > 0.99 * radius].max() < 0.25
