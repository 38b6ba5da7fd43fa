import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.method_inputs import flip_pixels, flipped, plane

from lasso_motion_ros.core.errors import GeometryError
from lasso_motion_ros.geometry.projection import Projection, carm_projection, triangulate

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


def test_carm_angles_say_where_the_detector_is():
    # World axes: +x the patient's left, +y posterior, +z cranial.
    half, root = 0.5, np.sqrt(3.0) / 2.0
    np.testing.assert_allclose(plane(0.0).viewing_direction, [0.0, -1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(plane(-30.0).viewing_direction, [-half, -root, 0.0], atol=1e-12)  # RAO: right, anterior
    np.testing.assert_allclose(plane(60.0).viewing_direction, [root, -half, 0.0], atol=1e-12)  # LAO: left, anterior
    np.testing.assert_allclose(plane(0.0, 30.0).viewing_direction, [0.0, -root, half], atol=1e-12)  # CRAN: up
    np.testing.assert_allclose(plane(0.0, -30.0).viewing_direction, [0.0, -root, -half], atol=1e-12)  # CAUD: down


def test_carm_source_is_opposite_the_detector():
    # 0.785 m × −(−1/2, −√3/2, 0)
    np.testing.assert_allclose(plane(-30.0).source, [0.3925, 0.785 * np.sqrt(3.0) / 2.0, 0.0], atol=1e-12)


def test_carm_display_as_seen_facing_the_patient():
    # 10 mm at the iso-centre is 10 × 1.2 / 0.785 / 0.2 = 76.43 px; centre (1023 / 2, 1023 / 2)
    shift = 10.0 * 1.2 / 0.785 / 0.2
    left, cranial = np.array([0.01, 0.0, 0.0]), np.array([0.0, 0.0, 0.01])
    np.testing.assert_allclose(plane(0.0).project(np.zeros(3)), [511.5, 511.5])
    np.testing.assert_allclose(plane(0.0).project(left), [511.5 + shift, 511.5])
    np.testing.assert_allclose(plane(0.0).project(cranial), [511.5, 511.5 - shift])
    np.testing.assert_allclose(plane(0.0, mirrored=False).project(left), [511.5 - shift, 511.5])
    # From the left side (LAO 90) the patient's back is at the image's right.
    np.testing.assert_allclose(plane(90.0).project(np.array([0.0, 0.01, 0.0])), [511.5 + shift, 511.5])


def test_carm_roll_and_iso_centre():
    options = {
        "source_detector_m": 1.0,
        "source_object_m": 0.5,
        "pixel_size_m": 1e-3,
        "width": 101,
        "height": 101,
    }
    # 10 mm to the left is 20 px to the right, after a quarter turn from +x towards +y 20 px down.
    rolled = carm_projection(0.0, 0.0, roll_rad=np.pi / 2, **options)
    np.testing.assert_allclose(rolled.project(np.array([0.01, 0.0, 0.0])), [50.0, 70.0], atol=1e-9)
    np.testing.assert_allclose(rolled.project(np.array([0.0, 0.0, 0.01])), [70.0, 50.0], atol=1e-9)  # from up to right
    moved = carm_projection(0.3, 0.1, iso_centre=(0.01, 0.02, 0.03), **options)
    np.testing.assert_allclose(moved.project(np.array([0.01, 0.02, 0.03])), [50.0, 50.0], atol=1e-9)


def test_read_out_by_hand():
    # Binned column 3 of a read-out from column 100 covers columns 106 and 107, row 2 from row 10 rows 18 to 21.
    read_out = simple().read_out(100, 10, 40, 20, binning_x=2, binning_y=4)
    ray = simple().rays(np.array([106.5, 19.5]))
    np.testing.assert_allclose(read_out.project(simple().source + ray), [3.0, 2.0], atol=1e-9)
    assert (read_out.width, read_out.height) == (40, 20)
    np.testing.assert_allclose(read_out.source, simple().source, atol=1e-12)


def test_read_out_of_everything_is_the_same():
    same = simple().read_out(0, 0, 200, 100)
    np.testing.assert_allclose(same.matrix, SIMPLE, atol=1e-12)


def test_pixels_grow_with_binning():
    binned = simple().read_out(0, 0, 100, 50, 2, 2)
    assert binned.millimetres_per_pixel(np.zeros(3)) == pytest.approx(4.0)


def test_triangulation_finds_the_point_and_the_middle_between_skew_rays():
    a, b = plane(0.0), plane(90.0)
    np.testing.assert_allclose(triangulate((a, b), (a.project(POINTS[0]), b.project(POINTS[0]))), POINTS[0], atol=1e-9)
    # Both rays are horizontal at the iso-centre's height up to 76.43 px = 10 mm in A: the middle is 5 mm up.
    up = a.project(np.array([0.0, 0.0, 0.01]))
    np.testing.assert_allclose(triangulate((a, b), (up, b.project(np.zeros(3)))), [0.0, 0.0, 0.005], atol=1e-4)


def test_no_geometry_from_one_view():
    a = plane(0.0)
    with pytest.raises(GeometryError, match="parallel"):
        triangulate((a, a), (np.array([500.0, 500.0]), np.array([500.0, 500.0])))


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
    with pytest.raises(GeometryError, match="source_object_m must be positive, found -1"):
        carm_projection(0, 0, source_detector_m=1, source_object_m=-1, pixel_size_m=1e-3, width=2, height=2)
    with pytest.raises(GeometryError, match="pixel_size_m must be positive, found nan"):
        carm_projection(0, 0, source_detector_m=1, source_object_m=1, pixel_size_m=np.nan, width=2, height=2)
