"""The evidence of electrodes in an image: high where they are, low elsewhere, the same at every size and polarity."""

import cv2
import numpy as np
import pytest

from lasso_motion_ros.phantom.shown_poles import EVIDENCE, pole_evidence

PIXEL_MM = 0.25
ANGLE = np.linspace(0.0, 5.6, 10)
POLES = np.stack([128.0 + 40.0 * np.cos(ANGLE), 120.0 + 26.0 * np.sin(ANGLE)], axis=1)


def picture(contrast: float, noise: float = 4.0, poles: np.ndarray = POLES, factor: int = 1) -> np.ndarray:
    """A grey field with dark electrodes of 1.2 mm."""
    image = np.full((256 * factor, 256 * factor), 140.0, np.float32)
    for pole in poles:
        rows, columns = np.indices(image.shape)
        squared = (columns - factor * pole[0]) ** 2 + (rows - factor * pole[1]) ** 2
        image -= contrast * np.exp(-squared / (2.0 * (0.5 * factor / PIXEL_MM) ** 2))
    image += np.random.default_rng(1).normal(0.0, noise, image.shape)
    return np.clip(image, 0, 255).astype(np.uint8)


def test_plain_electrodes_are_plain_and_absent_ones_are_not() -> None:
    assert pole_evidence(picture(60.0), POLES, PIXEL_MM) > 1.9
    assert abs(pole_evidence(picture(0.0), POLES, PIXEL_MM)) < 0.5
    assert pole_evidence(picture(60.0), np.add(POLES, [9.0, 7.0]), PIXEL_MM) < 0.6
    faint = pole_evidence(picture(3.0, noise=12.0), POLES, PIXEL_MM)
    assert 0.4 < faint < EVIDENCE.plain


def test_one_very_dark_thing_does_not_make_up_for_the_others() -> None:
    assert pole_evidence(picture(130.0, poles=POLES[:1]), POLES, PIXEL_MM) < 0.6


def test_it_does_not_depend_on_magnification_gain_or_polarity() -> None:
    reference = pole_evidence(picture(2.0), POLES, PIXEL_MM)
    assert 1.2 < reference < 1.7
    large = cv2.GaussianBlur(picture(2.0, factor=2, noise=8.0), (0, 0), 0.5)
    assert pole_evidence(large, 2.0 * POLES, 0.5 * PIXEL_MM) == pytest.approx(reference, abs=0.2)
    darker = (0.6 * picture(2.0)).astype(np.uint8)
    assert pole_evidence(darker, POLES, PIXEL_MM) == pytest.approx(reference, abs=0.1)
    assert pole_evidence(255 - picture(60.0), POLES, PIXEL_MM, dark=False) > 1.9
    assert pole_evidence(255 - picture(60.0), POLES, PIXEL_MM) < -0.5


def test_what_is_outside_the_image_is_not_seen() -> None:
    outside = np.add(POLES, [300.0, 0.0])
    assert pole_evidence(picture(60.0), outside, PIXEL_MM) == -1.0
    half = np.vstack([POLES[:5], outside[:5]])
    assert pole_evidence(picture(60.0), half, PIXEL_MM) == pytest.approx(0.5, abs=0.15)
    assert pole_evidence(picture(60.0), np.zeros((0, 2)), PIXEL_MM) == -1.0
