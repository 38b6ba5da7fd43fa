import numpy as np
import pytest
from support.method_inputs import plane

from lasso_motion_ros.core.errors import GeometryError
from lasso_motion_ros.geometry.carm import carm_projection


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


def test_distances_that_are_refused():
    with pytest.raises(GeometryError, match="source_object_m must be positive, found -1"):
        carm_projection(0, 0, source_detector_m=1, source_object_m=-1, pixel_size_m=1e-3, width=2, height=2)
    with pytest.raises(GeometryError, match="pixel_size_m must be positive, found nan"):
        carm_projection(0, 0, source_detector_m=1, source_object_m=1, pixel_size_m=np.nan, width=2, height=2)


def test_carm_principal_point_and_two_pitches():
    # 10 mm to the left is 10 × 1.0 / 0.5 = 20 mm on the detector: 40 px of 0.5 mm; 10 mm up is 80 px of 0.25 mm.
    view = carm_projection(
        0.0,
        0.0,
        source_detector_m=1.0,
        source_object_m=0.5,
        pixel_size_m=(0.5e-3, 0.25e-3),
        width=201,
        height=101,
        principal_point=(90.0, 40.0),
    )
    np.testing.assert_allclose(view.project(np.zeros(3)), [90.0, 40.0])
    np.testing.assert_allclose(view.project(np.array([0.01, 0.0, 0.0])), [130.0, 40.0])
    np.testing.assert_allclose(view.project(np.array([0.0, 0.0, 0.01])), [90.0, -40.0])
