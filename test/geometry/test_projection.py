import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.method_inputs import flip_pixels, flipped, plane

from lasso_motion_ros.core.errors import GeometryError
from lasso_motion_ros.geometry.projection import Projection

# f = 1000 px, principal point (100, 50), camera axes = world axes, source 2 m behind the origin.
CAMERA = np.array([[1000.0, 0.0, 100.0], [0.0, 1000.0, 50.0], [0.0, 0.0, 1.0]])
SIMPLE = CAMERA @ np.column_stack([np.eye(3), [0.0, 0.0, 2.0]])
POINT = np.array([0.1, -0.2, 0.0])
POINTS = np.array([[0.01, -0.02, 0.03], [-0.04, 0.05, 0.0], [0.0, 0.0, -0.06]])

angles = st.floats(-100.0, 100.0)
tilts = st.floats(-40.0, 40.0)
factors = st.floats(1e-6, 1e6).flatmap(lambda f: st.sampled_from([f, -f]))


def simple() -> Projection:
    return Projection(SIMPLE, 200, 100)


def test_projection_by_hand():
    # depth 0 + 2; x = 1000 · 0.1 / 2 + 100; y = 1000 · (−0.2) / 2 + 50
    assert simple().depth(POINT) == pytest.approx(2.0)
    np.testing.assert_allclose(simple().project(POINT), [150.0, -50.0])


def test_source_by_hand():
    # R turns by 90° about z: rows (0 1 0), (−1 0 0); o = −Rᵀ t = −(−t₂, t₁, t₃) = (0.2, −0.1, −2)
    rotation = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    projection = Projection(CAMERA @ np.column_stack([rotation, [0.1, 0.2, 2.0]]), 200, 100)
    np.testing.assert_allclose(projection.source, [0.2, -0.1, -2.0])
    np.testing.assert_allclose(simple().source, [0.0, 0.0, -2.0], atol=1e-15)


def test_size_of_a_pixel_by_hand():
    # 2 m × 1 px / 1000 px = 2 mm; 1 m further off, 3 mm
    assert simple().focal_length_px == pytest.approx(1000.0)
    assert simple().millimetres_per_pixel(np.zeros(3)) == pytest.approx(2.0)
    assert simple().millimetres_per_pixel(np.array([0.5, 0.5, 1.0])) == pytest.approx(3.0)


def test_ray_by_hand():
    # from (0, 0, −2) to (0.1, −0.2, 0): (0.1, −0.2, 2) / √(0.01 + 0.04 + 4)
    np.testing.assert_allclose(simple().rays(np.array([150.0, -50.0])), np.array([0.1, -0.2, 2.0]) / np.sqrt(4.05))


def test_third_row_measures_depth_whatever_scale_and_sign_were_given():
    projection = Projection(-37.5 * SIMPLE, 200, 100)
    np.testing.assert_allclose(projection.matrix, SIMPLE)
    assert not projection.matrix.flags.writeable


@given(angles, tilts, factors)
def test_scale_and_sign_of_the_matrix_mean_nothing(lao, cranial, factor):
    one = plane(lao, cranial)
    other = Projection(factor * one.matrix, one.width, one.height)
    np.testing.assert_allclose(other.source, one.source, atol=1e-9)
    np.testing.assert_allclose(other.viewing_direction, one.viewing_direction, atol=1e-9)
    np.testing.assert_allclose(other.project(POINTS), one.project(POINTS), atol=1e-6)
    np.testing.assert_allclose(other.depth(POINTS), one.depth(POINTS), atol=1e-9)
    np.testing.assert_allclose(other.rays(one.project(POINTS)), one.rays(one.project(POINTS)), atol=1e-9)
    np.testing.assert_allclose(other.jacobian(POINTS), one.jacobian(POINTS), rtol=1e-6, atol=1e-3)
    for first, second in zip(other.decompose(), one.decompose(), strict=True):
        np.testing.assert_allclose(first, second, rtol=1e-6, atol=1e-7)


@given(angles, tilts)
def test_mirrored_display_moves_pixels_only(lao, cranial):
    one = plane(lao, cranial)
    other = flipped(one)
    pixels = one.project(POINTS)
    np.testing.assert_allclose(other.project(POINTS), flip_pixels(pixels, one), atol=1e-6)
    np.testing.assert_allclose(other.source, one.source, atol=1e-9)
    np.testing.assert_allclose(other.viewing_direction, one.viewing_direction, atol=1e-9)
    np.testing.assert_allclose(other.rays(flip_pixels(pixels, one)), one.rays(pixels), atol=1e-9)
    assert other.focal_length_px == pytest.approx(one.focal_length_px)


@given(angles, tilts, st.booleans())
def test_rays_pass_through_the_points_they_image(lao, cranial, mirrored):
    projection = plane(lao, cranial, mirrored=mirrored)
    towards = POINTS - projection.source
    rays = projection.rays(projection.project(POINTS))
    np.testing.assert_allclose(rays, towards / np.linalg.norm(towards, axis=1, keepdims=True), atol=1e-9)


