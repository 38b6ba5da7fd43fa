"""Windowing: grey values of any bit depth, for the eye."""

import numpy as np
import pytest

from lasso_motion_ros.overlay.windowing import window_image, window_limits


def test_windowing_spans_black_to_white_and_ignores_single_pixels():
    image = np.tile(np.linspace(1000, 3000, 256).astype(np.uint16), (256, 1))
    image[0, 0], image[0, 1] = 0, 65535
    low, high = window_limits(image)
    assert 1000 <= low < 1030
    assert 2970 < high <= 3000
    shown = window_image(image)
    assert shown.dtype == np.uint8
    assert shown[5, 0] == 0
    assert shown[5, -1] == 255
    # The middle of the window is mid-grey, by hand: (2000 − low) / (high − low) · 255.
    assert shown[5, 128] == pytest.approx((image[5, 128] - low) / (high - low) * 255.0, abs=1.0)


def test_windowing_survives_a_flat_image_and_given_limits():
    assert window_image(np.full((20, 20), 77, np.uint8)).max() == 0
    np.testing.assert_array_equal(
        window_image(np.array([[0, 50, 110, 200]], np.uint8), (50.0, 150.0)), [[0, 0, 153, 255]]
    )


@pytest.mark.parametrize("bits", [8, 12, 16])
def test_the_limits_are_numpys_quantiles(bits):
    image = np.random.default_rng(bits).integers(0, 2**bits, (300, 417)).astype(np.uint8 if bits == 8 else np.uint16)
    step = int(np.sqrt(image.size / 65_536))
    assert window_limits(image) == pytest.approx(np.quantile(image[::step, ::step], (0.005, 0.995)))
