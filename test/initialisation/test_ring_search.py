"""A ring that several pairs show is the first that is looked at, however it has moved; where there is none, none is."""

from __future__ import annotations

import numpy as np
import pytest
from support.lasso_inputs import CURVE, lasso_pair

from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.initialisation.laid_pair import LaidPair
from lasso_motion_ros.initialisation.ring_search import FoundRings, Shown, search_rings

MOVES = ((0.0, 0.0, 0.0), (1e-3, -2e-3, 7e-3), (2e-3, -3e-3, 15e-3))


def _searched(pairs: list[FramePair]) -> tuple[FoundRings, FoundRings]:
    laid = [LaidPair.of(one, bright=False) for one in pairs]
    return search_rings(laid, [Shown.by(laid[0])])


@pytest.mark.slow
def test_the_first_ring_is_the_one_that_moves_through_all_pairs() -> None:
    told, _ = _searched([lasso_pair(index, move) for index, move in enumerate(MOVES)])
    away = np.linalg.norm(told.rings.points()[0][:, None] - CURVE, axis=2).min(axis=1)
    assert away.mean() < 0.4e-3
    assert told.rareness[0] > 20.0
    alone, _ = _searched([lasso_pair(0), lasso_pair(1, None), lasso_pair(2, None)])
    assert told.rareness[0] > 1.5 * max(alone.rareness, default=0.0)


@pytest.mark.slow
def test_what_something_else_shows_of_the_first_pair_s_rings_is_searched_too() -> None:
    pairs = [lasso_pair(index, move, sigma=9.0) for index, move in enumerate(MOVES)]
    laid = [LaidPair.of(one, bright=False) for one in pairs]
    nothing = LaidPair.of(lasso_pair(9, None), bright=False)
    told, lined = search_rings(laid, [Shown.by(nothing), Shown.by(laid[0])])
    for rings in (told.rings[:1], lined.rings):
        away = np.linalg.norm(rings.points()[:, :, None] - CURVE, axis=3).min(axis=2).mean(axis=1)
        assert away.min() < 1.2e-3
