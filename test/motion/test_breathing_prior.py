import numpy as np
import pytest

from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.motion.breathing_prior import TUNING, breathing_shape

# Of unit variance along the body (z), in a world of axes LPS: 1.3 mm to the front for every 4.9 mm to the feet.
SUPINE = np.array(
    [
        [TUNING.lateral_sigma**2, 0.0, 0.0],
        [0.0, TUNING.frontal_sigma**2 + (1.3 / 4.9) ** 2, 1.3 / 4.9],
        [0.0, 1.3 / 4.9, 1.0],
    ]
)


def views(lao_deg=(-30.0, 60.0), cranial_deg=(0.0, 0.0), mirrored=True):
    sizes = {"source_detector_m": 1.2, "source_object_m": 0.8, "pixel_size_m": 3e-4, "width": 512, "height": 512}
    angles = zip("ab", np.radians(lao_deg), np.radians(cranial_deg), strict=True)
    return {plane: carm_projection(lao, cranial, mirrored=mirrored, **sizes) for plane, lao, cranial in angles}


@pytest.mark.parametrize(
    "lao_deg", [(-30.0, 60.0), (0.0, 90.0), (0.0, -90.0), (-45.0, 45.0), (40.0, -40.0), (60.0, -20.0)]
)
@pytest.mark.parametrize("cranial_deg", [(0.0, 0.0), (25.0, 0.0), (-25.0, 20.0)])
@pytest.mark.parametrize("mirrored", [True, False])
def test_breathing_goes_to_the_feet_and_a_quarter_as_far_to_the_front(lao_deg, cranial_deg, mirrored):
    np.testing.assert_allclose(breathing_shape(views(lao_deg, cranial_deg, mirrored), "supine"), SUPINE, atol=1e-12)


def test_prone_the_front_is_below():
    flipped = SUPINE * np.array([[1, 1, 1], [1, 1, -1], [1, -1, 1]])
    np.testing.assert_allclose(breathing_shape(views(), "prone"), flipped, atol=1e-12)


def test_of_an_unknown_posture_nothing_is_expected():
    np.testing.assert_array_equal(breathing_shape(views(), "unknown"), np.eye(3))


@pytest.mark.parametrize("seed", range(8))
def test_the_world_may_count_its_axes_in_any_way(seed):
    random = np.random.default_rng(seed)
    axes = np.eye(3)[random.permutation(3)] * random.choice([-1.0, 1.0], 3)  # rows: the other world's axes in this one
    axes *= np.linalg.det(axes)
    to_this = np.eye(4)
    to_this[:3, :3] = axes.T
    other = {plane: Projection(view.matrix @ to_this, view.width, view.height) for plane, view in views().items()}
    np.testing.assert_allclose(breathing_shape(other, "supine"), axes @ SUPINE @ axes.T, atol=1e-12)


def test_the_most_likely_direction_is_a_quarter_to_the_front():
    shape = breathing_shape(views(), "supine")
    # Seen to go 10 mm to the feet, the heart is expected 2.65 mm further to the front, which is -y.
    expected = shape[:, 2] / shape[2, 2] * -10.0
    np.testing.assert_allclose(expected, [0.0, -10.0 * 1.3 / 4.9, -10.0], atol=1e-12)


def turned_over(view):
    """The view with its image upside down."""
    flip = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, view.height - 1.0], [0.0, 0.0, 1.0]])
    return Projection(flip @ view.matrix, view.width, view.height)


def test_views_that_do_not_show_how_the_patient_lies_tell_nothing():
    frontal = views()
    np.testing.assert_array_equal(breathing_shape({**frontal, "b": turned_over(frontal["b"])}, "supine"), np.eye(3))
    both = {plane: turned_over(view) for plane, view in frontal.items()}
    # Upside down the feet are taken for the head.
    np.testing.assert_allclose(breathing_shape(both, "supine"), breathing_shape(frontal, "prone"), atol=1e-12)
    across = views(lao_deg=(-90.0, 90.0))
    np.testing.assert_array_equal(breathing_shape(across, "supine"), np.eye(3))
