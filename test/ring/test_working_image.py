import dataclasses

import cv2
import numpy as np
import pytest
from support.lasso_inputs import CURVE, LOOP, VIEWS, lasso_image, noisy
from support.method_inputs import biplane, plane

from lasso_motion_ros.geometry.frames import Frame
from lasso_motion_ros.ring.working_image import (
    NOISE_WINDOW_PX,
    TUNING,
    WholeImages,
    reduction_factor,
    working_image,
)

NO_SHIFT = np.zeros(2)
POINT = np.array([0.004, -0.006, 0.009])


def lasso_frame(side=512):
    view = biplane(side=side)["a"]
    return Frame(0, noisy(lasso_image(CURVE, view), 1), view)


def blob_frame(view, shift=(0.0, 0.0)):
    """A dark blob, 0.5 mm wide, where a view shows POINT, the whole image being off by a shift."""
    x, y = view.project(POINT) + shift
    rows, columns = np.mgrid[: view.height, : view.width]
    sigma = 0.5 / view.millimetres_per_pixel(POINT)
    blob = np.exp(-0.5 * ((columns - x) ** 2 + (rows - y) ** 2) / sigma**2)
    return Frame(0, np.rint(180.0 - 100.0 * blob).astype(np.uint8), view)


def blob_place(image):
    """Centre of what stands out above half of the highest value, working pixels."""
    y, x = np.nonzero(image.values > 0.5 * image.values.max())
    weights = image.values[y, x]
    return np.array([np.average(x, weights=weights), np.average(y, weights=weights)])


def test_reduction_by_hand():
    # 0.2 mm pixels at 1.2 m are 0.1308 mm at 0.785 m: 1.91 of them make a quarter of a millimetre.
    assert reduction_factor(plane(0.0), np.zeros(3)) == 2
    assert reduction_factor(plane(0.0, side=512), np.zeros(3)) == 1
    assert reduction_factor(plane(0.0, side=2048), np.zeros(3)) == 4
    assert reduction_factor(plane(0.0, side=128), np.zeros(3)) == 1  # never enlarged


def test_the_catheter_is_positive_whatever_its_polarity():
    frame = lasso_frame()
    dark = working_image(frame, LOOP.centre, bright=False, shift=NO_SHIFT)
    inverted = Frame(0, 255 - frame.pixels, frame.projection)
    bright = working_image(inverted, LOOP.centre, bright=True, shift=NO_SHIFT)
    np.testing.assert_allclose(bright.values, dark.values, atol=1e-4)
    x, y = np.rint(dark.projection.project(CURVE)).astype(int).T
    assert dark.values[y, x].mean() > 1.5
    wrong = working_image(frame, LOOP.centre, bright=True, shift=NO_SHIFT)
    np.testing.assert_allclose(wrong.values, -dark.values, atol=1e-4)


def test_grey_levels_mean_nothing():
    frame = lasso_frame()
    values = working_image(frame, LOOP.centre, bright=False, shift=NO_SHIFT).values
    deep = Frame(0, frame.pixels.astype(np.uint16) * 16 + 100, frame.projection)
    np.testing.assert_allclose(working_image(deep, LOOP.centre, bright=False, shift=NO_SHIFT).values, values, atol=2e-3)
    assert values.dtype == np.float32


@pytest.mark.parametrize("level", [0, 90, 255])
def test_a_constant_image_holds_nothing(level):
    frame = Frame(0, np.full((512, 512), level, np.uint8), VIEWS["a"])
    image = working_image(frame, np.zeros(3), bright=False, shift=NO_SHIFT)
    assert image.values.shape == (512, 512)
    np.testing.assert_allclose(image.values, 0.0, atol=2e-3)  # the kernels' weights are rounded


def test_quiet_and_noisy_regions_weigh_the_same():
    quiet, loud = (np.random.default_rng(2).normal(128.0, sigma, (512, 256)) for sigma in (3.0, 24.0))
    frame = Frame(0, np.rint(np.hstack([quiet, loud])).clip(0, 255).astype(np.uint8), VIEWS["a"])
    values = working_image(frame, np.zeros(3), bright=False, shift=NO_SHIFT).values
    away = NOISE_WINDOW_PX // 2 + 5  # from the edge between the two
    for half in (values[:, : 256 - away], values[:, 256 + away :]):
        assert np.sqrt(np.mean(half**2)) == pytest.approx(1.0, abs=0.05)


