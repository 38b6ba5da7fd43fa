"""Brightness and contrast of pictures that somebody else has windowed: film as ours, colours kept."""

import colorsys

import numpy as np
import pytest

from lasso_motion_ros.web.picture_encoder import relit, windowed
from lasso_motion_ros.web.protocol import Window


def test_nothing_asked_nothing_done() -> None:
    picture = np.zeros((2, 2, 3), np.uint8)
    assert relit(picture, Window()) is picture


def test_by_hand() -> None:
    grey = np.array([[[0] * 3, [64] * 3, [128] * 3, [255] * 3]], np.uint8)
    # Half the half range brighter: 63.75 more. Twice the contrast: the middle, 127.5, stays.
    assert relit(grey, Window(0.5, 1.0))[0, :, 0].tolist() == [64, 128, 192, 255]
    assert relit(grey, Window(0.0, 2.0))[0, :, 0].tolist() == [0, 0, 128, 255]
    assert relit(grey, Window(0.0, 0.5))[0, :, 0].tolist() == [64, 96, 128, 191]


@pytest.mark.parametrize("window", [Window(0.3, 1.4), Window(-0.6, 0.7), Window(1.0, 5.0), Window(-1.0, 0.2)])
def test_film_is_as_if_we_had_windowed_it(window: Window) -> None:
    film = np.tile(np.arange(256, dtype=np.uint8), (256, 1))
    film[0], film[1] = 0, 255  # so that half a percent at either end is black and white: the window is 0 to 255
    coloured = relit(np.repeat(film[..., None], 3, axis=2), window)
    assert np.ptp(coloured.astype(int), axis=2).max() == 0
    np.testing.assert_allclose(coloured[..., 0], windowed(film, window).astype(float), atol=4)


def test_what_is_drawn_keeps_its_hue() -> None:
    green = np.full((1, 1, 3), (60, 190, 110), np.uint8)
    for window in (Window(0.2, 1.0), Window(-0.2, 1.0), Window(0.0, 1.3)):
        (shown,) = relit(green, window)[0]
        hues = [colorsys.rgb_to_hsv(*(colour / 255.0))[0] for colour in (green[0, 0], shown)]
        assert hues[1] == pytest.approx(hues[0], abs=0.01)
