"""What moves in a plane is followed from image to image, block by block, beside what stands still."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from lasso_motion_ros.initialisation.block_motion import Blocks
from lasso_motion_ros.initialisation.electrode_spots import electrode_band
from lasso_motion_ros.initialisation.laid_image import CELL_M, LaidImage

SIDE = 260  # cells


def _scattered(seed: int, count: int) -> np.ndarray:
    """(SIDE, SIDE) dark spots as large as electrodes, in the middle."""
    random = np.random.default_rng(seed)
    image = np.zeros((SIDE, SIDE), np.float32)
    y, x = random.integers(70, SIDE - 70, (2, count))
    image[y, x] = -25.0
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 1.1))


def _image(moved_cells: tuple[float, float], *, still: int = 40, noise: int = 0, left: float = 0.0) -> LaidImage:
    """Spots that have moved, others that stand still, and noise."""
    to = np.array([[1.0, 0.0, moved_cells[0]], [0.0, 1.0, moved_cells[1]]])
    values = cv2.warpAffine(_scattered(1, 60), to, (SIDE, SIDE)) + _scattered(2, still)
    values += cv2.GaussianBlur(np.random.default_rng(noise).normal(0.0, 1.0, values.shape), (0, 0), 0.6)
    return LaidImage(values.astype(np.float32), np.ones((SIDE, SIDE), np.float32), left, 0.0)


def _moved(first: LaidImage, later: LaidImage) -> np.ndarray:
    """(2,) cells by which the middle has moved."""
    blocks = Blocks.of(first, electrode_band(first, bright=False))
    motion = blocks.until(later, electrode_band(later, bright=False))
    return motion.at(np.full(2, 0.5 * SIDE * CELL_M)) / CELL_M


@pytest.mark.parametrize("move", [(0.0, 0.0), (1.4, 0.0), (-3.0, 7.0), (6.0, -24.0)])
def test_what_moves_is_told_beside_what_stands_still(move: tuple[float, float]) -> None:
    assert _moved(_image((0.0, 0.0)), _image(move, noise=1)) == pytest.approx(move, abs=1.2)


def test_where_nothing_moves_nothing_has_moved() -> None:
    assert _moved(_image((0.0, 0.0)), _image((0.0, 0.0), noise=1)) == pytest.approx([0.0, 0.0], abs=0.2)


def test_an_image_that_begins_elsewhere_is_compared_at_the_same_places() -> None:
    later = _image((4.0, 2.0), noise=1, left=6 * CELL_M)
    assert _moved(_image((0.0, 0.0)), later) == pytest.approx([10.0, 2.0], abs=1.2)


def test_images_that_show_nothing_say_of_no_motion_that_is_not_a_number() -> None:
    blank = LaidImage(np.full((SIDE, SIDE), 4.0, np.float32), np.ones((SIDE, SIDE), np.float32), 0.0, 0.0)
    assert np.isfinite(_moved(blank, blank)).all()
