import numpy as np
import pytest

from lasso_motion_ros.seeding.line_filter import sato

DEPTH = 80.0


def line(width, turn_deg=0.0, side=121, bright=False):
    """A line of Gaussian profile through the middle, 0 to DEPTH below (or above) 200."""
    y, x = np.mgrid[:side, :side] - side // 2
    turn = np.radians(turn_deg)
    across = np.cos(turn) * x + np.sin(turn) * y
    return 200.0 + (DEPTH if bright else -DEPTH) * np.exp(-0.5 * (across / width) ** 2)


@pytest.mark.parametrize("width", [1.5, 2.0, 3.0])
@pytest.mark.parametrize("sigma", [1.5, 2.5, 4.0])
def test_response_on_a_line_of_gaussian_profile(width, sigma):
    # Blurring widens w to s = √(w² + σ²) and lowers the depth to A w / s; its curvature is A w / s³, times σ².
    expected = DEPTH * width * sigma**2 / (width**2 + sigma**2) ** 1.5
    # Kernels end at 3.5 σ and are exact on parabolas instead, which costs up to 3 %.
    assert sato(line(width), [sigma])[60, 60] == pytest.approx(expected, rel=0.03)


def test_response_is_largest_at_the_scale_of_the_line():
    # d/dσ of the above is zero at σ = √2 w, where it is 2 A / 3^1.5.
    sigmas = np.geomspace(1.0, 8.0, 25)
    responses = [sato(line(2.0), [s])[60, 60] for s in sigmas]
    assert sigmas[np.argmax(responses)] == pytest.approx(2.0 * np.sqrt(2.0), rel=0.1)
    assert max(responses) == pytest.approx(2.0 * DEPTH / 3**1.5, rel=0.03)


@pytest.mark.parametrize("turn_deg", [0.0, 20.0, 45.0, 90.0, 150.0])
def test_response_does_not_depend_on_direction(turn_deg):
    straight, turned = (sato(line(2.0, angle), [2.0])[60, 60] for angle in (0.0, turn_deg))
    assert turned == pytest.approx(straight, rel=0.02)


def test_several_scales_give_the_largest_of_each():
    image = line(2.0) + line(4.0, 90.0)
    together = sato(image, [1.5, 3.0, 6.0])
    np.testing.assert_array_equal(together, np.max([sato(image, [s]) for s in (1.5, 3.0, 6.0)], axis=0))


def test_a_bright_line_gives_nothing_until_it_is_negated():
    image = line(2.0, bright=True)
    assert sato(image, [2.0])[60, 60] == pytest.approx(0.0, abs=0.01)
    np.testing.assert_allclose(sato(-image, [2.0])[60, 60], sato(line(2.0), [2.0])[60, 60], rtol=1e-4)


def test_a_constant_and_a_ramp_give_nothing():
    y, x = np.mgrid[:101, :101].astype(float)
    inner = (slice(30, 71), slice(30, 71))  # away from the border, where a ramp's reflection has a kink
    assert sato(np.full((101, 101), 4000.0), [1.5, 3.0]).max() < 0.02
    assert sato(3.0 * x - 2.0 * y + 50.0, [1.5, 3.0])[inner].max() < 0.01


def test_a_valley_responds_with_its_curvature():
    # Second derivative of x² is 2, times σ².
    y, x = np.mgrid[:101, :101].astype(float) - 50.0
    assert sato(x * x, [2.0])[50, 50] == pytest.approx(8.0, rel=1e-3)
    # A saddle xy has the eigenvalues ±1.
    assert sato(x * y, [2.0])[50, 50] == pytest.approx(4.0, rel=1e-3)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float64])
def test_any_pixel_type(dtype):
    image = np.rint(line(2.0)).astype(dtype)
    response = sato(image, [2.0])
    assert response.dtype == np.float32
    assert response.shape == image.shape
    assert response.min() >= 0.0
    assert response[60, 60] > 25.0
