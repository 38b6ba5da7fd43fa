"""Electrodes are spots in both planes, and points in space where both show one at one height."""

from __future__ import annotations

import numpy as np
import pytest
from support.lasso_inputs import CURVE, lasso_image, noisy
from support.tracking_inputs import VIEWS

from lasso_motion_ros.geometry.frames import Frame
from lasso_motion_ros.initialisation.electrode_spots import Spots, electrode_band, electrode_spots, points_of
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid
from lasso_motion_ros.initialisation.laid_image import LaidImage, row_range

GRID = EpipolarGrid.of(VIEWS)
ELECTRODES = 10
# Where `lasso_image` draws them.
POLES = CURVE[((np.arange(ELECTRODES) + 0.4) / ELECTRODES * len(CURVE)).astype(int)]


def _spots(*, bright: bool = False) -> dict[str, Spots]:
    images = {plane: noisy(lasso_image(CURVE, view), ord(plane)) for plane, view in VIEWS.items()}
    frames = {p: Frame(0, 255 - image if bright else image, VIEWS[p]) for p, image in images.items()}
    rows = row_range(frames, GRID)
    laid = {p: LaidImage.of(frame, p, GRID, rows, logarithm=not bright) for p, frame in frames.items()}
    return {plane: electrode_spots(one, electrode_band(one, bright=bright)) for plane, one in laid.items()}


@pytest.mark.parametrize("bright", [False, True])
def test_each_electrode_is_a_point_that_both_planes_show(bright: bool) -> None:
    points = points_of(_spots(bright=bright), GRID, 1e-3)
    strong = points[points.strengths > 2.0]
    away = np.linalg.norm(strong.places[:, None] - POLES, axis=2).min(axis=0)
    # The loop's ends overlap: the first electrode and the last make one spot.
    assert (away[1:-1] < 0.5e-3).all()


def test_spots_at_one_height_are_points_and_tell_by_how_much_plane_b_sees_them_higher() -> None:
    place = np.array([[0.004, -0.003, 0.006]])
    (column_a, row_a), (column_b, row_b) = (GRID.lay(plane, place) for plane in ("a", "b"))
    a = Spots(column_a, row_a, np.array([2.0]))
    lifts = np.array([0.5e-3, -1.2e-3, 0.9e-3])
    b = Spots(np.repeat(column_b, 3), row_b + lifts, np.array([3.0, 3.0, 1.6]))
    points = points_of({"a": a, "b": b}, GRID, 1e-3)
    # The second is too far off; the others lie at plane A's height, as strong as the fainter spot.
    assert sorted(points.lifts) == pytest.approx([0.5e-3, 0.9e-3])
    assert points.places == pytest.approx(np.repeat(place, 2, axis=0), abs=1e-9)
    assert dict(zip(points.spots[:, 1].tolist(), points.strengths, strict=True)) == {0: 2.0, 2: 1.6}
    assert points.spots[:, 0].tolist() == [0, 0]


def test_a_blank_image_has_no_spots() -> None:
    blank = LaidImage(np.full((60, 60), 4.0, np.float32), np.ones((60, 60), np.float32), 0.0, 0.0)
    spots = electrode_spots(blank, electrode_band(blank, bright=False))
    assert len(spots.rows) == 0
    assert len(points_of({"a": spots, "b": spots}, GRID, 1e-3)) == 0
