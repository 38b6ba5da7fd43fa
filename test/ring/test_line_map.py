"""The line filter's response: what it is in the whole image, worked out where it is asked for only."""

import numpy as np
import pytest
from support.lasso_inputs import LOOP, VIEWS, lasso_curve, lasso_image, noisy

from lasso_motion_ros.geometry.frames import Frame
from lasso_motion_ros.ring.line_map import LineMap
from lasso_motion_ros.seeding.line_filter import sato
from lasso_motion_ros.seeding.outlines import line_sigma_px

SIGMA_MM = 0.3
VIEW = VIEWS["a"]
FRAME = Frame(0, noisy(lasso_image(lasso_curve(1.0), VIEW), 1), VIEW)


def whole_response(*, bright):
    grey = FRAME.pixels.astype(np.float32)
    return sato(-grey if bright else grey, (line_sigma_px(VIEW, SIGMA_MM),))


@pytest.mark.parametrize("bright", [False, True])
def test_it_is_that_of_the_whole_image_wherever_one_asks(bright):
    lines, whole = LineMap(FRAME, bright=bright, sigma_mm=SIGMA_MM), whole_response(bright=bright)
    height, width = whole.shape
    middle = VIEW.project(LOOP.centre)
    corner_of_image = np.array([[0.0, 0.0], [5.0, 7.0]])
    for pixels in (
        middle + np.array([[-20.0, -9.0], [14.0, 25.0]]),
        middle + np.array([[60.0, 0.0], [70.0, 3.0]]),
        corner_of_image,
    ):
        response, corner = lines.about(pixels)
        for x, y in np.rint(pixels).astype(int):
            # What lies beside a curve there, too.
            rows, columns = slice(max(y - 7, 0), min(y + 8, height)), slice(max(x - 7, 0), min(x + 8, width))
            part = response[rows.start - corner[1] : rows.stop - corner[1], columns.start - corner[0] :]
            np.testing.assert_allclose(
                part[:, : columns.stop - columns.start], whole[rows, columns], atol=1e-4 * whole.max()
            )


def test_what_was_asked_for_is_not_filtered_again():
    lines, middle = LineMap(FRAME, bright=False, sigma_mm=SIGMA_MM), VIEW.project(LOOP.centre)
    first, _ = lines.about(middle + np.array([[-30.0, -30.0], [30.0, 30.0]]))
    again, _ = lines.about(middle + np.array([[-40.0, -20.0], [20.0, 40.0]]))
    assert again is first
    assert first.size < 0.5 * FRAME.pixels.size


def test_a_curve_beside_the_image_has_the_border_s():
    response, _ = LineMap(FRAME, bright=False, sigma_mm=SIGMA_MM).about(np.array([[-90.0, 50.0], [-60.0, 80.0]]))
    assert response.size > 0
