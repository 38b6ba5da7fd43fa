"""A grid's rows are epipolar planes: what both planes show of a point lies in one row of both."""

from __future__ import annotations

import numpy as np
import pytest
from support.tracking_inputs import VIEWS

from lasso_motion_ros.core.errors import GeometryError
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid

POINTS = 0.04 * np.random.default_rng(3).uniform(-1.0, 1.0, (20, 3))


def test_a_point_is_in_one_row_of_both_planes_and_comes_back_from_there() -> None:
    grid = EpipolarGrid.of(VIEWS)
    columns, rows = {}, {}
    for plane in VIEWS:
        columns[plane], rows[plane] = grid.lay(plane, POINTS)
    assert rows["a"] == pytest.approx(rows["b"], abs=1e-9)
    assert grid.places(columns, rows["a"]) == pytest.approx(POINTS, abs=1e-9)


def test_a_cell_of_the_grid_is_seen_by_its_plane_where_it_is_laid() -> None:
    grid = EpipolarGrid.of(VIEWS)
    columns, rows = np.linspace(-0.03, 0.03, 4), np.linspace(-0.02, 0.02, 3)
    for plane in VIEWS:
        back = grid.lay(plane, grid.points(plane, columns, rows))
        assert back[0] == pytest.approx(np.broadcast_to(columns, (3, 4)), abs=1e-9)
        assert back[1] == pytest.approx(np.broadcast_to(rows[:, None], (3, 4)), abs=1e-9)


def test_sums_of_vectors_are_laid_as_the_points_that_they_make() -> None:
    grid = EpipolarGrid.of(VIEWS)
    axes, shares = POINTS[:18].reshape(6, 3, 3), np.array([[1.0, 1.0], [0.3, -0.7], [-1.2, 0.1]])
    points = np.einsum("nki,kp->npi", axes, shares)
    for plane in VIEWS:
        laid = np.stack(grid.lay_along(plane, axes, shares))
        assert laid == pytest.approx(np.stack(grid.lay(plane, points)), abs=1e-12)


def test_two_planes_that_look_from_one_side_have_no_grid() -> None:
    with pytest.raises(GeometryError, match="parallel"):
        EpipolarGrid.of({"a": VIEWS["a"], "b": VIEWS["a"]})
