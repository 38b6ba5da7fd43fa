"""Any tool that knows K and the pose alone puts a point where the display shows it, after the flip or resampling."""

from __future__ import annotations

import numpy as np
import pytest

from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.standard_camera import standard_camera

WIDTH, HEIGHT = 320, 256
POINTS = np.random.default_rng(2).uniform(-0.04, 0.04, (40, 3))
MIRROR = np.array([[-1.0, 0.0, WIDTH - 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
TURN = np.array([[np.cos(0.4), -np.sin(0.4), 60.0], [np.sin(0.4), np.cos(0.4), -40.0], [0.0, 0.0, 1.0]])
OBLONG = np.diag([1.3, 0.8, 1.0])
SKEW = np.array([[1.0, 0.07, 3.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


def display(*changes: np.ndarray, scale: float = 1.0) -> Projection:
    plain = carm_projection(
        0.5, -0.2, source_detector_m=1.2, source_object_m=0.785, pixel_size_m=0.8e-3, width=WIDTH, height=HEIGHT
    )
    matrix = np.array(plain.matrix)
    for change in changes:
        matrix = change @ matrix
    return Projection(scale * matrix, WIDTH, HEIGHT)


@pytest.mark.parametrize(
    ("changes", "resampled"),
    [((), False), ((MIRROR,), False), ((TURN,), False), ((TURN, MIRROR), False), ((OBLONG, MIRROR), False),
     ((SKEW,), True), ((SKEW, MIRROR), True)],
)  # fmt: skip
@pytest.mark.parametrize("scale", [1.0, -37.0])
def test_k_and_pose_alone_say_where_the_display_shows_a_point(changes: tuple, resampled: bool, scale: float) -> None:
    projection = display(*changes, scale=scale)
    camera = standard_camera(projection)
    # As RViz and Foxglove do it: into the camera's frame, then by K.
    seen = POINTS @ camera.pose[:3, :3].T + camera.pose[:3, 3]
    assert np.all(seen[:, 2] > 0.3)
    pixels = np.column_stack([camera.k[i, i] * seen[:, i] / seen[:, 2] + camera.k[i, 2] for i in (0, 1)])
    shown = np.column_stack([projection.project(POINTS), np.ones(len(POINTS))]) @ camera.to_standard.T
    np.testing.assert_allclose(pixels, shown[:, :2], atol=1e-6)
    assert camera.resampled is resampled
    assert np.linalg.det(camera.pose[:3, :3]) == pytest.approx(1.0)
    assert camera.k[0, 0] > 0 < camera.k[1, 1]
    np.testing.assert_array_equal(camera.k[[0, 1, 2, 2], [1, 0, 0, 1]], 0.0)


@pytest.mark.parametrize("changes", [(), (MIRROR,), (SKEW,), (SKEW, MIRROR)])
def test_the_film_goes_with_it(changes: tuple) -> None:
    """A dark spot in the display's film lies where K and pose say."""
    projection = display(*changes)
    camera = standard_camera(projection)
    point = np.array([0.012, -0.018, 0.015])
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    at = projection.project(point)
    film = np.rint(3000.0 - 2000.0 * np.exp(-((x - at[0]) ** 2 + (y - at[1]) ** 2) / 18.0)).astype(np.uint16)
    standard = camera.image(film)
    assert standard.shape == film.shape
    assert standard.dtype == film.dtype
    weight = np.clip(2900.0 - standard, 0.0, None)
    found = np.array([np.sum(weight * x), np.sum(weight * y)]) / np.sum(weight)
    seen = camera.pose[:3, :3] @ point + camera.pose[:3, 3]
    np.testing.assert_allclose(found, (camera.k @ seen)[:2] / seen[2], atol=0.1)
