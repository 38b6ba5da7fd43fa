import numpy as np
import pytest

from lasso_motion_ros.geometry.curves import arc_length, distance_to_curve, resample

CORNER = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])  # 3 along x, then 4 along y


def test_arc_length_by_hand():
    np.testing.assert_array_equal(arc_length(CORNER), [0.0, 3.0, 7.0])


def test_arc_length_in_space():
    np.testing.assert_allclose(arc_length(np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 2.0]])), [0.0, 3.0])


def test_resampling_is_even_along_the_curve_and_keeps_the_ends():
    # 7 long, 8 points: one every unit.
    np.testing.assert_allclose(
        resample(CORNER, 8), [[0, 0], [1, 0], [2, 0], [3, 0], [3, 1], [3, 2], [3, 3], [3, 4]], atol=1e-12
    )


def test_resampling_passes_over_repeated_points():
    doubled = np.repeat(CORNER, 2, axis=0)
    np.testing.assert_allclose(resample(doubled, 8), resample(CORNER, 8), atol=1e-12)


@pytest.mark.parametrize(
    ("point", "distance"),
    [
        ((1.0, 2.0), 2.0),  # foot on both segments: 2 to the first, 2 to the second
        ((1.0, -1.0), 1.0),
        ((-3.0, -4.0), 5.0),  # beyond the first end
        ((6.0, 8.0), 5.0),  # beyond the last
        ((3.0, 2.0), 0.0),
    ],
)
def test_distance_by_hand(point, distance):
    assert distance_to_curve(np.array([point]), CORNER)[0] == pytest.approx(distance)


def test_distance_in_space_and_with_a_repeated_point():
    curve = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 2.0]])
    np.testing.assert_allclose(distance_to_curve(np.array([[3.0, 4.0, 1.0], [0.0, 0.0, 3.0]]), curve), [5.0, 1.0])