def test_values_are_clipped():
    # A single blob in an even background stands out by more than four times its surroundings' root mean square.
    values = working_image(blob_frame(VIEWS["a"]), POINT, bright=False, shift=NO_SHIFT).values
    assert values.max() == TUNING.clip == 4.0
    assert values.min() >= -TUNING.clip


@pytest.mark.parametrize("side", [512, 1024, 2048])
@pytest.mark.parametrize("reach_mm", [None, 25.0])
def test_the_reduced_projection_shows_points_where_the_reduced_image_has_them(side, reach_mm):
    view = plane(20.0, 10.0, side=side)
    image = working_image(blob_frame(view), POINT, bright=False, shift=NO_SHIFT, reach_mm=reach_mm)
    assert image.values.shape == (image.projection.height, image.projection.width)
    # A quarter of a pixel would be half a pixel of the full image: the offset (b − 1)/2 forgotten.
    np.testing.assert_allclose(blob_place(image), image.projection.project(POINT), atol=0.1)
    if reach_mm is None:
        assert image.values.shape == (512, 512)
        np.testing.assert_allclose(image.projection.project(np.zeros(3)), [255.5, 255.5], atol=1e-9)
    else:
        # 25 mm to either side at 0.26 mm each, around the point.
        assert image.values.shape == pytest.approx((191, 191), abs=2)
        np.testing.assert_allclose(blob_place(image), [95, 95], atol=1.5)


@pytest.mark.parametrize("reach_mm", [None, 25.0])
@pytest.mark.parametrize("side", [512, 1024])
def test_a_shift_of_the_images_is_taken_out(side, reach_mm):
    view, shift = plane(20.0, 10.0, side=side), np.array([7.0, -4.5])
    image = working_image(blob_frame(view, shift), POINT, bright=False, shift=shift, reach_mm=reach_mm)
    np.testing.assert_allclose(blob_place(image), image.projection.project(POINT), atol=0.1)


@pytest.mark.parametrize("frame", [lasso_frame(), lasso_frame(1024), lasso_frame(1023)], ids=["512", "1024", "1023"])
def test_a_region_is_a_part_of_the_whole(frame):
    whole = working_image(frame, LOOP.centre, bright=False, shift=NO_SHIFT)
    part = working_image(frame, LOOP.centre, bright=False, shift=NO_SHIFT, reach_mm=30.0)
    left, top = np.rint(whole.projection.project(LOOP.centre) - part.projection.project(LOOP.centre)).astype(int)
    assert left > 0
    assert top > 0
    height, width = part.values.shape
    margin = NOISE_WINDOW_PX // 2 + 10  # as far as the filters reach in from the cut
    inner = (slice(margin, height - margin), slice(margin, width - margin))
    cut = whole.values[top : top + height, left : left + width]
    np.testing.assert_allclose(part.values[inner], cut[inner], atol=1e-4)
    assert np.abs(part.values[inner]).max() > 2.0


def test_a_region_at_the_border_ends_there():
    frame = lasso_frame()
    edge = np.array([0.0, 0.0, 0.060])  # near the upper border, which lies at 67 mm
    image = working_image(frame, edge, bright=False, shift=NO_SHIFT, reach_mm=30.0)
    height, width = image.values.shape
    assert height < 0.7 * width
    whole = working_image(frame, edge, bright=False, shift=NO_SHIFT)
    assert image.projection.project(edge)[1] == pytest.approx(whole.projection.project(edge)[1])


@pytest.mark.parametrize("where", [[0.0, 0.0, 0.0], [0.0, 0.0, 0.3], [0.3, 0.2, 0.0]])
def test_a_region_too_small_or_outside_gives_the_whole_image(where):
    frame = lasso_frame()
    reach_mm = 10.0 if not any(where) else 30.0  # 76 pixels, fewer than two windows of the noise
    image = working_image(frame, np.array(where), bright=False, shift=NO_SHIFT, reach_mm=reach_mm)
    whole = working_image(frame, np.array(where), bright=False, shift=NO_SHIFT)
    np.testing.assert_array_equal(image.values, whole.values)
    np.testing.assert_array_equal(image.projection.matrix, whole.projection.matrix)


