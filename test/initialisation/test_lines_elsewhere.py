"""A ring stands out by its lines alone from the same ring laid elsewhere; what lies on noise does not."""

from __future__ import annotations

import numpy as np
import pytest
from support.lasso_inputs import LOOP, lasso_pair

from lasso_motion_ros.core.compiled import has_kernels, plain
from lasso_motion_ros.initialisation.circles import Circles
from lasso_motion_ros.initialisation.direction_maps import DIRECTIONS, DirectionMaps
from lasso_motion_ros.initialisation.laid_image import CELL_M
from lasso_motion_ros.initialisation.laid_pair import LaidPair
from lasso_motion_ros.initialisation.lines_elsewhere import _stand_out, lines_stand_out
from lasso_motion_ros.initialisation.ring_search import Shown
from lasso_motion_ros.initialisation.shaped_rings import ShapedRings

SHOWN = Shown.by(LaidPair.of(lasso_pair(0), bright=False))


def _rings(*asides: tuple[float, float, float]) -> ShapedRings:
    """The drawn ring, moved aside, as circles."""
    count = len(asides)
    centres = LOOP.centre + np.array(asides)
    normals, radii = np.tile(LOOP.normal, (count, 1)), np.full(count, np.linalg.norm(LOOP.semi_major))
    return ShapedRings.of(Circles(centres, normals, radii, np.zeros(count), np.zeros(count)))


def test_the_drawn_ring_stands_out_and_one_beside_it_does_not() -> None:
    there, *beside = lines_stand_out(
        _rings((0.0, 0.0, 0.0), (0.0, 0.0, 6e-3), (5e-3, 5e-3, 0.0)), SHOWN.maps, SHOWN.pair.grid
    )
    assert there > 12.0
    assert max(beside) < 0.5 * there


def test_a_ring_is_seen_where_plane_b_sees_it_higher() -> None:
    rings = _rings((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    rings.lifts[1] = 5e-3  # plane B is asked 5 mm off
    there, off = lines_stand_out(rings, SHOWN.maps, SHOWN.pair.grid)
    assert off < 0.8 * there


def _square(side: int) -> tuple[np.ndarray, np.ndarray]:
    """(1, 36) columns and rows of a curve in the middle of an image of so many cells, m."""
    turn = 2.0 * np.pi * np.arange(36) / 36
    return tuple((CELL_M * (side / 2 + 10.0 * one(turn)))[None] for one in (np.cos, np.sin))


def test_by_standard_deviations_of_what_is_elsewhere() -> None:
    random = np.random.default_rng(0).uniform(0.0, 0.2, (DIRECTIONS, 80, 80)).astype(np.float32)
    maps = DirectionMaps(random, 0.0, 0.0)
    columns, rows = _square(80)
    before = _stand_out(columns, rows, maps)[0]
    assert abs(before) < 3.5
    x, y = np.rint(columns / CELL_M).astype(int), np.rint(rows / CELL_M).astype(int)
    random[:, y, x] += 0.5
    assert _stand_out(columns, rows, DirectionMaps(random, 0.0, 0.0))[0] > before + 10.0


def test_where_nothing_is_nothing_stands_out() -> None:
    assert _stand_out(*_square(80), DirectionMaps(np.zeros((DIRECTIONS, 80, 80), np.float32), 0.0, 0.0))[0] == 0.0


@pytest.mark.skipif(not has_kernels(), reason="the extra `fast` is not installed")
def test_the_compiled_kernel_tells_the_same_at_the_edge_too() -> None:
    rings = _rings((0.0, 0.0, 0.0), (0.0, 3e-3, 5e-3), (0.0, 0.0, 0.06), (0.0, 0.0, 1.0))
    compiled = lines_stand_out(rings, SHOWN.maps, SHOWN.pair.grid)
    with plain():
        np.testing.assert_allclose(compiled, lines_stand_out(rings, SHOWN.maps, SHOWN.pair.grid), atol=1e-4)
    random = np.random.default_rng(1).uniform(0.0, 1.0, (DIRECTIONS, 60, 60)).astype(np.float32)
    maps, (columns, rows) = DirectionMaps(random, 0.0, 0.0), _square(60)
    for aside in (-22.0, 22.0):
        at_edge = columns + aside * CELL_M, rows - aside * CELL_M
        compiled = _stand_out(*at_edge, maps)
        with plain():
            assert compiled == pytest.approx(_stand_out(*at_edge, maps), abs=1e-4)
