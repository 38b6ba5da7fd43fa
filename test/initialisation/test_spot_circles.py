"""Circles are led through three electrodes, and those along which both planes show spots come first."""

from __future__ import annotations

import numpy as np
import pytest
from support.tracking_inputs import VIEWS

from lasso_motion_ros.initialisation.circles import Circles
from lasso_motion_ros.initialisation.electrode_spots import Spots, points_of
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid
from lasso_motion_ros.initialisation.spot_circles import _circumcircles, circles_of_spots, spotted

GRID = EpipolarGrid.of(VIEWS)
TRUE = Circles(
    np.array([[0.004, -0.006, 0.002]]), np.array([[0.48, 0.6, 0.64]]), np.array([0.0105]), np.zeros(1), np.zeros(1)
)
POLES = TRUE.points(2.0 * np.pi * np.arange(10) / 10)[0]


def _spots(places: np.ndarray) -> dict[str, Spots]:
    laid = {plane: GRID.lay(plane, places) for plane in VIEWS}
    return {plane: Spots(columns, rows, np.full(len(rows), 2.5)) for plane, (columns, rows) in laid.items()}


def test_the_first_circle_goes_through_all_electrodes_of_a_ring() -> None:
    clutter = np.random.default_rng(1).uniform(-0.05, 0.05, (60, 3))
    spots = _spots(np.concatenate([POLES, clutter]))
    best = circles_of_spots(points_of(spots, GRID, 0.3e-3), spots, GRID)
    assert best.centres[0] == pytest.approx(TRUE.centres[0], abs=0.8e-3)
    assert best.radii[0] == pytest.approx(TRUE.radii[0], abs=0.8e-3)
    assert abs(best.normals[0] @ TRUE.normals[0]) > 0.99
    assert best.scores[0] > 2.0


def test_a_circle_is_worth_what_both_planes_show_along_it() -> None:
    both = _spots(POLES)
    # Ten poles in twelve sectors of a circle.
    assert spotted(TRUE, both, GRID).scores[0] == pytest.approx(2.5 * 10 / 12, abs=2.5 * 2.01 / 12)
    one = {"a": both["a"], "b": _spots(POLES + 0.2)["b"]}
    assert spotted(TRUE, one, GRID).scores[0] == 0.0


def test_without_three_points_there_is_no_circle() -> None:
    spots = _spots(POLES[:2])
    assert len(circles_of_spots(points_of(spots, GRID, 0.3e-3), spots, GRID)) == 0
    assert len(circles_of_spots(points_of(_spots(POLES[:0]), GRID, 0.3e-3), _spots(POLES[:0]), GRID)) == 0


def test_the_circle_through_three_points() -> None:
    # Through the origin, (2, 0) and (1, 1) mm: about (1, 0) mm. Three points in a line have none.
    u, v = 1e-3 * np.array([[2.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), 1e-3 * np.array([[1.0, 1.0, 0.0], [4.0, 0.0, 0.0]])
    middle, normals, is_open = _circumcircles(u, v)
    assert middle[0] == pytest.approx([1e-3, 0.0, 0.0])
    assert normals[0] == pytest.approx([0.0, 0.0, 1.0])
    assert is_open.tolist() == [True, False]