@pytest.mark.parametrize("reach_mm", [None, 30.0])
def test_an_image_too_small_for_a_loop_is_blank(reach_mm):
    view = plane(0.0, side=96)
    pixels = np.random.default_rng(1).integers(0, 255, (96, 96)).astype(np.uint8)
    image = working_image(Frame(0, pixels, view), np.zeros(3), bright=False, shift=NO_SHIFT, reach_mm=reach_mm)
    assert not image.values.any()
    assert image.values.shape == (image.projection.height, image.projection.width)


def test_contrast_is_a_share_of_the_grey_whatever_noise_and_brightness():
    clean = lasso_image(CURVE, VIEWS["a"]).astype(float)

    def unit(pixels, centre=LOOP.centre):
        frame = Frame(0, pixels.astype(np.uint16), VIEWS["a"])
        return working_image(frame, LOOP.centre, bright=False, shift=np.zeros(2)).contrast_unit(centre)

    # Twice as bright is the same; on twice the grey the same structure is half the share.
    assert unit(20.0 * clean) == pytest.approx(unit(10.0 * clean), rel=0.01)
    lifted = 10.0 * (clean + clean.mean())
    assert unit(lifted) == pytest.approx(0.5 * unit(10.0 * clean), rel=0.1)
    # A place outside the image has the border's.
    assert np.isfinite(unit(10.0 * clean, LOOP.centre + 1.0))
    assert unit(np.zeros(clean.shape)) < 0.01


def test_the_part_about_some_points_is_the_whole_there():
    whole = working_image(lasso_frame(), LOOP.centre, bright=False, shift=np.zeros(2))
    pixel_mm = whole.projection.millimetres_per_pixel(CURVE.mean(axis=0))
    part = whole.about(CURVE, 5.0 * pixel_mm)
    pixels, there = whole.projection.project(CURVE), part.projection.project(CURVE)
    corner = (pixels - there)[0]
    np.testing.assert_allclose(pixels - there, np.broadcast_to(corner, pixels.shape), atol=1e-9)
    left, top = np.rint(corner).astype(int)
    height, width = part.values.shape
    np.testing.assert_array_equal(part.values, whole.values[top : top + height, left : left + width])
    np.testing.assert_array_equal(part.noise, whole.noise[top : top + height, left : left + width])
    # The reach on every side, to the next whole pixel.
    assert np.all(there.min(axis=0) >= 5.0)
    assert np.all(there.min(axis=0) < 6.0)
    assert np.all(there.max(axis=0) <= np.array([width, height]) - 6.0)


def test_the_part_about_points_at_the_border_ends_there():
    whole = working_image(lasso_frame(), LOOP.centre, bright=False, shift=np.zeros(2))
    ray = whole.projection.rays(np.array([2.0, 3.0]))
    corner = (whole.projection.source + whole.projection.depth(LOOP.centre) * ray)[None]
    part = whole.about(corner, 10.5 * whole.projection.millimetres_per_pixel(corner[0]))
    # Columns 0 to ceil(2 + 10.5), rows 0 to ceil(3 + 10.5).
    assert part.values.shape == (15, 14)
    np.testing.assert_array_equal(part.values, whole.values[:15, :14])


def evidence_of_the_whole(image):
    """Evidence (h, w) as its definition has it: differences of whole Gaussians, over the window's root mean square."""
    grey = np.log(np.maximum(image.grey, 1).astype(np.float32))
    band = cv2.GaussianBlur(grey, (0, 0), 5.4) - cv2.GaussianBlur(grey, (0, 0), 1.8)
    power = cv2.blur(band * band, (33, 33), borderType=cv2.BORDER_REFLECT)
    return np.clip((-band if image.bright else band) / np.sqrt(power), -1.0, 2.0)


