import cv2
import numpy as np
import pytest
from support.lasso_inputs import CURVE, LOOP, VIEWS, bare, lasso_image, noisy
from support.method_inputs import biplane, plane

from lasso_motion_ros.geometry.frames import Frame
from lasso_motion_ros.ring.strip import HALF_WIDTH, render, sample_at, strip_about, strip_along, upper_median
from lasso_motion_ros.ring.template import RingTemplate, TemplateTuning
from lasso_motion_ros.ring.working_image import PIXEL_MM, working_image

COLUMNS = 2 * HALF_WIDTH + 1
# Straight along the patient's left–right axis through the iso-centre, seen from the front: 1 mm from point to point.
STRAIGHT = np.column_stack([np.arange(-10.0, 10.5, 1.0) * 1e-3, np.zeros(21), np.zeros(21)])
# 0.2 mm pixels at 1.2 m are 0.1308333 mm at 0.785 m.
UNIT_MM = 0.2 * 0.785 / 1.2


def template_of(strip):
    """What the ring looks like, if both planes show this strip."""
    shown = np.ones(len(strip), np.float32)
    return RingTemplate({"a": strip, "b": strip}, {"a": shown, "b": shown}, TemplateTuning()).values


def test_strip_of_a_straight_line_by_hand():
    strip = strip_along(STRAIGHT, plane(0.0))
    x = 511.5 + np.arange(-10.0, 10.5, 1.0) / UNIT_MM
    np.testing.assert_allclose(strip.pixels, np.column_stack([x, np.full(21, 511.5)]), atol=1e-9)
    np.testing.assert_allclose(strip.spacing, 1.0 / UNIT_MM, rtol=1e-9)
    np.testing.assert_allclose(strip.tangents, np.tile([1.0, 0.0], (21, 1)), atol=1e-12)
    np.testing.assert_allclose(strip.normals, np.tile([0.0, 1.0], (21, 1)), atol=1e-12)
    assert strip.step == pytest.approx(PIXEL_MM / UNIT_MM)
    at = strip.coordinates()
    assert at.shape == (2, 21, COLUMNS)
    np.testing.assert_allclose(at[:, :, HALF_WIDTH], strip.pixels.T, atol=1e-4)
    np.testing.assert_allclose(at[0, 4], x[4], atol=1e-4)
    np.testing.assert_allclose(at[1, 4], 511.5 + np.arange(-6, 7) * 0.25 / UNIT_MM, atol=1e-4)


def test_normals_are_across_wherever_the_curve_leads():
    for view in biplane().values():
        strip = strip_along(CURVE, view)
        np.testing.assert_allclose(np.linalg.norm(strip.normals, axis=1), 1.0, atol=1e-9)
        np.testing.assert_allclose((strip.normals * strip.tangents).sum(axis=1), 0.0, atol=1e-9)
        steps = np.diff(view.project(CURVE), axis=0)
        assert ((steps * strip.tangents[1:]).sum(axis=1) > 0.0).all()
        assert (np.linalg.det(np.stack([strip.tangents, strip.normals], axis=1)) > 0.0).all()


def test_a_curve_seen_end_on_gives_finite_numbers():
    view = plane(0.0)
    towards = view.source * np.linspace(0.0, 0.02, 21)[:, None]  # along one ray
    strip = strip_along(towards, view)
    assert np.isfinite(strip.coordinates()).all()


def test_sampling_is_bilinear_and_zero_outside():
    view = plane(0.0, side=512)
    y, x = np.mgrid[:512, :512].astype(np.float32)
    strip = strip_along(STRAIGHT + np.array([0.0, 0.0, 0.003]), view)
    sampled = strip.sample(bare(3.0 * x - 2.0 * y, view))
    at = strip.coordinates()
    # OpenCV interpolates at a 32nd of a pixel.
    np.testing.assert_allclose(sampled, 3.0 * at[0] - 2.0 * at[1], atol=5.0 / 64.0)
    outside = strip_along(STRAIGHT + 0.2, view).sample(bare(np.ones((512, 512), np.float32), view))
    np.testing.assert_array_equal(outside, 0.0)


def loop_image(name="a", side=512):
    view = biplane(side=side)[name]
    return working_image(
        Frame(0, noisy(lasso_image(CURVE, view), 4), view), LOOP.centre, bright=False, shift=np.zeros(2)
    )


