import numpy as np
import pytest

from lasso_motion_ros.geometry.curves import (
    arc_length,
    distance_of_point,
    distance_to_curve,
    quarter_turn,
    resample,
    slope,
    unit_tangents,
)

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
    assert distance_of_point(np.array(point, dtype=float), CORNER) == pytest.approx(distance)


def test_distance_in_space_and_with_a_repeated_point():
    curve = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 2.0]])
    points = np.array([[3.0, 4.0, 1.0], [0.0, 0.0, 3.0]])
    np.testing.assert_allclose(distance_to_curve(points, curve), [5.0, 1.0])
    np.testing.assert_allclose([distance_of_point(point, curve) for point in points], [5.0, 1.0])


@pytest.mark.parametrize("count", [1, 400])
def test_distances_to_a_curve_that_comes_back_beside_itself(count):
    """As an ellipse seen nearly edge-on does; segments of very different lengths; against one point at a time."""
    random = np.random.default_rng(3)
    turn = np.cumsum(random.uniform(0.01, 0.3, 60))
    curve = np.column_stack([30.0 * np.cos(turn), 0.7 * np.sin(turn)]) + 500.0
    points = curve[random.integers(0, 60, count)] + random.normal(0.0, 2.0, (count, 2))
    expected = [distance_of_point(point, curve) for point in points]
    np.testing.assert_allclose(distance_to_curve(points, curve), expected, atol=1e-10)
    assert distance_to_curve(points[:0], curve).shape == (0,)


def test_a_point_that_is_none_has_no_distance():
    distances = distance_to_curve(np.array([[0.0, 1.0], [np.nan, 0.0], [0.0, 2.0]]), CORNER)
    np.testing.assert_array_equal(distances, [1.0, np.nan, 2.0])


def test_slopes_are_central_differences_one_sided_at_the_ends():
    np.testing.assert_allclose(slope(np.array([[0.0, 1.0, 4.0, 9.0]]), axis=-1), [[1.0, 2.0, 4.0, 5.0]])
    np.testing.assert_allclose(slope(CORNER[None], axis=1)[0], np.gradient(CORNER, axis=0), atol=1e-15)


def test_tangents_of_an_open_curve_by_hand():
    # Along x at the start, along y at the end, from one end to the other at the corner: (3, 4) / 2 long.
    tangents, spacing = unit_tangents(np.stack([CORNER, CORNER[::-1]]))
    np.testing.assert_allclose(tangents[0], [[1.0, 0.0], [0.6, 0.8], [0.0, 1.0]])
    np.testing.assert_allclose(tangents[1], -tangents[0, ::-1])
    np.testing.assert_allclose(spacing, [[3.0, 2.5, 4.0], [4.0, 2.5, 3.0]])


def test_tangents_of_a_closed_curve_by_hand():
    square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    tangents, spacing = unit_tangents(square, closed=True)
    np.testing.assert_allclose(tangents, np.sqrt(0.5) * np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]]))
    np.testing.assert_allclose(spacing, np.sqrt(2.0))


def test_points_that_coincide_have_no_direction():
    tangents, spacing = unit_tangents(np.ones((3, 2)))
    np.testing.assert_array_equal(tangents, np.zeros((3, 2)))
    np.testing.assert_array_equal(spacing, np.zeros(3))


def test_a_quarter_turn_by_hand():
    np.testing.assert_array_equal(quarter_turn(np.array([[3.0, 4.0], [1.0, 0.0]])), [[-4.0, 3.0], [0.0, 1.0]])
