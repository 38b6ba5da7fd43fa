"""The surface net and the atrium made with it."""

import numpy as np
import pytest
from support.rendering_inputs import is_closed

from lasso_motion_ros.core.errors import SurfaceError
from lasso_motion_ros.overlay.atrium import atrium_at_ostium, left_atrium_surface
from lasso_motion_ros.overlay.isosurface import iso_surface


def volume(mesh):
    a, b, c = (mesh.vertices[mesh.triangles[:, i]] for i in range(3))
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0


def sphere_field(radius, step, reach):
    axis = np.arange(-reach, reach + step, step)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    return np.linalg.norm(grid, axis=-1) - radius, axis[0]


def test_the_net_of_a_sphere_is_closed_outward_and_of_its_size():
    values, start = sphere_field(0.02, 0.0015, 0.026)
    mesh = iso_surface(values, 0.0, (start,) * 3, (0.0015,) * 3)
    assert is_closed(mesh)
    assert np.abs(np.linalg.norm(mesh.vertices, axis=1) - 0.02).max() < 0.15 * 0.0015
    assert volume(mesh) == pytest.approx(4.0 / 3.0 * np.pi * 0.02**3, rel=0.01)
    # Euler's number of a sphere.
    assert len(mesh.vertices) - len(mesh.edges.ends) + len(mesh.triangles) == 2


def test_the_net_follows_origin_spacing_and_level():
    values, start = sphere_field(0.0, 1.0, 10.0)
    mesh = iso_surface(values, 6.0, (start, start, 100.0), (1.0, 1.0, 0.5))
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), [12.0, 12.0, 6.0], atol=0.3)
    np.testing.assert_allclose(mesh.vertices.mean(axis=0), [0.0, 0.0, 105.0], atol=1e-6)


def test_a_surface_that_is_not_there_or_leaves_the_grid_is_refused():
    values, _ = sphere_field(0.02, 0.002, 0.026)
    with pytest.raises(SurfaceError, match="no sample lies below"):
        iso_surface(values, -1.0, (0.0,) * 3, (1.0,) * 3)
    with pytest.raises(SurfaceError, match="margin"):
        iso_surface(values, 0.01, (0.0,) * 3, (1.0,) * 3)


def test_the_atrium_is_closed_and_of_human_size():
    mesh = left_atrium_surface()
    assert is_closed(mesh)
    assert len(mesh.vertices) - len(mesh.edges.ends) + len(mesh.triangles) == 2
    assert 5_000 <= len(mesh.triangles) <= 12_000
    assert 60e-6 < volume(mesh) < 110e-6  # 60–110 ml
    width, depth, height = np.ptp(mesh.vertices, axis=0)
    assert 0.07 < width < 0.09  # with both pairs of veins
    assert 0.05 < depth < 0.07  # with the appendage
    assert 0.045 < height < 0.06


def test_the_same_atrium_every_time():
    np.testing.assert_array_equal(left_atrium_surface().vertices, left_atrium_surface().vertices)


@pytest.mark.parametrize("normal", [(0.8, 0.28, 0.53), (-0.627, 0.46, -0.629), (0.27, 0.59, -0.76), (0.0, -2.0, 0.5)])
@pytest.mark.parametrize("diameter_m", [0.016, 0.021])
def test_the_vein_goes_through_the_ostium(normal, diameter_m):
    centre = np.array([0.015, 0.004, 0.010])
    mesh = atrium_at_ostium(centre, normal, diameter_m)
    assert is_closed(mesh)
    # Beyond the ostium the wall is a tube about the vein's axis; its points' spread tells axis and radius.
    usual = np.array([0.80, 0.28, 0.53]) / np.linalg.norm([0.80, 0.28, 0.53])
    axis = np.array(normal) / np.linalg.norm(normal)
    axis = axis if axis @ usual > 0 else -axis
    if axis @ usual > np.cos(np.radians(40.0)):
        along = (mesh.vertices - centre) @ axis
        across = np.linalg.norm(mesh.vertices - centre - along[:, None] * axis, axis=1)
        wall = (along > 0.005) & (along < 0.010) & (across < diameter_m)
        assert np.median(across[wall]) == pytest.approx(diameter_m / 2.0, rel=0.08)
    # The body lies to the patient's right of it.
    assert mesh.vertices.mean(axis=0)[0] < centre[0] - 0.01


def test_the_sign_of_the_normal_does_not_matter():
    one, other = (atrium_at_ostium((0.0, 0.0, 0.0), sign * np.array([0.7, 0.1, 0.6]), 0.02) for sign in (1.0, -3.0))
    np.testing.assert_allclose(one.vertices, other.vertices, atol=1e-12)


def test_an_ostium_that_no_vein_has_is_refused():
    with pytest.raises(SurfaceError, match="8 to 35 mm wide, found 50"):
        atrium_at_ostium((0, 0, 0), (1, 0, 0), 0.05)
    with pytest.raises(SurfaceError, match="normal"):
        atrium_at_ostium((0, 0, 0), (0, 0, 0), 0.02)
