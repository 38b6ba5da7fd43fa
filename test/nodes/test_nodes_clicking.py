"""Clicks on a frozen pair become a seed, or are refused with the reason."""

from __future__ import annotations

import numpy as np
import pytest

from lasso_motion_ros.core.errors import SeedError
from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair
from lasso_motion_ros.nodes.clicking import ClickBoard
from lasso_motion_ros.stream.drawn_ring import ring_image, ring_projection

SIDE = 128
IMAGES = {plane: ring_image(plane, SIDE, np.zeros(3), np.random.default_rng(0)) for plane in PLANES}
PAIR = FramePair(5, *(Frame(5, IMAGES[plane], ring_projection(plane, SIDE)) for plane in PLANES))


def test_clicks_are_kept_in_order() -> None:
    board = ClickBoard()
    board.freeze(PAIR)
    for plane, shift in zip(PLANES, (0.0, 1.5), strict=True):
        for number in range(6):
            board.click(plane, 10.0 * number, shift)
    seed = board.seed()
    np.testing.assert_array_equal(seed.points_a, [[10.0 * number, 0.0] for number in range(6)])
    np.testing.assert_array_equal(seed.points_b[:, 1], 1.5)
    board.freeze(PAIR)
    assert board.clicks("a").shape == (0, 2)


@pytest.mark.parametrize("at", [(-0.6, 5.0), (5.0, 127.5), (np.nan, 5.0), (np.inf, 5.0)])
def test_a_click_beside_the_picture_is_refused(at: tuple[float, float]) -> None:
    board = ClickBoard()
    board.freeze(PAIR)
    with pytest.raises(SeedError, match="the picture has 128×128 pixels"):
        board.click("a", *at)


def test_what_is_not_frozen_cannot_be_clicked() -> None:
    board = ClickBoard()
    for act in (lambda: board.click("a", 1.0, 1.0), board.seed):
        with pytest.raises(SeedError, match="call ~/freeze"):
            act()


def test_too_few_clicks_are_named() -> None:
    board = ClickBoard()
    board.freeze(PAIR)
    for number in range(6):
        board.click("a", number, number)
    with pytest.raises(SeedError, match="plane B: expected 6 or more clicks along the loop, found 0"):
        board.seed()
