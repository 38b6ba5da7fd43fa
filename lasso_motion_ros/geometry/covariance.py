"""Covariances of small rigid motions, carried from one point to another, and distances measured by a covariance.

A small motion is a shift v of a point and a rotation vector ω about axes fixed in the world; a point further on by p
then moves by v + ω × p = v + [−p]ₓ ω. Covariances follow by J Σ Jᵀ (first order).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy.special import gammaincc

from lasso_motion_ros.geometry.transforms import cross_product_matrix

Array = npt.NDArray[np.float64]

_ADJUGATE_SIGNS = np.array([[1.0, -1.0], [-1.0, 1.0]])


def at_world_origin(centre: Array, position: Array, rotation: Array) -> Array:
    """(6, 6) covariance of a motion at the world origin, in ROS order: x, y, z, then about the fixed axes x, y, z.

    Args:
        centre: (3,) the point to which the motion's covariance belongs, world metres.
        position: (3, 3) covariance of that point's shift, m².
        rotation: (3, 3) covariance of the rotation about it, rad²; independent of the shift.
    """
    lever = cross_product_matrix(centre)  # the origin lies at −c from the centre: ω × −c = [c]ₓ ω
    cross = lever @ rotation
    covariance = np.empty((6, 6))
    covariance[:3, :3], covariance[:3, 3:] = position + cross @ lever.T, cross
    covariance[3:, :3], covariance[3:, 3:] = cross.T, rotation
    return covariance


def at_point(covariance: Array, point: Array) -> Array:
    """(3, 3) covariance in m² of a moved point (3,), world metres, from a motion's (6, 6) at the world origin."""
    jacobian = np.hstack([np.eye(3), cross_product_matrix(-point)])
    return np.asarray(jacobian @ covariance @ jacobian.T)


def inverses(matrices: Array) -> tuple[Array, Array]:
    """Inverses (..., N, N) of matrices, and their determinants (...).

    Those of 2×2, as of a plane's two measurements, are written out: the library takes three times as long for both.

    Raises:
        numpy.linalg.LinAlgError: a matrix of another size is singular; a 2×2 one gives infinite values.
    """
    if matrices.shape[-1] != 2:
        return np.asarray(np.linalg.inv(matrices), dtype=np.float64), np.asarray(np.linalg.det(matrices))
    determinant = matrices[..., 0, 0] * matrices[..., 1, 1] - matrices[..., 0, 1] * matrices[..., 1, 0]
    adjugate = matrices[..., ::-1, ::-1].swapaxes(-1, -2) * _ADJUGATE_SIGNS
    return adjugate / determinant[..., None, None], np.asarray(determinant)


def largest_sigma(covariance: Array) -> float:
    """Largest standard deviation, in any direction, of a covariance (3, 3): the root of its largest eigenvalue.

    By the trigonometric solution of the cubic (O. K. Smith, Communications of the ACM 4(4), 1961), in a third of the
    time that the library takes.
    """
    (a, d, e), (_, b, f), (_, _, c) = covariance.tolist()
    mean = (a + b + c) / 3.0
    a, b, c = a - mean, b - mean, c - mean
    size = math.sqrt((a * a + b * b + c * c + 2.0 * (d * d + e * e + f * f)) / 6.0)
    if size == 0.0:  # alike in all directions
        return math.sqrt(max(mean, 0.0))
    a, b, c, d, e, f = (value / size for value in (a, b, c, d, e, f))
    half_determinant = 0.5 * (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e))
    angle = math.acos(min(max(half_determinant, -1.0), 1.0)) / 3.0
    return math.sqrt(max(mean + 2.0 * size * math.cos(angle), 0.0))


