"""Ellipses in the image: direct least-squares fit, conic matrices, points along the curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import EllipseError

Array = npt.NDArray[np.float64]

# Below this ratio of semi-axes the fit is a line segment within rounding: its conic is singular.
SMALLEST_AXIS_RATIO = 1e-6


@dataclass(frozen=True, eq=False)
class Ellipse:
    """An ellipse in a plane, in the units of the points it came from.

    Attributes:
        centre: (2,).
        semi_major: (2,) vector from the centre to an end of the major axis.
        semi_minor: (2,) likewise of the minor axis, perpendicular to it.
    """

    centre: Array
    semi_major: Array
    semi_minor: Array

    @property
    def conic(self) -> Array:
        """(3, 3) symmetric C of unit norm with xᵀ C x = 0 on the curve and < 0 inside."""
        axes = np.column_stack([self.semi_major, self.semi_minor])
        to_unit_circle = np.linalg.inv(np.vstack([np.column_stack([axes, self.centre]), [0.0, 0.0, 1.0]]))
        conic = to_unit_circle.T @ np.diag([1.0, 1.0, -1.0]) @ to_unit_circle
        return np.asarray(conic / np.linalg.norm(conic))

    def points(self, count: int) -> Array:
        """(count, 2) points, evenly spaced in the eccentric angle."""
        angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)[:, None]
        return np.asarray(self.centre + np.cos(angles) * self.semi_major + np.sin(angles) * self.semi_minor)


def fit_ellipse(points: Array) -> Ellipse:
    """Direct least-squares fit of an ellipse to points (N, 2), N ≥ 6.

    The numerically stable form of Halir and Flusser (WSCG 1998, their eqs. 26–29) of Fitzgibbon's fit: the
    algebraic distance is minimised under 4ac − b² = 1, which only ellipses satisfy. Points are centred and
    scaled first, so that the result does not depend on where in the image they lie.

    Raises:
        EllipseError: fewer than six points, non-finite points, or points (nearly) on a line, through which
            no ellipse is determined.
    """
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 6:
        raise EllipseError(f"an ellipse needs at least 6 points (N, 2), found shape {points.shape}")
    if not np.all(np.isfinite(points)):
        raise EllipseError("the points through which to lay an ellipse are not all finite")
    mean = points.mean(axis=0)
    spread = float(np.sqrt(np.mean((points - mean) ** 2)))
    if spread == 0.0:
        raise EllipseError("all points coincide: no ellipse passes through them")
    x, y = ((points - mean) / spread).T
    quadratic = np.column_stack([x * x, x * y, y * y])
    linear = np.column_stack([x, y, np.ones_like(x)])
    s1, s2, s3 = quadratic.T @ quadratic, quadratic.T @ linear, linear.T @ linear
    if np.linalg.cond(s3) > 1e12:
        raise EllipseError("the points lie on a line: no ellipse passes through them")
    elimination = -np.linalg.solve(s3, s2.T)
    reduced = s1 + s2 @ elimination
    # Left-multiplied by the inverse of the constraint matrix of 4ac − b².
    reduced = np.array([reduced[2] / 2.0, -reduced[1], reduced[0] / 2.0])
    _, vectors = np.linalg.eig(reduced)
    vectors = np.real(vectors)
    discriminants = 4.0 * vectors[0] * vectors[2] - vectors[1] ** 2
    best = int(np.argmax(discriminants))
    if not discriminants[best] > 0.0:
        raise EllipseError("no ellipse fits the points: the best conic is a parabola or a hyperbola")
    a, b, c = vectors[:, best]
    d, e, f = elimination @ vectors[:, best]
    conic = np.array([[a, b / 2, d / 2], [b / 2, c, e / 2], [d / 2, e / 2, f]])
    fitted = ellipse_from_conic(conic)
    return Ellipse(fitted.centre * spread + mean, fitted.semi_major * spread, fitted.semi_minor * spread)


def ellipse_from_conic(conic: Array) -> Ellipse:
    """The ellipse of a symmetric (3, 3) conic of any scale and sign.

    Raises:
        EllipseError: the conic is no real ellipse (hyperbola, parabola, empty, or collapsed to a line).
    """
    shape, linear = conic[:2, :2], conic[:2, 2]
    determinant = float(np.linalg.det(shape))
    if not determinant > 0.0:
        raise EllipseError("the conic is not an ellipse: its quadratic part is not definite")
    centre = np.asarray(-np.linalg.solve(shape, linear))
    constant = float(conic[2, 2] + linear @ centre)
    values, directions = np.linalg.eigh(-shape / constant if constant != 0.0 else shape)
    if not (constant != 0.0 and np.all(values > 0.0)):
        raise EllipseError("the conic is empty or a single point: no real ellipse")
    lengths = np.asarray(1.0 / np.sqrt(values))
    if lengths[1] < SMALLEST_AXIS_RATIO * lengths[0]:
        raise EllipseError("the ellipse has collapsed to a line segment")
    return Ellipse(centre, lengths[0] * directions[:, 0], lengths[1] * directions[:, 1])


def fit_line(points: Array) -> Array:
    """Line (3,) l with l · (x, y, 1) = 0, unit normal, through points (N, 2) by their principal axis.

    Raises:
        EllipseError: the points coincide or are not finite.
    """
    points = np.asarray(points, dtype=np.float64)
    if not np.all(np.isfinite(points)):
        raise EllipseError("the points through which to lay a line are not all finite")
    mean = points.mean(axis=0)
    _, singular, directions = np.linalg.svd(points - mean, full_matrices=False)
    if singular[0] == 0.0:
        raise EllipseError("all points coincide: no line passes through them")
    normal = directions[1]
    return np.append(normal, -normal @ mean)
