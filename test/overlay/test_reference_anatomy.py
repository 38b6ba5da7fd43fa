"""Surfaces and volumes of one and the same ellipsoid: their outlines agree with the ellipsoid's own conic."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from support.rendering_inputs import ellipsoid_mesh, ellipsoid_outline, views
from support.volume_inputs import CENTRE_M, LABEL, RADII_M, SPACING_MM, write_ellipsoid

from lasso_motion_ros.config.overlay import OverlayConfig, VolumeConfig
from lasso_motion_ros.core.errors import ConfigurationError, SurfaceError, VolumeError
from lasso_motion_ros.geometry import transforms
from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.geometry.volumes import VolumeImage
from lasso_motion_ros.overlay.reference_anatomy import read_reference_anatomy
from lasso_motion_ros.overlay.silhouette import silhouette
from lasso_motion_ros.overlay.style import OverlayStyle
from lasso_motion_ros.overlay.surface_files import write_stl
from lasso_motion_ros.overlay.volume_cloud import VolumeCloud, cloud_mask, volume_cloud

VIEWS = views()
LEVEL = VolumeConfig(level=125.0)
BY_LABEL = VolumeConfig(label=LABEL)


def contour_of(mask):
    """Pixels (N, 2) on the largest contour of a mask."""
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return max(contours, key=len)[:, 0, :].astype(float)


def whole_opacity(mask, projection):
    """A mask's opacity in the whole picture."""
    whole = np.zeros((projection.height + 64, projection.width + 64), np.uint8)
    rows, columns = mask.opacity.shape
    whole[mask.top : mask.top + rows, mask.left : mask.left + columns] = mask.opacity
    return whole[: projection.height, : projection.width]


def drawn_contour(shown, projection):
    if isinstance(shown, VolumeCloud):
        mask = cloud_mask(shown, projection, np.eye(4), OverlayStyle(fill=False), 2.0, faint=False)
        contour = np.argwhere(whole_opacity(mask, projection) > 200)[:, ::-1].astype(float)
    else:
        mask = np.zeros((projection.height, projection.width), bool)
        shape = silhouette(shown, projection, np.eye(4))
        rows, columns = shape.coverage.shape
        mask[shape.top : shape.top + rows, shape.left : shape.left + columns] = shape.coverage > 0.5
        contour = contour_of(mask)
    inside = ((contour > 3) & (contour < [projection.width - 4, projection.height - 4])).all(axis=1)
    return contour[inside]


def voxel_px(projection):
    return max(SPACING_MM) / projection.millimetres_per_pixel(CENTRE_M)


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("case", ["level", "label", "label turned", "projection"])
def test_a_volumes_outline_lies_within_a_voxel_of_the_surfaces(tmp_path, view, case):
    pytest.importorskip("vtkmodules")
    path = write_ellipsoid(tmp_path / "heart.nii.gz", label="label" in case, turned="turned" in case)
    volume = BY_LABEL if "label" in case else LEVEL
    if case == "projection":
        volume = VolumeConfig(level=125.0, display="projection")
    shown = read_reference_anatomy(OverlayConfig(volume_file=str(path), volume=volume)).drawn
    projection = VIEWS[view]
    conic = ellipsoid_outline(projection, RADII_M, CENTRE_M, count=2000)
    contour = drawn_contour(shown, projection)
    assert len(contour) > 100
    off = distance_to_curve(contour, np.concatenate([conic, conic[:1]]))
    assert off.max() < voxel_px(projection) + 1.0  # a mask's own contour lies half a pixel inside
    surface = drawn_contour(ellipsoid_mesh(RADII_M, CENTRE_M), projection)
    assert distance_to_curve(contour, np.concatenate([surface, surface[:1]])).max() < voxel_px(projection) + 1.0


def test_only_the_label_asked_for_is_shown(tmp_path):
    """Another label fills a corner of the grid, some 50 mm away."""
    pytest.importorskip("vtkmodules")
    path = write_ellipsoid(tmp_path / "labels.nii.gz", label=True)
    for display in ("surface", "projection"):
        volume = VolumeConfig(label=LABEL, display=display)
        shown = read_reference_anatomy(OverlayConfig(volume_file=str(path), volume=volume)).drawn
        points = shown.points if isinstance(shown, VolumeCloud) else shown.vertices
        assert (np.abs(points - CENTRE_M) < np.array(RADII_M) + 2e-3).all()