@pytest.mark.parametrize("bright", [False, True])
def test_evidence_is_that_of_the_definition(bright):
    frame = lasso_frame()
    image = working_image(frame, LOOP.centre, bright=bright, shift=NO_SHIFT)
    pixels = image.projection.project(CURVE)
    x, y = pixels.astype(np.float32).T
    expected = cv2.remap(evidence_of_the_whole(image), x, y, cv2.INTER_LINEAR).reshape(-1)
    np.testing.assert_allclose(image.evidence_at(pixels), expected, atol=0.03)
    assert np.std(image.evidence_at(pixels) - expected) < 0.01


def test_evidence_rests_on_the_surroundings_only():
    image = working_image(lasso_frame(), LOOP.centre, bright=False, shift=NO_SHIFT)
    pixels = image.projection.project(CURVE)
    together = image.evidence_at(pixels)
    apart = np.concatenate([image.evidence_at(one) for one in np.array_split(pixels, 7)])
    np.testing.assert_allclose(apart, together, atol=0.005)
    # Nothing beyond them has a say.
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    rows, columns = np.mgrid[: image.grey.shape[0], : image.grey.shape[1]]
    reach = TUNING.evidence_reach_px + 4
    is_near = (columns > low[0] - reach) & (columns < high[0] + reach) & (rows > low[1] - reach)
    is_near &= rows < high[1] + reach
    other = dataclasses.replace(image, grey=np.where(is_near, image.grey, 7).astype(np.uint16))
    np.testing.assert_allclose(other.evidence_at(pixels), together, atol=1e-4)


def test_there_is_no_evidence_outside_the_image():
    image = working_image(lasso_frame(), LOOP.centre, bright=False, shift=NO_SHIFT)
    width, height = image.values.shape[::-1]
    outside = np.array([[-40.0, 30.0], [width + 500.0, 30.0], [30.0, height + 1.0], [-1e9, -1e9]])
    np.testing.assert_array_equal(image.evidence_at(outside), 0.0)
    np.testing.assert_array_equal(image.evidence_at(outside[:1]), 0.0)
    np.testing.assert_array_equal(image.evidence_at(np.full((3, 2), np.nan)), 0.0)
    inside = np.array([[30.0, 30.0]])
    mixed = image.evidence_at(np.concatenate([outside[:3], inside]))
    np.testing.assert_allclose(mixed, [0.0, 0.0, 0.0, image.evidence_at(inside)[0]], atol=0.005)


@pytest.mark.parametrize("bright", [False, True])
def test_for_other_shifts_and_places_the_same_filtered_image_serves(bright):
    frame = lasso_frame()
    images = WholeImages({"a": frame})
    nearer = LOOP.centre + 0.5 * (frame.projection.source - LOOP.centre)  # pixels are half as large there
    for centre, shift in ((LOOP.centre, (0.0, 0.0)), (LOOP.centre, (1.7, -2.3)), (nearer, (1.7, -2.3))):
        found = images.at("a", centre, np.array(shift), bright=bright)
        expected = working_image(frame, centre, bright=bright, shift=np.array(shift))
        for one in ("values", "noise", "grey"):
            np.testing.assert_array_equal(getattr(found, one), getattr(expected, one))
        np.testing.assert_array_equal(found.projection.matrix, expected.projection.matrix)
        assert found.bright is expected.bright is bright
    first, second = (images.at("a", LOOP.centre, np.array(shift), bright=bright) for shift in ((0.0, 0.0), (3.0, 4.0)))
    assert first.values is second.values
    assert images.at("a", LOOP.centre, np.zeros(2), bright=not bright).values is not first.values


def test_a_frame_too_small_for_a_loop_is_as_blank_under_any_shift():
    frame = Frame(0, np.zeros((40, 40), dtype=np.uint8), VIEWS["a"].cropped(0, 0, 40, 40))
    found = WholeImages({"a": frame}).at("a", LOOP.centre, np.array([2.0, 1.0]), bright=False)
    expected = working_image(frame, LOOP.centre, bright=False, shift=np.array([2.0, 1.0]))
    assert not found.values.any()
    np.testing.assert_array_equal(found.projection.matrix, expected.projection.matrix)
