"""The band about the outline holds the share of the error that it says, vertex by vertex."""

from __future__ import annotations

import numpy as np
import pytest
from support.drawn_recording import SIDE, projections

from lasso_motion_ros.geometry.covariance import at_point, at_world_origin
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import apply, rigid
from lasso_motion_ros.overlay.atrium import left_atrium_surface
from lasso_motion_ros.overlay.error_band import error_band, pixel_covariances
from lasso_motion_ros.overlay.painter import OverlayPainter
from lasso_motion_ros.overlay.silhouette import silhouette
from lasso_motion_ros.overlay.style import OverlayStyle

MOTION = rigid((0.02, 0.01, -0.03), (0.002, -0.003, 0.010))
CENTRE = np.array([0.024, 0.009, 0.014])
# 0.5 mm across, 1.2 mm along y, and a turn about the lasso of 1.5° about x: unequal in every respect.
COVARIANCE = at_world_origin(CENTRE, np.diag([0.25e-6, 1.44e-6, 0.25e-6]), np.diag([6.9e-4, 1e-4, 1e-4]))


@pytest.fixture(scope="module")
def surface():
    return left_atrium_surface(4.0)


def mirrored(projection: Projection) -> Projection:
    flip = np.array([[-1.0, 0.0, projection.width - 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    return Projection(flip @ projection.matrix, projection.width, projection.height)


def test_a_pixels_covariance_is_that_of_its_own_point() -> None:
    projection = projections()["a"]
    points = np.array([[0.03, 0.01, -0.02], [-0.02, 0.02, 0.01]])
    found = pixel_covariances(COVARIANCE, points, projection)
    for point, covariance in zip(points, found, strict=True):
        to_pixels = projection.jacobian(point)
        np.testing.assert_allclose(covariance, to_pixels @ at_point(COVARIANCE, point) @ to_pixels.T, rtol=1e-9)


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("plane", ["a", "b"])
def test_95_of_100_errors_put_an_outlines_point_into_its_ellipse(surface, plane: str, mirror: bool) -> None:
    """Errors drawn from the covariance, applied whole to the surface: where its outline's points come to lie."""
    projection = mirrored(projections()[plane]) if mirror else projections()[plane]
    shape = silhouette(surface, projection, MOTION)
    vertices = np.unique(shape.ends)[::7]
    now = apply(MOTION, surface.vertices[vertices])
    errors = np.random.default_rng(5).multivariate_normal(np.zeros(6), COVARIANCE, size=2000)
    inverse = np.linalg.inv(pixel_covariances(COVARIANCE, now, projection))
    places = projection.project(now)
    inside = []
    for error in errors:
        off = projection.project(apply(rigid(error[3:], error[:3]), now)) - places
        inside.append(np.einsum("ni,nij,nj->n", off, inverse, off) <= 5.991)
    assert np.mean(inside) == pytest.approx(0.95, abs=0.01)


def test_the_band_is_as_wide_as_its_own_vertices_errors(surface) -> None:
    """Across an even covariance it is 2.45 standard deviations to either side; far from the lasso a turn widens it."""
    projection = projections()["a"]
    shape = silhouette(surface, projection, np.eye(4))
    sigma_m = 2.4e-3
    even = error_band(surface, shape, projection, np.eye(4), np.diag([sigma_m**2] * 3 + [0.0] * 3))
    expected = 2.448 * sigma_m * projection.focal_length_px / projection.depth(np.zeros(3))
    for side in (np.min, np.max):  # where the outline is level
        outline = side(np.nonzero(shape.coverage > 0.5)[0]) + shape.top
        assert abs(side(np.nonzero(even.opacity > 30)[0]) + even.top - outline) == pytest.approx(expected, rel=0.08)
    turned = error_band(
        surface, shape, projection, np.eye(4), at_world_origin(CENTRE, np.eye(3) * 1e-8, np.eye(3) * 2e-3)
    )
    rows, columns = np.nonzero(turned.opacity)
    columns, rows = columns + turned.left, rows + turned.top
    at_lasso = np.hypot(*(np.column_stack([columns, rows]) - projection.project(CENTRE)).T) < 25
    far = np.hypot(*(np.column_stack([columns, rows]) - projection.project(-CENTRE)).T) < 45
    assert np.count_nonzero(far) > 5 * max(np.count_nonzero(at_lasso), 1)


def test_it_is_drawn_by_default_named_and_can_be_left_out(surface) -> None:
    projection = projections()["a"]
    film = np.full((SIDE, SIDE), 130, np.uint8)

    def draw(covariance: np.ndarray | None, **style: bool) -> np.ndarray:
        return OverlayPainter(surface, OverlayStyle(**style)).draw(film, projection, MOTION, covariance=covariance)

    with_band = draw(COVARIANCE)
    assert not np.array_equal(with_band, draw(None))
    np.testing.assert_array_equal(draw(COVARIANCE, error_band=False), draw(None))
    # Never where nothing is compensated.
    painter = OverlayPainter(surface)
    np.testing.assert_array_equal(
        painter.draw(film, projection, None, "LOST", covariance=COVARIANCE),
        painter.draw(film, projection, None, "LOST"),
    )