@pytest.mark.parametrize(("units", "scale"), [("mm", 1.0), ("m", 1e3)])
def test_units_scale_the_file_not_the_registration(tmp_path, units, scale):
    pytest.importorskip("trimesh")
    write_stl(tmp_path / "ball.stl", ellipsoid_mesh((0.01,) * 3, rows=20, columns=11), "mm")
    config = OverlayConfig(volume_file=str(tmp_path / "ball.stl"), units=units, registration="0.1 0 0 0 0 0 1")
    vertices = read_reference_anatomy(config).surface.vertices
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2.0
    assert middle[0] == pytest.approx(0.1, abs=2e-3 * scale)
    assert np.ptp(vertices[:, 2]) == pytest.approx(0.02 * scale, rel=1e-5)


def test_triangles_are_reduced_to_what_is_asked_and_stay_within_a_voxel(tmp_path):
    pytest.importorskip("vtkmodules")
    path = write_ellipsoid(tmp_path / "heart.nrrd")
    fine, coarse = (
        read_reference_anatomy(OverlayConfig(volume_file=str(path), volume=VolumeConfig(level=125.0, triangles=most)))
        for most in (500_000, 1_000)
    )
    assert len(fine.surface.triangles) > 3_000
    assert 500 < len(coarse.surface.triangles) <= 1_000
    # On the ellipsoid |x / radii| is 1; half a voxel of the shortest radius is the allowance.
    for mesh in (fine.surface, coarse.surface):
        off = np.abs(np.linalg.norm((mesh.vertices - CENTRE_M) / RADII_M, axis=1) - 1.0) * min(RADII_M)
        assert off.max() < 0.5e-3 * max(SPACING_MM)
    assert "at 125 of -50 to 300" in fine.description


def test_thickness_of_a_projected_block():
    """A box of 40 × 40 × 60 mm: in its middle the rays cross 40 mm, so that the opacity is known."""
    projection = VIEWS["plain"]  # along y
    to_lps = np.diag([2e-3, 2e-3, 2e-3, 1.0])
    to_lps[:3, 3] = -1e-3 * np.array([19.0, 19.0, 29.0])
    inside = np.ones((30, 20, 20), bool)
    cloud = volume_cloud(VolumeImage(inside, to_lps), inside)
    assert cloud.sizes.sum() == pytest.approx(0.04 * 0.04 * 0.06, rel=1e-6)
    style = OverlayStyle(outline=False, fill_opacity=0.3, projection_depth_m=0.04)
    mask = cloud_mask(cloud, projection, np.eye(4), style, 2.0, faint=False)
    x, y = np.rint(projection.project(np.zeros(3))).astype(int)
    opacity = whole_opacity(mask, projection)
    assert opacity[y - 10 : y + 11, x - 10 : x + 11].mean() == pytest.approx(0.3 * 255, rel=0.03)
    moved = transforms.rigid((0, 0, 0), (0.0, 0.0, 0.2))
    assert not whole_opacity(cloud_mask(cloud, projection, moved, style, 2.0, faint=False), projection)[y, x]
    away = transforms.rigid((0, 0, 0), (0.0, 0.0, 2.0))
    assert cloud_mask(cloud, projection, away, style, 2.0, faint=False).opacity.size == 0


def test_blocks_are_joined_where_there_are_many_voxels():
    inside = np.ones((60, 60, 60), bool)  # two by two by two leave 27,000
    cloud = volume_cloud(VolumeImage(inside, np.diag([1e-3, 1e-3, 1e-3, 1.0])), inside)
    assert len(cloud.points) <= 60_000
    assert cloud.sizes.sum() == pytest.approx(0.06**3, rel=1e-6)
    np.testing.assert_allclose(cloud.points.mean(axis=0), [0.0295] * 3, atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "error", "reason"),
    [
        ({"volume": VolumeConfig(level=900.0)}, VolumeError, "lies outside of the values, -50 to 300"),
        ({"volume": VolumeConfig(label=9999)}, VolumeError, "no voxel has the label 9999"),
        ({"axes": "ras", "volume": LEVEL}, ConfigurationError, "states its own axes"),
        ({"volume": LEVEL, "registration": "1 2 3"}, ConfigurationError, "found 3 numbers"),
        ({"volume_file": ""}, ConfigurationError, "must be given"),
        ({"volume_file": "x.stl"}, SurfaceError, "unit of its coordinates must be given"),
    ],
)
def test_what_cannot_be_shown_is_said(tmp_path, changes, error, reason):
    pytest.importorskip("vtkmodules")
    path = write_ellipsoid(tmp_path / "heart.nrrd")
    with pytest.raises(error, match=reason):
        read_reference_anatomy(OverlayConfig(**({"volume_file": str(path)} | changes)))
