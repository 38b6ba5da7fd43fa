import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from support.method_inputs import draw_curve, plane

from lasso_motion_ros.brost2009.features import DistanceMap, distance_map, equalise, line_mask, region_of_interest
from lasso_motion_ros.config.brost2009 import FeatureConfig
from lasso_motion_ros.geometry.frames import Frame

CONFIG = FeatureConfig()


def map_of(pixels, centre, *, bright=False, config=CONFIG):
    """The distance map of an image of the whole detector."""
    frame = Frame(0, pixels, plane(0.0, side=pixels.shape[1]))
    return distance_map(frame, np.array(centre), config, bright=bright)


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


def test_a_few_very_strong_pixels_hide_the_lines_unless_they_are_clipped():
    response = np.ones((80, 80), np.float32)
    response[20:24] = 10.0
    response[50, 51] = 1e5
    assert np.count_nonzero(line_mask(response)) == 1
    mask = line_mask(response, clipped_share=0.001)
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
    found = map_of(image, [510.0, 400.0], bright=bright)
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
    found = map_of(image, [510.0, 400.0], bright=True)
    assert found.sample(np.array([[500.0, 400.0]]))[0] > 0.0


def test_sizes_scale_with_the_detector():
    # A 512-pixel detector: half the region, half the scales; the same scene, at half the distances.
    full = map_of(vertical_line(1024, 500.0, sigma_px=2.0), [510.0, 400.0])
    half = map_of(vertical_line(512, 250.0, sigma_px=1.0), [255.0, 200.0])
    assert half.values.shape == (200, 200)
    assert half.origin == (155, 100)
    far_full = full.sample(np.array([[580.0, 400.0]]))[0]
    far_half = half.sample(np.array([[290.0, 200.0]]))[0]
    assert far_half == pytest.approx(far_full / 2.0, abs=0.6)


def test_deep_images_give_the_same_map():
    image = vertical_line(512, 250.0)
    shallow = map_of(image, [250.0, 250.0])
    deep = map_of(image.astype(np.uint16) * 16, [250.0, 250.0])
    np.testing.assert_allclose(deep.values, shallow.values, atol=1.5)


def test_an_empty_image_gives_finite_distances():
    found = map_of(np.full((512, 512), 77, np.uint8), [250.0, 250.0])
    # Everywhere the same, and more than any distance within the region of 200 × 200.
    np.testing.assert_array_equal(found.values, 400.0)


def test_a_cropped_image_has_the_whole_ones_map():
    image = vertical_line(1024, 500.0, sigma_px=2.0)
    whole = map_of(image, [510.0, 400.0])
    part = Frame(0, image[100:700, 200:800].copy(), plane(0.0, side=1024).cropped(200, 100, 600, 600))
    found = distance_map(part, np.array([310.0, 300.0]), CONFIG, bright=False)
    assert found.origin == (whole.origin[0] - 200, whole.origin[1] - 100)
    np.testing.assert_array_equal(found.values, whole.values)


def test_a_binned_image_has_the_whole_ones_region():
    binned = Frame(0, vertical_line(512, 250.0), plane(0.0, side=1024).binned(2, 2))
    found = distance_map(binned, np.array([255.0, 200.0]), CONFIG, bright=False)
    assert found.values.shape == (200, 200)


def test_distances_are_exact_or_those_of_a_chamfer():
    # A slanted line: 5×5 chamfer distances to it are off by up to 2 %.
    image = draw_curve(np.array([[300.0, 200.0], [420.0, 620.0]]), (1024, 1024), sigma_px=2.0)
    exact, chamfer = (
        map_of(image, [400.0, 400.0], config=FeatureConfig(distance=distance)) for distance in ("exact", "chamfer")
    )
    rows, columns = np.nonzero(exact.values == 0.0)
    np.testing.assert_array_equal(chamfer.values == 0.0, exact.values == 0.0)
    for row, column in ((30, 350), (200, 390), (390, 20)):
        assert exact.values[row, column] == pytest.approx(np.hypot(rows - row, columns - column).min(), rel=1e-5)
    far = exact.values > 10.0
    assert 0.005 < np.abs(chamfer.values[far] / exact.values[far] - 1.0).max() < 0.025
