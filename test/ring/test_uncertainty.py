import numpy as np

from lasso_motion_ros.geometry.transforms import rotation_from_vector
from lasso_motion_ros.ring.uncertainty import calibration_covariance, pivot_covariance

RANDOM = np.random.default_rng(8)


def test_a_displacement_is_known_to_its_share():
    # 3-4-0 mm: 5 mm long, of which 0.15 % are 7.5 µm.
    moved = np.array([3e-3, 4e-3, 0.0])
    np.testing.assert_allclose(calibration_covariance(moved, 0.0), 7.5e-6**2 * np.eye(3), rtol=1e-12)
    # Planes that disagree by 3 mm at 750 mm from the source are off by 4 mrad: 20 µm of 5 mm, besides.
    expected = (7.5e-6**2 + 20e-6**2) * np.eye(3)
    np.testing.assert_allclose(calibration_covariance(moved, 3.0), expected, rtol=1e-12)


def test_a_pivot_that_is_off_moves_the_centre_by_hand_and_by_sampling():
    # Turned by 0.05 rad about z: an offset along z does nothing, across it 1 mm becomes 0.05 mm.
    by_hand = np.diag([5e-5, 5e-5, 0.0]) ** 2
    np.testing.assert_allclose(pivot_covariance(np.array([0.0, 0.0, 0.05]), 0.0), by_hand, atol=1e-20)
    turn, stretch = np.array([0.03, -0.05, 0.02]), 0.04
    offsets = 1e-3 * RANDOM.normal(size=(200_000, 3))
    moved = offsets @ rotation_from_vector(turn).T * np.exp(stretch) - offsets
    np.testing.assert_allclose(np.cov(moved.T), pivot_covariance(turn, stretch), atol=0.05 * np.var(moved))
