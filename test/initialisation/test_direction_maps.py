"""Pictures whose catheters are bright are told from those whose catheters are dark."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.lasso_inputs import CURVE, lasso_image, noisy
from support.tracking_inputs import VIEWS

from lasso_motion_ros.geometry.frames import Frame
from lasso_motion_ros.initialisation.direction_maps import are_catheters_bright, curvature
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid
from lasso_motion_ros.initialisation.laid_image import LaidImage, row_range

ELSEWHERE = np.array([0.0, 0.0, 0.5])


def _faint_lasso(plane: str, *, inverted: bool) -> np.ndarray:
    """uint8 image of a faint lasso, in an inverted display bright and with lungs beside it that are all but black."""
    view = VIEWS[plane]
    background, lasso = (lasso_image(curve, view).astype(np.float64) for curve in (CURVE + ELSEWHERE, CURVE))
    image = background + 0.18 * (lasso - background)
    if inverted:
        columns = np.arange(view.width) / view.width
        lungs = sum(np.exp(-0.5 * ((columns - middle) / 0.15) ** 2) for middle in (0.1, 0.9))
        image = (255.0 - image) * np.clip(1.0 - 0.95 * lungs, 0.0, 1.0)
    return noisy(image.astype(np.uint8), ord(plane))


@pytest.mark.parametrize("bright", [False, True])
def test_electrodes_are_what_stands_out_most_whether_they_are_dark_or_bright(bright: bool) -> None:
    grid = EpipolarGrid.of(VIEWS)
    frames = {plane: Frame(0, _faint_lasso(plane, inverted=bright), view) for plane, view in VIEWS.items()}
    rows = row_range(frames, grid)
    seen = [curvature(LaidImage.of(frame, p, grid, rows, logarithm=False)) for p, frame in frames.items()]
    assert all((one.brightness > 0.0) is bright for one in seen)
    assert are_catheters_bright(seen, other=False) is bright
    assert are_catheters_bright(seen, other=True) is bright  # that is not in doubt
    blank = [replace(one, xx=0.0 * one.xx, yy=0.0 * one.yy) for one in seen]
    assert are_catheters_bright(blank, other=True) is not are_catheters_bright(blank, other=False)
