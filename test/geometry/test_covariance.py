import numpy as np
import pytest
from scipy.stats import multivariate_t

from lasso_motion_ros.evaluation.measures import centre_covariance
from lasso_motion_ros.geometry.covariance import (
    at_point,
    at_world_origin,
    inverses,
    largest_sigma,
    log_student,
    probabilities_beyond,
    probability_beyond,
    squared_mahalanobis,
)

RANDOM = np.random.default_rng(8)


def test_at_the_world_origin_by_sampling():
    centre = np.array([0.03, -0.02, 0.05])
    position, rotation = (a @ a.T for a in RANDOM.normal(size=(2, 3, 3)))
    position, rotation = 1e-8 * position, 1e-6 * rotation
    shifts = RANDOM.multivariate_normal(np.zeros(3), position, 100_000)
    turns = RANDOM.multivariate_normal(np.zeros(3), rotation, 100_000)
    # T x = c + R (x − c) + shift, at x = 0.
    origins = centre + shifts - centre - np.cross(turns, centre)
    sampled = np.cov(np.hstack([origins, turns]).T)
    expected = at_world_origin(centre, position, rotation)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(sampled / scale, expected / scale, atol=0.02)
    np.testing.assert_allclose(expected, expected.T, rtol=1e-12)


def test_there_and_back():
    centre = np.array([0.03, -0.02, 0.05])
    position, rotation = (a @ a.T for a in RANDOM.normal(size=(2, 3, 3)))
    np.testing.assert_allclose(at_point(at_world_origin(centre, position, rotation), centre), position, atol=1e-12)


def test_at_a_point_by_hand():
    # Turning by 0.01 rad about z alone moves a point 0.1 m along x by 1 mm along y.
    covariance = np.zeros((6, 6))
    covariance[5, 5] = 0.01**2
    np.testing.assert_allclose(at_point(covariance, np.array([0.1, 0.0, 0.0])), np.diag([0.0, 1e-3, 0.0]) ** 2)


def test_evaluations_own_formula_agrees():
    factor = RANDOM.normal(size=(6, 6))
    for point in RANDOM.normal(size=(3, 3)):
        np.testing.assert_allclose(at_point(factor @ factor.T, point), centre_covariance(factor @ factor.T, point))


def test_squared_mahalanobis_by_hand():
    # Two standard deviations along one axis, three along another: 4 + 9.
    assert squared_mahalanobis(np.array([4.0, 3.0]), np.diag([4.0, 1.0])) == pytest.approx(13.0)
    # Correlated: Σ⁻¹ = (2 −1; −1 2) / 3.
    assert squared_mahalanobis(np.array([1.0, 0.0]), np.array([[2.0, 1.0], [1.0, 2.0]])) == pytest.approx(2.0 / 3.0)
    # As the library solves it, which is asked in four dimensions and more.
    for size in (2, 3, 4):
        half, offset = np.random.default_rng(size).normal(size=(2, size, size))
        assert squared_mahalanobis(offset[0], half @ half.T) == pytest.approx(
            offset[0] @ np.linalg.solve(half @ half.T, offset[0]), rel=1e-9
        )


@pytest.mark.parametrize("size", [2, 3])
def test_an_exact_covariance_measures_nothing(size):
    with pytest.raises(np.linalg.LinAlgError):
        squared_mahalanobis(np.ones(size), np.zeros((size, size)))


@pytest.mark.parametrize("size", [1, 2, 3])
def test_inverses_and_determinants_of_many(size):
    factors = RANDOM.normal(size=(5, size, size))
    matrices = factors @ factors.swapaxes(-1, -2) + 0.1 * np.eye(size)
    inverse, determinant = inverses(matrices)
    np.testing.assert_allclose(inverse @ matrices, np.broadcast_to(np.eye(size), matrices.shape), atol=1e-12)
    np.testing.assert_allclose(determinant, np.linalg.det(matrices), rtol=1e-12)


def test_the_largest_sigma_of_any_covariance():
    for scales in RANDOM.uniform(-4.0, 0.0, (100, 3)):
        factor = 10.0**scales * RANDOM.normal(size=(3, 3))
        covariance = factor @ factor.T
        assert largest_sigma(covariance) == pytest.approx(np.sqrt(np.linalg.eigvalsh(covariance)[-1]), rel=1e-9)
    assert largest_sigma(np.diag([4.0, 4.0, 4.0])) == 2.0
    assert largest_sigma(np.diag([9.0, 4.0, 9.0])) == pytest.approx(3.0)
    assert largest_sigma(np.zeros((3, 3))) == 0.0


def test_the_probability_of_being_off_by_hand():
    # Within one, two and three standard deviations: 68.27, 95.45 and 99.73 %.
    for limit, inside in ((1.0, 0.6827), (2.0, 0.9545), (3.0, 0.9973)):
        assert probability_beyond(2.0 * limit, np.diag([4.0, 0.0, 0.0])) == pytest.approx(1.0 - inside, abs=1e-4)
    # In all directions alike: 19.87, 73.85 and 97.07 % (chi squared of three degrees of freedom).
    for limit, inside in ((1.0, 0.1987), (2.0, 0.7385), (3.0, 0.9707)):
        assert probability_beyond(2.0 * limit, 4.0 * np.eye(3)) == pytest.approx(1.0 - inside, abs=1e-4)
    assert probability_beyond(2.0, np.zeros((3, 3))) == 0.0


def test_the_probability_of_being_off_is_that_of_drawn_deviates():
    random = np.random.default_rng(6)
    for sigmas in ((0.3, 0.5, 0.9), (0.1, 0.7, 0.8), (0.6, 0.6, 1.2)):
        axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
        drawn = random.normal(size=(200_000, 3)) * sigmas @ axes.T
        share = (np.linalg.norm(drawn, axis=1) > 2.0).mean()
        assert probability_beyond(2.0, axes @ np.diag(np.square(sigmas)) @ axes.T) == pytest.approx(share, rel=0.1)
        beside = np.array([0.5, -1.0, 0.7])
        share = (np.linalg.norm(drawn + beside, axis=1) > 2.0).mean()
        covariance = axes @ np.diag(np.square(sigmas)) @ axes.T
        assert probability_beyond(2.0, covariance, beside) == pytest.approx(share, rel=0.1)
    assert probability_beyond(2.0, np.zeros((3, 3)), np.array([0.0, 3.0, 0.0])) == 1.0


def test_many_probabilities_of_being_off_are_those_of_each():
    random = np.random.default_rng(7)
    half = random.normal(size=(20, 3, 3))
    covariances, offsets = half @ half.swapaxes(1, 2), random.normal(size=(20, 3))
    covariances[3:5], offsets[3], offsets[4] = 0.0, [0.0, 3.0, 0.0], [0.5, 0.0, 0.0]  # which are sure
    each = [probability_beyond(2.0, *one) for one in zip(covariances, offsets, strict=True)]
    np.testing.assert_allclose(probabilities_beyond(2.0, covariances, offsets), each, rtol=1e-12)


def test_students_density_is_the_librarys():
    scale, away = np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([1.0, -2.0])
    expected = multivariate_t(np.zeros(2), scale, df=4.0).logpdf(away)
    assert log_student(squared_mahalanobis(away, scale), np.linalg.det(scale), 4.0) == pytest.approx(expected)