@pytest.mark.parametrize("mirrored", [True, False])
def test_jacobian_against_finite_differences(mirrored):
    projection, step = plane(60.0, -15.0, mirrored=mirrored), 1e-6
    numeric = np.stack(
        [(projection.project(POINTS + d) - projection.project(POINTS - d)) / (2 * step) for d in step * np.eye(3)],
        axis=-1,
    )
    assert projection.jacobian(POINTS).shape == (3, 2, 3)
    np.testing.assert_allclose(projection.jacobian(POINTS), numeric, rtol=1e-5, atol=1e-2)


def test_decomposition_by_hand():
    camera, rotation, translation = simple().decompose()
    np.testing.assert_allclose(camera, CAMERA, atol=1e-9)
    np.testing.assert_allclose(rotation, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(translation, [0.0, 0.0, 2.0], atol=1e-12)


@given(angles, tilts, st.booleans())
def test_decomposition_round_trip(lao, cranial, mirrored):
    projection = plane(lao, cranial, mirrored=mirrored)
    camera, rotation, translation = projection.decompose()
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(np.tril(camera, -1), 0.0, atol=1e-6)
    assert camera[1, 1] > 0
    assert (camera[0, 0] < 0) == mirrored
    np.testing.assert_allclose(camera @ np.column_stack([rotation, translation]), projection.matrix, atol=1e-6)
    np.testing.assert_allclose(-rotation.T @ translation, projection.source, atol=1e-9)


def test_a_shift_by_hand():
    # POINT is seen at (150, −50).
    shifted = simple().shifted(3.0, -4.5)
    np.testing.assert_allclose(shifted.project(POINT), [153.0, -54.5])
    assert (shifted.width, shifted.height, shifted.detector_width) == (200, 100, 200.0)


def test_a_crop_by_hand():
    cropped = simple().cropped(100, 10, 40, 20)
    np.testing.assert_allclose(cropped.project(POINT), [50.0, -60.0])
    assert (cropped.width, cropped.height, cropped.detector_width) == (40, 20, 200.0)


def test_binning_by_hand():
    # Binned column 3 covers columns 6 and 7, row 2 rows 8 to 11; of 200 × 102 pixels two rows fill no pixel.
    projection = Projection(SIMPLE, 200, 102)
    binned = projection.binned(2, 4)
    ray = projection.rays(np.array([6.5, 9.5]))
    np.testing.assert_allclose(binned.project(projection.source + ray), [3.0, 2.0], atol=1e-9)
    assert (binned.width, binned.height, binned.detector_width) == (100, 25, 100.0)
    assert simple().binned(2, 2).millimetres_per_pixel(np.zeros(3)) == pytest.approx(4.0)


def test_a_read_out_is_cropped_then_binned():
    steps = simple().cropped(100, 10, 40, 21).binned(2, 4)
    at_once = simple().read_out(100, 10, 40, 21, 2, 4)
    np.testing.assert_allclose(at_once.matrix, steps.matrix, rtol=1e-13)
    assert (at_once.width, at_once.height, at_once.detector_width) == (20, 5, 100.0)
    assert (steps.width, steps.height, steps.detector_width) == (20, 5, 100.0)


def test_the_detectors_width_is_kept_through_all_of_them():
    projection = Projection(SIMPLE, 160, 100, detector_width=320.0)
    assert projection.shifted(1.0, 2.0).cropped(10, 0, 50, 50).binned(4, 2).detector_width == 80.0
    assert simple().binned(3, 1).detector_width == pytest.approx(200.0 / 3.0)


def test_parts_keep_source_and_depth():
    for part in (simple().shifted(3, 4), simple().cropped(10, 20, 30, 40), simple().binned(2, 3)):
        assert part.source is part.cropped(0, 0, 1, 1).source
        np.testing.assert_array_equal(part.source, simple().source)
        np.testing.assert_array_equal(part.matrix[2], simple().matrix[2])
        assert not part.matrix.flags.writeable


def test_parts_that_are_refused():
    with pytest.raises(GeometryError, match="found 0×5"):
        simple().cropped(0, 0, 0, 5)
    with pytest.raises(GeometryError, match="found 1×0"):
        simple().binned(200, 101)
    with pytest.raises(GeometryError, match="at least one pixel, found 0×1"):
        simple().binned(0, 1)
    for place in (np.nan, np.inf):
        with pytest.raises(GeometryError, match="finite place"):
            simple().shifted(0.0, place)


@pytest.mark.parametrize(
    ("matrix", "text"),
    [
        (np.eye(3), r"3×4, found shape \(3, 3\)"),
        (np.where(SIMPLE == 100.0, np.nan, SIMPLE), "not finite"),
        (np.where(SIMPLE == 100.0, np.inf, SIMPLE), "not finite"),
        (np.zeros((3, 4)), "singular"),
        (SIMPLE[[0, 0, 2]], "singular"),
        (np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]]), "singular"),  # a parallel projection
        (CAMERA @ np.eye(3, 4), "in front of it is undefined"),
    ],
)
def test_refused_matrices(matrix, text):
    with pytest.raises(GeometryError, match=text):
        Projection(matrix, 200, 100)


def test_refused_sizes():
    with pytest.raises(GeometryError, match="found 0×100"):
        Projection(SIMPLE, 0, 100)
