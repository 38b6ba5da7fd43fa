"""A ring that several pairs show is the first that is looked at, however it has moved; where there is none, none is."""

from __future__ import annotations

import numpy as np
import pytest
from support.lasso_inputs import CURVE, lasso_pair
from support.tracking_inputs import VIEWS

from lasso_motion_ros.core.errors import GeometryError
from lasso_motion_ros.geometry.frames import Frame, FramePair
from lasso_motion_ros.initialisation.direction_maps import curvature, direction_maps
from lasso_motion_ros.initialisation.ring_search import FoundRings, Layout, search_rings

MOVES = ((0.0, 0.0, 0.0), (1e-3, -2e-3, 7e-3), (2e-3, -3e-3, 15e-3))


def _searched(pairs: list[FramePair]) -> tuple[FoundRings, FoundRings]:
    first = Layout.of(pairs[0], logarithm=True)
    maps = {plane: direction_maps(curvature(one), bright=False) for plane, one in first.laid.items()}
    return search_rings(pairs, first, maps, bright=False)


@pytest.mark.slow
def test_the_first_ring_is_the_one_that_moves_through_all_pairs() -> None:
    told, _ = _searched([lasso_pair(index, move) for index, move in enumerate(MOVES)])
    away = np.linalg.norm(told.rings.points()[0][:, None] - CURVE, axis=2).min(axis=1)
    assert away.mean() < 0.4e-3
    assert told.rareness[0] > 20.0
    alone, _ = _searched([lasso_pair(0), lasso_pair(1, None), lasso_pair(2, None)])
    assert told.rareness[0] > 1.5 * max(alone.rareness, default=0.0)


def test_planes_with_little_in_common_are_said_to_have() -> None:
    strips = {
        "a": VIEWS["a"].read_out(0, 0, 512, 40, 1, 1),
        "b": VIEWS["b"].read_out(0, 460, 512, 40, 1, 1),
    }
    frames = {plane: Frame(0, np.zeros((40, 512), np.uint8), view) for plane, view in strips.items()}
    with pytest.raises(GeometryError, match="mm of height in common"):
        Layout.of(FramePair(0, frames["a"], frames["b"]), logarithm=True)
