import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from lasso_motion_ros.geometry.transforms import (
    apply,
    cross_product_matrix,
    inverse,
    quaternion_from_rotation,
    rigid,
    rotation_from_quaternion,
    rotation_from_vector,
)

component = st.floats(-3.0, 3.0)
vectors = st.tuples(component, component, component)


def test_quarter_turn_about_z_by_hand():
    rotation = rotation_from_vector([0.0, 0.0, np.pi / 2])
    np.testing.assert_allclose(rotation, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)


def test_no_rotation_and_a_tiny_one():
    np.testing.assert_array_equal(rotation_from_vector([0.0, 0.0, 0.0]), np.eye(3))
    # First order: I + [v]×
    np.testing.assert_allclose(
        rotation_from_vector([1e-9, 2e-9, -3e-9]),
        [[1, 3e-9, 2e-9], [-3e-9, 1, -1e-9], [-2e-9, 1e-9, 1]],
        atol=1e-17,
    )


@given(vectors)
def test_rotations_are_proper_and_turn_back(vector):
    rotation = rotation_from_vector(vector)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(rotation_from_vector(-np.array(vector)), rotation.T, atol=1e-12)
    np.testing.assert_allclose(rotation @ vector, vector, atol=1e-12)


@given(vectors, vectors)
def test_the_cross_product_as_a_matrix(first, second):
    np.testing.assert_allclose(cross_product_matrix(first) @ second, np.cross(first, second), atol=1e-12)


def test_rigid_turns_about_its_centre_then_shifts():
    # (2, 0, 0) is 1 from the centre (1, 0, 0): a quarter turn takes it to (1, 1, 0), the shift to (1, 1, 5).
    matrix = rigid([0.0, 0.0, np.pi / 2], [0.0, 0.0, 5.0], centre=[1.0, 0.0, 0.0])
    np.testing.assert_allclose(apply(matrix, np.array([2.0, 0.0, 0.0])), [1.0, 1.0, 5.0], atol=1e-12)
    np.testing.assert_allclose(apply(matrix, np.array([1.0, 0.0, 0.0])), [1.0, 0.0, 5.0], atol=1e-12)


@given(vectors, vectors, vectors)
def test_inverse_takes_points_back(rotation, translation, centre):
    matrix = rigid(rotation, translation, centre)
    points = np.array([[0.1, 0.2, 0.3], [-1.0, 0.0, 2.0]])
    np.testing.assert_allclose(apply(inverse(matrix), apply(matrix, points)), points, atol=1e-11)
    np.testing.assert_allclose(inverse(matrix) @ matrix, np.eye(4), atol=1e-11)


def test_apply_keeps_the_shape():
    assert apply(np.eye(4), np.zeros((3,))).shape == (3,)
    assert apply(np.eye(4), np.zeros((5, 7, 3))).shape == (5, 7, 3)


def test_quaternions_by_hand():
    root = np.sqrt(0.5)
    np.testing.assert_allclose(quaternion_from_rotation(np.eye(3)), [0, 0, 0, 1])
    np.testing.assert_allclose(quaternion_from_rotation(rotation_from_vector([0, 0, np.pi / 2])), [0, 0, root, root])
    np.testing.assert_allclose(quaternion_from_rotation(rotation_from_vector([-np.pi / 2, 0, 0])), [-root, 0, 0, root])


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_quaternions_of_half_turns(axis):
    # w = 0: the term that a naive formula divides by.
    rotation = rotation_from_vector(np.pi * np.eye(3)[axis])
    quaternion = quaternion_from_rotation(rotation)
    np.testing.assert_allclose(np.abs(quaternion), np.eye(4)[axis], atol=1e-12)
    np.testing.assert_allclose(Rotation.from_quat(quaternion).as_matrix(), rotation, atol=1e-12)


@given(vectors, st.floats(0.01, 100.0))
def test_a_quaternion_of_any_length_is_read_as_scipy_reads_it(vector, length):
    quaternion = length * Rotation.from_rotvec(vector).as_quat()
    expected = Rotation.from_quat(quaternion).as_matrix()
    np.testing.assert_allclose(rotation_from_quaternion(quaternion), expected, atol=1e-12)
    np.testing.assert_allclose(rotation_from_quaternion(-quaternion), expected, atol=1e-12)


@given(vectors)
def test_scipy_reads_the_rotation_back(vector):
    rotation = rotation_from_vector(vector)
    quaternion = quaternion_from_rotation(rotation)
    assert np.linalg.norm(quaternion) == pytest.approx(1.0)
    assert quaternion[3] >= 0
    np.testing.assert_allclose(Rotation.from_quat(quaternion).as_matrix(), rotation, atol=1e-12)
