import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from support.method_inputs import draw_curve

from lasso_motion_ros.brost2009.features import DistanceMap, distance_map, equalise, line_mask, region_of_interest
from lasso_motion_ros.config.brost2009 import FeatureConfig

CONFIG = FeatureConfig()


@pytest.mark.parametrize(
    ("centre", "rows", "columns"),
    [
        ((100.0, 50.0), (30, 70), (80, 120)),
        ((99.6, 50.4), (30, 70), (80, 120)),  # the nearest pixel
        ((10.0, 10.0), (0, 40), (0, 40)),
        ((195.0, 90.0), (60, 100), (160, 200)),
        ((-500.0, 1e6), (60, 100), (0, 40)),
    ],
)
def test_region_is_shifted_into_the_image(centre, rows, columns):
    found = region_of_interest((100, 200), np.array(centre), 40)
    assert found == (slice(*rows), slice(*columns))


def test_region_larger_than_the_image_is_the_image():
    assert region_of_interest((100, 200), np.array([5.0, 5.0]), 150) == (slice(0, 100), slice(0, 150))
    assert region_of_interest((100, 200), np.array([5.0, 5.0]), 400) == (slice(0, 100), slice(0, 200))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_equalisation_by_hand(dtype):
    # Cumulative counts 2, 3, 4, less the first 2, of the remaining 2: 0, 1/2 and 1 of 255; 127.5 rounds to even.
    image = np.array([[10, 10], [20, 30]], dtype)
    np.testing.assert_array_equal(equalise(image), [[0, 0], [128, 255]])
    assert equalise(image).dtype == np.uint8


@given(arrays(np.uint8, (12, 15)), st.integers(1, 200))
def test_equalisation_of_deep_images_is_that_of_shallow_ones(image, factor):
    # Only the order of the grey levels counts.
    shallow, deep = equalise(image), equalise(image.astype(np.uint16) * factor)
    if image.min() < image.max():
        assert np.abs(shallow.astype(int) - deep.astype(int)).max() <= 1
    else:
        assert deep.min() == deep.max()


def test_deep_images_are_not_cut_to_eight_bits_first():
    # Two levels 1/4096 apart come out black and white.
    image = np.array([[2000, 2000], [2001, 2001]], np.uint16)
    np.testing.assert_array_equal(equalise(image), [[0, 0], [255, 255]])


def test_otsu_separates_two_populations():
    random = np.random.default_rng(4)
    response = random.normal(2.0, 0.3, size=(80, 80)).astype(np.float32)
    response[20:24] = random.normal(10.0, 0.5, size=(4, 80))
    mask = line_mask(response)
    assert set(np.unique(mask)) == {0, 255}
    assert np.all(mask[20:24] == 255)
    assert np.count_nonzero(mask) == 4 * 80


def test_a_few_very_strong_pixels_do_not_hide_the_lines():
    response = np.ones((80, 80), np.float32)
    response[20:24] = 10.0
    response[50, 51] = 1e5
    mask = line_mask(response)
    assert np.count_nonzero(mask[20:24]) == 4 * 80
    assert np.count_nonzero(mask) == 4 * 80 + 1


def test_no_response_gives_no_line():
    assert np.count_nonzero(line_mask(np.zeros((40, 40), np.float32))) == 0


def test_sampling_is_bilinear_in_full_image_pixels():
    distances = DistanceMap(np.array([[0.0, 1.0], [2.0, 7.0]], np.float32), (10, 20))
    # Pixels (10, 20) … (11, 21); the middle is (0 + 1 + 2 + 7) / 4; beyond the edge its nearest value.
    points = np.array(
        [[10.0, 20.0], [11.0, 20.0], [10.0, 21.0], [10.5, 20.5], [10.25, 20.0], [-5.0, 20.0], [99.0, 99.0]]
    )
    np.testing.assert_allclose(distances.sample(points), [0.0, 1.0, 2.0, 2.5, 0.25, 0.0, 7.0], atol=1e-6)


def test_sampling_keeps_the_shape_and_takes_more_points_than_one_call_may():
    values = np.arange(12.0, dtype=np.float32).reshape(3, 4)
    distances = DistanceMap(values, (0, 0))
    points = np.tile([2.0, 1.0], (70000, 1))
    assert np.all(distances.sample(points) == 6.0)
    assert np.all(distances.sample(points.reshape(35000, 2, 2)) == 6.0)
    assert distances.sample(points.reshape(35000, 2, 2)).shape == (35000, 2)


def vertical_line(side, x, *, bright=False, **options):
    shape = (side, side)
    background = 100.0 if bright else 180.0
    return draw_curve(np.array([[x, -5.0], [x, side + 5.0]]), shape, bright=bright, background=background, **options)


@pytest.mark.parametrize("bright", [False, True])
def test_distance_to_a_line_by_hand(bright):
    image = vertical_line(1024, 500.0, sigma_px=2.0, bright=bright)
    found = distance_map(image, np.array([510.0, 400.0]), CONFIG, bright=bright)
    assert found.values.shape == (400, 400)
    assert found.origin == (310, 200)
    at = found.sample(np.array([[x, 400.0] for x in (460.0, 480.0, 500.0, 520.0, 540.0)]))
    # On the line 0; off it the distance to the edge of a band a few pixels wide; 20 px further, 20 px more.
    assert at[2] == 0.0
    assert at[1] == pytest.approx(at[3], abs=1.01)
    assert 12.0 < at[3] < 20.0
    assert at[4] - at[3] == pytest.approx(20.0, rel=0.02)
    assert at[0] - at[1] == pytest.approx(20.0, rel=0.02)


def test_the_wrong_polarity_does_not_see_the_line():
    image = vertical_line(1024, 500.0, sigma_px=2.0)
    found = distance_map(image, np.array([510.0, 400.0]), CONFIG, bright=True)
    assert found.sample(np.array([[500.0, 400.0]]))[0] > 0.0


def test_sizes_scale_with_the_image():
    # A 512-pixel image: half the region, half the scales; the same scene, at half the distances.
    full = distance_map(vertical_line(1024, 500.0, sigma_px=2.0), np.array([510.0, 400.0]), CONFIG, bright=False)
    half = distance_map(vertical_line(512, 250.0, sigma_px=1.0), np.array([255.0, 200.0]), CONFIG, bright=False)
    assert half.values.shape == (200, 200)
    assert half.origin == (155, 100)
    far_full = full.sample(np.array([[580.0, 400.0]]))[0]
    far_half = half.sample(np.array([[290.0, 200.0]]))[0]
    assert far_half == pytest.approx(far_full / 2.0, abs=0.6)


def test_deep_images_give_the_same_map():
    image = vertical_line(512, 250.0)
    shallow = distance_map(image, np.array([250.0, 250.0]), CONFIG, bright=False)
    deep = distance_map(image.astype(np.uint16) * 16, np.array([250.0, 250.0]), CONFIG, bright=False)
    np.testing.assert_allclose(deep.values, shallow.values, atol=1.5)


def test_an_empty_image_gives_finite_distances():
    found = distance_map(np.full((512, 512), 77, np.uint8), np.array([250.0, 250.0]), CONFIG, bright=False)
    # Everywhere the same, and more than any distance within the region of 200 × 200.
    np.testing.assert_array_equal(found.values, 400.0)
