import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lasso_motion_ros.core.errors import EllipseError
from lasso_motion_ros.geometry.ellipse import Ellipse, ellipse_from_conic, fit_ellipse, fit_line

# Centre (500, 300), semi-axes 50 and 30, the major one along (3, 4) / 5.
ELLIPSE = Ellipse(np.array([500.0, 300.0]), np.array([30.0, 40.0]), np.array([-24.0, 18.0]))


def ellipse(x=0.0, y=0.0, major=1.0, ratio=0.5, turn=0.0):
    along, across = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    return Ellipse(np.array([x, y]), major * along, major * ratio * across)


def axis_ratio(found):
    return np.linalg.norm(found.semi_minor) / np.linalg.norm(found.semi_major)


def assert_same(found, expected, tolerance):
    np.testing.assert_allclose(found.centre, expected.centre, atol=tolerance)
    np.testing.assert_allclose(found.conic, expected.conic, atol=1e-6)
    assert np.linalg.norm(found.semi_major) == pytest.approx(np.linalg.norm(expected.semi_major), abs=tolerance)
    assert np.linalg.norm(found.semi_minor) == pytest.approx(np.linalg.norm(expected.semi_minor), abs=tolerance)


def test_points_by_hand():
    # Four points: both ends of the major and of the minor axis.
    np.testing.assert_allclose(ELLIPSE.points(4), [[530, 340], [476, 318], [470, 260], [524, 282]], atol=1e-9)


def test_conic_of_the_unit_circle_by_hand():
    # x² + y² − 1, of norm √3
    np.testing.assert_allclose(ellipse(ratio=1.0).conic, np.diag([1.0, 1.0, -1.0]) / np.sqrt(3.0), atol=1e-12)


def test_conic_is_zero_on_the_curve_and_negative_inside():
    for point in ELLIPSE.points(7):
        x = np.append(point, 1.0)
        assert x @ ELLIPSE.conic @ x == pytest.approx(0.0, abs=1e-9)
    inside = np.append(ELLIPSE.centre, 1.0)
    assert inside @ ELLIPSE.conic @ inside < 0


@given(
    st.floats(-2000, 2000),
    st.floats(-2000, 2000),
    st.floats(5, 500),
    st.floats(0.05, 0.98),
    st.floats(0, np.pi),
    st.integers(6, 60),
)
def test_exact_points_give_the_ellipse_back(x, y, major, ratio, turn, count):
    expected = ellipse(x, y, major, ratio, turn)
    found = fit_ellipse(expected.points(count))
    assert_same(found, expected, 1e-5 * major)
    assert found.semi_major @ found.semi_minor == pytest.approx(0.0, abs=1e-6 * major**2)


def test_circle_is_recovered():
    found = fit_ellipse(ellipse(10.0, 20.0, 5.0, 1.0).points(12))
    np.testing.assert_allclose(found.centre, [10.0, 20.0])
    assert axis_ratio(found) == pytest.approx(1.0)


def test_part_of_the_curve_is_enough_when_it_is_exact():
    assert_same(fit_ellipse(ELLIPSE.points(100)[:30]), ELLIPSE, 1e-6)


@given(st.floats(-1e5, 1e5), st.floats(-1e5, 1e5), st.floats(1e-3, 1e3))
def test_place_and_scale_do_not_matter(x, y, scale):
    noisy = ELLIPSE.points(40) - ELLIPSE.centre + np.random.default_rng(1).normal(size=(40, 2))
    here, there = fit_ellipse(noisy), fit_ellipse(scale * noisy + [x, y])
    # A shift by 1e5 costs five digits of a thousandth of a pixel.
    tolerance = 1e-6 * scale + 1e-9 * (abs(x) + abs(y))
    np.testing.assert_allclose(there.centre, scale * here.centre + [x, y], atol=tolerance)
    np.testing.assert_allclose(
        np.linalg.norm(there.semi_major), scale * np.linalg.norm(here.semi_major), atol=tolerance
    )


def test_noise_averages_out():
    # 200 points with 1 px: the centre's standard error is about √2 / √200 = 0.1 px per axis.
    random = np.random.default_rng(7)
    found = [fit_ellipse(ELLIPSE.points(200) + random.normal(size=(200, 2))) for _ in range(20)]
    errors = np.array([f.centre - ELLIPSE.centre for f in found])
    assert np.sqrt((errors**2).mean()) < 0.2
    assert np.mean([axis_ratio(f) for f in found]) == pytest.approx(0.6, abs=0.01)


def test_an_ellipse_comes_out_even_where_a_hyperbola_fits_better():
    # The constraint 4ac − b² = 1 admits nothing else.
    x = np.linspace(-3.0, 3.0, 30)
    found = fit_ellipse(np.column_stack([x, np.sqrt(1 + x * x)]))
    assert 0 < axis_ratio(found) <= 1


@pytest.mark.parametrize("factor", [1.0, -1.0, 1e-6, -3e4])
def test_conic_of_any_scale_and_sign(factor):
    assert_same(ellipse_from_conic(factor * ELLIPSE.conic), ELLIPSE, 1e-6)


@pytest.mark.parametrize(
    ("conic", "text"),
    [
        (np.diag([1.0, -1.0, -1.0]), "not an ellipse"),  # hyperbola
        (np.array([[1.0, 0, 0], [0, 0, -0.5], [0, -0.5, 0]]), "not an ellipse"),  # parabola y = x²
        (np.diag([1.0, 1.0, 1.0]), "empty"),  # x² + y² = −1
        (np.diag([1.0, 1.0, 0.0]), "single point"),
        (np.diag([1.0, 1e14, -1.0]), "collapsed"),
    ],
)
def test_conics_that_are_no_ellipse(conic, text):
    with pytest.raises(EllipseError, match=text):
        ellipse_from_conic(conic)


@pytest.mark.parametrize(
    ("points", "text"),
    [
        (ELLIPSE.points(5), r"at least 6 points \(N, 2\), found shape \(5, 2\)"),
        (np.zeros((8, 3)), r"found shape \(8, 3\)"),
        (np.ones((8, 2)), "coincide"),
        (np.column_stack([np.arange(8.0), 2 * np.arange(8.0) + 1]), "line"),
        (np.vstack([ELLIPSE.points(8), [[np.nan, 0.0]]]), "not all finite"),
    ],
)
def test_points_that_determine_no_ellipse(points, text):
    with pytest.raises(EllipseError, match=text):
        fit_ellipse(points)


def test_line_by_hand():
    # 3x + 4y = 50: distance 10 from the origin along (0.6, 0.8)
    along = np.linspace(-5.0, 5.0, 9)[:, None]
    line = fit_line(np.array([6.0, 8.0]) + along * np.array([-0.8, 0.6]))
    np.testing.assert_allclose(line * np.sign(line[0]), [0.6, 0.8, -10.0], atol=1e-9)


def test_line_minimises_the_distances_across_itself():
    # Deviations of ±1 in x about the vertical line x = 3, symmetric in y: regression on x would fail.
    points = np.array([[2.0, -10.0], [4.0, -10.0], [2.0, 10.0], [4.0, 10.0]])
    line = fit_line(points)
    np.testing.assert_allclose(line * np.sign(line[0]), [1.0, 0.0, -3.0], atol=1e-9)


@pytest.mark.parametrize(
    ("points", "text"), [(np.ones((4, 2)), "coincide"), (np.full((4, 2), np.inf), "not all finite")]
)
def test_points_that_determine_no_line(points, text):
    with pytest.raises(EllipseError, match=text):
        fit_line(points)