def squared_mahalanobis(offset: Array, covariance: Array) -> float:
    """Squared Mahalanobis distance dᵀ Σ⁻¹ d of an offset (N,) under a covariance (N, N); no unit.

    For a normally distributed offset it follows the χ² distribution with N degrees of freedom. In the plane, as of a
    plane's two measurements, and in space it is written out: the library takes six times as long.

    Raises:
        numpy.linalg.LinAlgError: the covariance is singular.
    """
    if len(offset) == 2:
        (x, y), ((a, b), (c, d)) = offset.tolist(), covariance.tolist()
        determinant = a * d - b * c
        if determinant == 0.0:
            raise np.linalg.LinAlgError("singular covariance")
        return float((x * (d * x - b * y) + y * (a * y - c * x)) / determinant)
    if len(offset) == 3:
        (x, y, z), ((a, d, e), (_, b, f), (_, _, c)) = offset.tolist(), covariance.tolist()
        # The adjugate's elements: of xx, yy, zz, xy, xz and yz.
        xx, yy, zz, xy, xz, yz = (
            b * c - f * f,
            a * c - e * e,
            a * b - d * d,
            e * f - c * d,
            d * f - b * e,
            d * e - a * f,
        )
        determinant = a * xx + d * xy + e * xz
        if determinant == 0.0:
            raise np.linalg.LinAlgError("singular covariance")
        crossed = 2.0 * (x * y * xy + x * z * xz + y * z * yz)
        return float((x * x * xx + y * y * yy + z * z * zz + crossed) / determinant)
    return float(offset @ np.linalg.solve(covariance, offset))


def probability_beyond(limit: float, covariance: Array, offset: Array | None = None) -> float:
    """Probability that a normal deviate in space is farther off than a limit.

    The square of its length is taken for a gamma variable of the same mean and variance, which about no offset it is
    where all directions are known as well, or one alone is not (Satterthwaite 1946, An approximate distribution of
    estimates of variance components; Patnaik, Biometrika 36, 1949).

    Args:
        limit: of its length.
        covariance: (3, 3), in units of the limit's square.
        offset: (3,) its mean, in units of the limit; none if not given.
    """
    # Written out, as in `largest_sigma`.
    (a, d, e), (_, b, f), (_, _, c) = covariance.tolist()
    mean, size2 = a + b + c, 0.0
    half_variance = a * a + b * b + c * c + 2.0 * (d * d + e * e + f * f)
    if offset is not None:
        x, y, z = offset.tolist()
        size2 = x * x + y * y + z * z
        half_variance += 2.0 * (a * x * x + b * y * y + c * z * z + 2.0 * (d * x * y + e * x * z + f * y * z))
    mean += size2
    if half_variance <= 0.0:
        return float(size2 > limit**2)
    return float(gammaincc(0.5 * mean**2 / half_variance, 0.5 * limit**2 * mean / half_variance))


def probabilities_beyond(limit: float, covariances: Array, offsets: Array) -> Array:
    """Probabilities (N,) that normal deviates in space are farther off than a limit: `probability_beyond` of many.

    Args:
        limit: of the length.
        covariances: (N, 3, 3), in units of the limit's square.
        offsets: (N, 3) their means, in units of the limit.
    """
    along = np.einsum("ni,nij,nj->n", offsets, covariances, offsets)
    sizes2 = np.square(offsets).sum(axis=1)
    means = np.trace(covariances, axis1=1, axis2=2) + sizes2
    half_variances = np.square(covariances).sum(axis=(1, 2)) + 2.0 * along
    is_sure = half_variances <= 0.0
    half_variances = np.where(is_sure, 1.0, half_variances)
    likely = gammaincc(0.5 * means**2 / half_variances, 0.5 * limit**2 * means / half_variances)
    return np.asarray(np.where(is_sure, sizes2 > limit**2, likely))


def log_student(distance: Array, determinant: Array, freedom: float) -> Array:
    """Natural logarithm of the density of Student's distribution in the plane.

    Args:
        distance: (...) squared Mahalanobis distance.
        determinant: (...) of the (2, 2) scale matrix.
        freedom: degrees of freedom.
    """
    peak = -math.log(2.0 * math.pi) - 0.5 * np.log(determinant)
    return np.asarray(peak - 0.5 * (freedom + 2.0) * np.log1p(distance / freedom))
