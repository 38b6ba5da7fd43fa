"""Rigid transforms of the world frame: 4×4 matrices, rotation vectors, quaternions."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def rotation_from_vector(vector: npt.ArrayLike) -> Array:
    """(3, 3) rotation about the axis `vector` (3,) by its length in radians (Rodrigues' formula)."""
    x, y, z = np.asarray(vector, dtype=np.float64).tolist()
    angle = math.sqrt(x * x + y * y + z * z)
    # Below, the next term of each series is under the rounding of the first.
    if angle < 1e-4:
        first, second = 1.0 - angle * angle / 6.0, 0.5 - angle * angle / 24.0
    else:
        first, second = math.sin(angle) / angle, (1.0 - math.cos(angle)) / (angle * angle)
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    return np.array(
        [
            [1.0 - second * (yy + zz), second * xy - first * z, second * xz + first * y],
            [second * xy + first * z, 1.0 - second * (xx + zz), second * yz - first * x],
            [second * xz - first * y, second * yz + first * x, 1.0 - second * (xx + yy)],
        ]
    )


def cross_product_matrix(vector: npt.ArrayLike) -> Array:
    """(3, 3) skew-symmetric matrix [v]ₓ of a vector (3,), for which [v]ₓ w = v × w."""
    x, y, z = np.asarray(vector, dtype=np.float64).tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rigid(rotation_vector: npt.ArrayLike, translation: npt.ArrayLike, centre: npt.ArrayLike = (0, 0, 0)) -> Array:
    """(4, 4) transform of the world, metres: rotate about a point, then shift.

    Args:
        rotation_vector: (3,) axis times angle, rad.
        translation: (3,) metres.
        centre: (3,) the point that the rotation leaves where it is, metres.
    """
    matrix = np.eye(4)
    centre = np.asarray(centre, dtype=np.float64)
    matrix[:3, :3] = rotation_from_vector(rotation_vector)
    matrix[:3, 3] = centre - matrix[:3, :3] @ centre + np.asarray(translation, dtype=np.float64)
    return matrix


def inverse(transform: Array) -> Array:
    """(4, 4) inverse of a rigid transform, by its transposed rotation."""
    matrix = np.eye(4)
    matrix[:3, :3] = transform[:3, :3].T
    matrix[:3, 3] = -transform[:3, :3].T @ transform[:3, 3]
    return matrix


def apply(transform: Array, points: Array) -> Array:
    """Points (..., 3) moved by a (4, 4) transform, in its unit."""
    return np.asarray(np.asarray(points) @ transform[:3, :3].T + transform[:3, 3])


def quaternion_from_rotation(rotation: Array) -> Array:
    """(4,) unit quaternion x, y, z, w with w ≥ 0 of a (3, 3) rotation (Shepperd 1978: largest term first).

    SciPy's `Rotation` does the same in several times the time, and in other last bits from version to version. This is
    what published poses go through.
    """
    m = rotation.tolist()
    trace = m[0][0] + m[1][1] + m[2][2]
    squares = [1 + 2 * m[0][0] - trace, 1 + 2 * m[1][1] - trace, 1 + 2 * m[2][2] - trace, 1 + trace]
    largest = squares.index(max(squares))
    if largest == 3:
        q = [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1], squares[3]]
    else:
        i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
        q = [0.0, 0.0, 0.0, m[k][j] - m[j][k]]
        q[i], q[j], q[k] = squares[i], m[j][i] + m[i][j], m[k][i] + m[i][k]
    length = math.hypot(*q) if q[3] >= 0.0 else -math.hypot(*q)
    return np.array([part / length for part in q])


def rotation_from_quaternion(quaternion: npt.ArrayLike) -> Array:
    """(3, 3) rotation of a quaternion (4,): x, y, z, w, of any length but zero.

    Not SciPy's `Rotation`: to import it costs a process half a second before it can begin.
    """
    q = np.asarray(quaternion, dtype=np.float64)
    x, y, z, w = (float(component) for component in q / np.linalg.norm(q))
    return np.array(
        [
            [x * x - y * y - z * z + w * w, 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), -x * x + y * y - z * z + w * w, 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), -x * x - y * y + z * z + w * w],
        ]
    )
