"""Thin cylinders on pixels: peak, mass, slant, flat ends."""

import numpy as np
import pytest

from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.phantom.tubes import Segments, chain, joined, optical_depth

ATTENUATION = 200.0


def frontal(size: int = 101, pixel_mm: float = 0.2) -> Projection:
    """Plane seen along y; one pixel at the iso-centre is pixel_mm · 0.8 / 1.2."""
    return carm_projection(
        0.0,
        0.0,
        source_detector_m=1.2,
        source_object_m=0.8,
        pixel_size_m=pixel_mm * 1e-3,
        width=size,
        height=size,
    )


def rod(start_mm: tuple[float, float, float], end_mm: tuple[float, float, float], radius_mm: float) -> Segments:
    return chain(np.array([start_mm, end_mm]) * 1e-3, radius_mm * 1e-3, ATTENUATION)


def test_the_middle_of_a_rod_shows_its_diameter() -> None:
    depth = optical_depth(frontal(), rod((0, 0, -30), (0, 0, 30), 1.0), supersampling=1)
    assert depth[50, 50] == pytest.approx(ATTENUATION * 2.0e-3, rel=1e-6)
    # 6 pixels of 2/15 mm to the side: chord 2·√(1 − 0.8²) = 1.2 mm.
    assert depth[50, 56] == pytest.approx(ATTENUATION * 1.2e-3, rel=2e-3)
    assert depth[50, 58] == 0.0


def test_a_slanted_rod_is_longer_in_the_ray() -> None:
    slanted = optical_depth(frontal(), rod((0, -20, -20), (0, 20, 20), 1.0), supersampling=1)
    assert slanted[50, 50] == pytest.approx(ATTENUATION * 2.0e-3 * np.sqrt(2), rel=1e-6)


@pytest.mark.parametrize("radius_mm", [0.05, 0.3, 1.0])
def test_mass_is_kept_however_thin_the_line(radius_mm: float) -> None:
    projection = frontal()
    depth = optical_depth(projection, rod((-4, 0, 1), (3, 0, -2), radius_mm), supersampling=6)
    pixel_m = 1e-3 * projection.millimetres_per_pixel(np.zeros(3))
    volume = np.pi * (radius_mm * 1e-3) ** 2 * 1e-3 * np.hypot(7, 3)
    assert depth.sum() * pixel_m**2 == pytest.approx(ATTENUATION * volume, rel=0.03)


def test_an_electrode_ends_flat() -> None:
    depth = optical_depth(frontal(), rod((-1, 0, 0), (1, 0, 0), 0.8), supersampling=1)
    pixel_mm = 0.2 * 0.8 / 1.2
    last_inside, first_outside = 50 + int(0.9 / pixel_mm), 50 + int(np.ceil(1.1 / pixel_mm))
    assert depth[50, last_inside] == pytest.approx(depth[50, 50], rel=1e-3)
    assert depth[50, first_outside] == 0.0


def test_segments_add_and_are_culled_outside_the_field() -> None:
    projection = frontal()
    first, second = rod((-5, 0, 0), (5, 0, 0), 0.5), rod((0, 0, -5), (0, 0, 5), 0.5)
    far = rod((500, 0, 0), (510, 0, 0), 0.5)
    together = optical_depth(projection, joined([first, second, far]))
    assert together == pytest.approx(optical_depth(projection, first) + optical_depth(projection, second))
    assert optical_depth(projection, joined([])).sum() == 0.0
    assert optical_depth(projection, far).sum() == 0.0


def test_a_curve_has_no_gaps_at_its_joints() -> None:
    angle = np.linspace(0.0, np.pi, 60)
    arc = np.stack([5 * np.cos(angle), np.zeros(60), 5 * np.sin(angle)], axis=1) * 1e-3
    projection = frontal(size=161)
    depth = optical_depth(projection, chain(arc, 0.4e-3, ATTENUATION), supersampling=3)
    pixels = np.rint(projection.project(arc)).astype(int)
    along = depth[pixels[5:-5, 1], pixels[5:-5, 0]]
    assert along.min() > 0.8 * ATTENUATION * 0.8e-3
    assert along.max() < 1.1 * ATTENUATION * 0.8e-3