def correlate(image, kernel, cell_px):
    height, width = (size // cell_px for size in image.values.shape)
    cells = cv2.resize(image.values, (width, height), interpolation=cv2.INTER_AREA)
    scores = cv2.matchTemplate(cells, kernel, cv2.TM_CCORR)
    y, x = np.unravel_index(np.argmax(scores), scores.shape)
    return np.array([x, y]), scores


@pytest.mark.parametrize("name", ["a", "b"])
@pytest.mark.parametrize("side", [512, 1024])
@pytest.mark.parametrize("cell_px", [1, 2, 3])
def test_rendering_puts_the_pattern_back_where_it_was(name, side, cell_px):
    image = loop_image(name, side)
    strip = strip_along(CURVE, image.projection)
    kernel, first = render(template_of(strip.sample(image)), strip, cell_px)
    assert kernel.dtype == np.float32
    assert np.linalg.norm(kernel) == pytest.approx(1.0, abs=1e-5)
    assert kernel.sum() == pytest.approx(0.0, abs=1e-4)
    best, scores = correlate(image, kernel, cell_px)
    np.testing.assert_array_equal(best, first)
    if cell_px < 3:
        assert scores.max() > 10.0 * np.sqrt(np.mean(scores**2))


def test_rendering_elsewhere_moves_the_pattern():
    image = loop_image()
    strip = strip_along(CURVE, image.projection)
    kernel, first = render(strip.sample(image), strip, 2)
    # 10 pixels to the right are five cells, whatever lies in them.
    moved = strip_along(CURVE, image.projection.shifted(10, -4))
    same, there = render(strip.sample(image), moved, 2)
    np.testing.assert_array_equal(there - first, [5, -2])
    np.testing.assert_allclose(same, kernel, atol=1e-6)


def test_a_hair_s_breadth_changes_the_rendering_by_no_more():
    """No cell is in or out by what the last bits decide."""
    image = loop_image()
    strip = strip_along(CURVE, image.projection)
    values = template_of(strip.sample(image)) + np.float32(0.2)
    largest = 0.0
    for place in np.arange(0.0, 2.0, 0.02):
        here, there = (
            render(values, strip_along(CURVE, image.projection.shifted(place + apart, 0.0)), 2) for apart in (0.0, 1e-3)
        )
        if (here[1] == there[1]).all() and here[0].shape == there[0].shape:
            largest = max(largest, float(np.abs(here[0] - there[0]).max()))
    assert 0.0 < largest < 2e-4


def test_both_sides_of_an_edge_on_loop_are_averaged():
    view = plane(0.0, side=512)
    # One way over 20 mm, back over the first half only: added up, that half would count twice.
    there = np.linspace(-0.010, 0.010, 81)
    x = np.concatenate([there, there[80:40:-1]])
    folded = strip_along(np.column_stack([x, np.zeros_like(x), np.zeros_like(x)]), view)
    once = strip_along(np.column_stack([there, np.zeros((81, 2))]), view)
    column = np.exp(-0.5 * (np.arange(-6, 7) / 2.0) ** 2)
    double, first = render(np.tile(column, (len(x), 1)).astype(np.float32), folded, 2)
    single, other = render(np.tile(column, (81, 1)).astype(np.float32), once, 2)
    np.testing.assert_array_equal(first, other)
    middle = double.shape[0] // 2
    left, right = double[:, 4 : double.shape[1] // 2 - 2], double[:, double.shape[1] // 2 + 2 : -4]
    assert np.abs(left).max() == pytest.approx(np.abs(right).max(), rel=0.1)
    assert double[middle, 4:-4] == pytest.approx(single[middle, 4:-4], rel=0.1)


@pytest.mark.parametrize("view", [VIEWS["a"], VIEWS["b"]])
def test_an_empty_pattern_renders_to_nothing(view):
    kernel, _ = render(np.zeros((len(CURVE), COLUMNS), np.float32), strip_along(CURVE, view), 2)
    assert np.isfinite(kernel).all()
    assert not kernel.any()


def test_strips_in_several_planes_at_once_are_those_of_each():
    strips = [strip_along(CURVE, view) for view in biplane().values()]
    together = strip_about(np.stack([s.pixels for s in strips]), np.stack([s.step for s in strips]))
    for one, at in zip(strips, together.coordinates(), strict=True):
        np.testing.assert_array_equal(at, one.coordinates())


def test_sampling_by_coordinates_is_sampling_by_strip():
    image = loop_image()
    strip = strip_along(CURVE, image.projection)
    np.testing.assert_array_equal(sample_at(strip.coordinates(), image), strip.sample(image))


@pytest.mark.parametrize(("row", "middle"), [([3.0, 1.0, 2.0], 2.0), ([4.0, 1.0, 2.0, 3.0], 3.0)])
def test_the_upper_median_by_hand(row, middle):
    values = np.array([row, row[::-1]], np.float32)
    np.testing.assert_array_equal(upper_median(values), [middle, middle])
