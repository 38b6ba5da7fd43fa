"""Projections as OpenCV, RTK and DiffDRR have them: each tool's own formula gives the same pixels."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from lasso_motion_ros.core.errors import GeometryError
from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.conventions import diffdrr_detector, opencv_camera, rtk_geometry
from lasso_motion_ros.geometry.projection import Projection

SPACING = (0.25, 0.2)  # row, column
POINTS = np.random.default_rng(3).uniform(-0.06, 0.06, (20, 3))


def views() -> list[Projection]:
    angles = [(-30.0, 20.0, 0.0), (60.0, -25.0, 12.0), (0.0, 0.0, 0.0), (95.0, 10.0, -90.0), (170.0, 0.0, 180.0)]
    return [
        carm_projection(
            np.radians(lao),
            np.radians(cranial),
            source_detector_m=1.18,
            source_object_m=0.76,
            pixel_size_m=(SPACING[1] * 1e-3, SPACING[0] * 1e-3),
            width=1000,
            height=800,
            mirrored=mirrored,
            roll_rad=np.radians(roll),
            principal_point=(480.0, 420.0),
            iso_centre=(0.01, -0.02, 0.005),
        )
        for lao, cranial, roll in angles
        for mirrored in (True, False)
    ]


@pytest.mark.parametrize("view", views())
def test_opencv_projects_to_the_same_pixels(view: Projection) -> None:
    camera = opencv_camera(view)
    assert np.linalg.det(camera["rotation"]) == pytest.approx(1.0)
    rotation, _ = cv2.Rodrigues(camera["rotation"])
    pixels, _ = cv2.projectPoints(1e3 * POINTS, rotation, camera["translation_mm"], camera["camera_matrix"], None)
    np.testing.assert_allclose(pixels[:, 0], view.project(POINTS), atol=1e-6)


@pytest.mark.parametrize("view", views())
def test_rtk_projects_to_the_same_pixels(view: Projection) -> None:
    """The matrix as rtk::ThreeDCircularProjectionGeometry::AddProjectionInRadians makes it."""
    rtk = rtk_geometry(view, SPACING)
    gantry, out, in_plane = (
        -np.radians(rtk[name]) for name in ("gantry_angle_deg", "out_of_plane_angle_deg", "in_plane_angle_deg")
    )
    about_x = np.array([[1, 0, 0], [0, np.cos(out), -np.sin(out)], [0, np.sin(out), np.cos(out)]])
    about_y = np.array([[np.cos(gantry), 0, np.sin(gantry)], [0, 1, 0], [-np.sin(gantry), 0, np.cos(gantry)]])
    about_z = np.array([[np.cos(in_plane), -np.sin(in_plane), 0], [np.sin(in_plane), np.cos(in_plane), 0], [0, 0, 1]])
    turned = (1e3 * POINTS) @ (about_z @ about_x @ about_y).T
    turned[:, :2] -= rtk["source_offset_mm"]
    magnified = -rtk["source_to_detector_mm"] * turned[:, :2] / (turned[:, 2:] - rtk["source_to_isocenter_mm"])
    on_detector = magnified + rtk["source_offset_mm"] - rtk["projection_offset_mm"]
    pixels = (on_detector - rtk["image_origin_mm"]) / rtk["image_spacing_mm"]
    np.testing.assert_allclose(pixels, view.project(POINTS), atol=1e-6)


@pytest.mark.parametrize("view", views())
def test_diffdrr_projects_to_the_same_pixels(view: Projection) -> None:
    """As DiffDRR 0.6's `perspective_projection` does; its pixels are counted from the picture's corner."""
    drr = diffdrr_detector(view, SPACING)
    assert np.linalg.det(drr["pose"][:3, :3]) == pytest.approx(1.0)
    ras = 1e3 * POINTS * (-1.0, -1.0, 1.0)
    in_camera = (ras - drr["pose"][:3, 3]) @ drr["pose"][:3, :3]
    x = drr["sdd"] / drr["delx"] * in_camera[:, 0] / in_camera[:, 2] + drr["x0"] / drr["delx"] + drr["width"] / 2
    y = drr["sdd"] / drr["dely"] * in_camera[:, 1] / in_camera[:, 2] + drr["y0"] / drr["dely"] + drr["height"] / 2
    y = drr["height"] - y
    if drr["reverse_x_axis"]:
        x = drr["width"] - x
    np.testing.assert_allclose(np.column_stack([x, y]) - 0.5, view.project(POINTS), atol=1e-6)


def test_a_spacing_of_another_detector_is_refused() -> None:
    with pytest.raises(GeometryError, match=r"pixels of 0.3 mm × 0.2 mm"):
        rtk_geometry(views()[0], (0.3, 0.2))
