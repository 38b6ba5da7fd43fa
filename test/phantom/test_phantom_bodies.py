"""Chords of single rays through bodies, worked out by hand."""

import numpy as np
import pytest

from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.transforms import rigid, rotation_from_vector
from lasso_motion_ros.phantom.anatomy import Additive
from lasso_motion_ros.phantom.bodies import Rays, covering_grid, cylinder, ellipsoid, pixel_rays, union_length
from lasso_motion_ros.phantom.body_renderer import _added


def ray(x_mm: float, direction: tuple[float, float, float] = (0, 0, 1)) -> Rays:
    """One ray that crosses the plane z = 0 at (x, 0), from 0.8 m away."""
    unit = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    return Rays(np.array([x_mm * 1e-3, 0.0, 0.0]) - 0.8 * unit, unit[:, None], (1, 1))


@pytest.mark.parametrize(("x_mm", "chord_mm"), [(0.0, 20.0), (6.0, 16.0), (8.0, 12.0), (10.5, 0.0)])
def test_chord_through_a_sphere_is_pythagoras(x_mm: float, chord_mm: float) -> None:
    assert ellipsoid((0, 0, 0), (10, 10, 10)).chord(ray(x_mm))[0] == pytest.approx(chord_mm * 1e-3, abs=1e-12)


def test_a_turned_ellipsoid_shows_its_other_axis() -> None:
    quarter = rotation_from_vector((0.0, np.pi / 2, 0.0))
    assert ellipsoid((0, 0, 0), (10, 20, 30)).chord(ray(0))[0] == pytest.approx(0.060)
    assert ellipsoid((0, 0, 0), (10, 20, 30), quarter).chord(ray(0))[0] == pytest.approx(0.020)


def test_a_cylinder_has_flat_ends() -> None:
    rod = cylinder((0, 0, 0), (10, 10, 25))
    assert rod.chord(ray(0))[0] == pytest.approx(0.050)  # along its axis: the full height wherever it enters
    assert rod.chord(ray(9.9))[0] == pytest.approx(0.050)
    assert rod.chord(ray(10.1))[0] == 0.0
    assert rod.chord(ray(0, (1, 0, 1)))[0] == pytest.approx(0.020 * np.sqrt(2))  # oblique, through the sides
    assert rod.chord(ray(0, (1, 0, 0)))[0] == pytest.approx(0.020)  # across


def test_bodies_move_scale_and_shift() -> None:
    ball = ellipsoid((0, 0, 0), (10, 10, 10))
    assert ball.scaled(1.5).chord(ray(0))[0] == pytest.approx(0.030)
    assert ball.shifted(np.array([0.008, 0, 0])).chord(ray(0))[0] == pytest.approx(0.012)
    assert ball.moved(rigid((0, 0, 0.3), (0.006, 0, 0))).chord(ray(0))[0] == pytest.approx(0.016)


def test_a_coarser_grid_covers_the_whole_image() -> None:
    # 10 × 7 pixels in fours: three by two, of which the last reach beyond the image.
    projection = carm_projection(
        0.3, 0.1, source_detector_m=1.2, source_object_m=0.8, pixel_size_m=4e-3, width=10, height=7
    )
    coarse = covering_grid(projection, 4)
    assert (coarse.width, coarse.height) == (3, 2)
    # The second pixel of a row covers columns 4 to 7, the second row rows 4 to 7.
    point = np.array([0.01, 0.02, -0.01])
    assert coarse.project(point) * 4 + 1.5 == pytest.approx(projection.project(point), abs=1e-9)


def test_rays_left_out_miss_the_body() -> None:
    projection = carm_projection(
        0.3, 0.1, source_detector_m=1.2, source_object_m=0.8, pixel_size_m=4e-3, width=48, height=48
    )
    rays = pixel_rays(projection)
    turn = rotation_from_vector((0.4, -0.7, 0.2))
    parts = [
        Additive(ellipsoid((10, 5, 20), (5, 30, 12), turn), 3.0),
        Additive(cylinder((-30, 0, 0), (9, 4, 22), turn), 5.0),
    ]
    every_ray = sum(part.attenuation * part.body.chord(rays) for part in parts)
    assert np.count_nonzero(every_ray) > 50
    assert _added(parts, rays) == pytest.approx(every_ray, abs=1e-15)


def test_a_union_counts_overlaps_once_and_stays_inside_its_container() -> None:
    container = ellipsoid((0, 0, 0), (100, 100, 100))
    ball = ellipsoid((0, 0, 0), (10, 10, 10))
    second = ellipsoid((0, 0, 10), (10, 10, 10))  # overlaps the first by half: 30 mm together
    apart = ellipsoid((0, 0, 50), (5, 5, 5))
    across_the_border = ellipsoid((0, 0, -100), (20, 20, 20))  # half of it is outside
    for contents in ([ball, second, apart, across_the_border], [across_the_border, apart, second, ball, ball]):
        total, covered = union_length(container, contents, ray(0))
        assert total[0] == pytest.approx(0.200)
        assert covered[0] == pytest.approx(0.030 + 0.010 + 0.020)
    assert union_length(container, [], ray(0))[1][0] == 0.0
    assert union_length(container, [ball], ray(150.0)) == (0.0, 0.0)


def test_pixel_rays_go_through_their_pixels() -> None:
    projection = carm_projection(
        0.3, 0.1, source_detector_m=1.2, source_object_m=0.8, pixel_size_m=1e-3, width=5, height=4
    )
    rays = pixel_rays(projection)
    points = rays.source + 0.9 * rays.directions.T
    expected = [(x, y) for y in range(4) for x in range(5)]
    assert projection.project(points) == pytest.approx(np.array(expected, dtype=float), abs=1e-9)
    assert rays.shape == (4, 5)
