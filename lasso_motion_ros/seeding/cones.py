"""Cones that images span in space: where two of them meet, and the ellipse in which a plane cuts one.

Each image ellipse C and its source span the cone Q = Pᵀ C P. A space conic on both cones lies in a plane
of the degenerate quadric Q_A + η Q_B of rank two (L. Quan, "Conic reconstruction and correspondence from
two views", IEEE PAMI 18(2), 1996).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import EllipseError
from lasso_motion_ros.geometry.ellipse import ellipse_from_conic

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How exactly the planes are found.

    Attributes:
        most_refinements: of η: thirty halvings, and some steps between them.
    """

    most_refinements: int = 200


TUNING = _Tuning()


@dataclass(frozen=True, eq=False)
class Ellipse3D:
    """An ellipse in space, world metres.

    Attributes:
        centre: (3,).
        semi_major: (3,) vector to an end of the major axis.
        semi_minor: (3,) vector to an end of the minor axis.
    """

    centre: Array
    semi_major: Array
    semi_minor: Array

    @property
    def circularity(self) -> float:
        """Minor by major axis, in (0, 1]: 1 for a circle."""
        return float(np.linalg.norm(self.semi_minor) / np.linalg.norm(self.semi_major))

    @property
    def normal(self) -> Array:
        """(3,) unit normal of the ellipse's plane; its sign has no meaning."""
        normal = np.cross(self.semi_major, self.semi_minor)
        return np.asarray(normal / np.linalg.norm(normal))

    def points(self, count: int) -> Array:
        """(count, 3) points, evenly spaced in the eccentric angle."""
        angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)[:, None]
        return np.asarray(self.centre + np.cos(angles) * self.semi_major + np.sin(angles) * self.semi_minor)


def quan_planes(cone_a: Array, cone_b: Array) -> list[Array]:
    """The planes (4,) on which two cones (4, 4) share a conic: at most two (Quan 1996).

    det(Q_A + ηQ_B) = η (c₁ + c₂η + c₃η²) has a double root, which noise splits or turns complex; its
    midpoint η = −c₂ / (2 c₃) is robust. Only a quadric whose two leading eigenvalues differ in sign splits
    into real planes; then λ₊ u₊u₊ᵀ − λ₋ u₋u₋ᵀ = 0 are the planes √λ₊ u₊ ± √λ₋ u₋.
    """
    cone_a = cone_a / np.linalg.norm(cone_a)
    cone_b = cone_b / np.linalg.norm(cone_b)
    # The cubic's coefficients from three values of the determinant: η = 1, −1, 2.
    value = {eta: float(np.linalg.det(cone_a + eta * cone_b)) / eta for eta in (1.0, -1.0, 2.0)}
    c2 = (value[1.0] - value[-1.0]) / 2.0
    c1_plus_c3 = (value[1.0] + value[-1.0]) / 2.0
    c3 = (value[2.0] - c1_plus_c3 - 2.0 * c2) / 3.0
    if c3 == 0.0:
        return []
    eta = _most_nearly_rank_two(cone_a, cone_b, -c2 / (2.0 * c3))
    values, vectors = np.linalg.eigh(cone_a + eta * cone_b)
    if not values[0] < 0.0 < values[3]:
        return []
    low, high = np.sqrt(-values[0]) * vectors[:, 0], np.sqrt(values[3]) * vectors[:, 3]
    return [high + low, high - low]


def _most_nearly_rank_two(cone_a: Array, cone_b: Array, eta: float) -> float:
    """Refine η so that the two middle eigenvalues of Q_A + ηQ_B are smallest beside the outer two."""

    def rank_excess(candidate: float) -> float:
        values = np.linalg.eigvalsh(cone_a + candidate * cone_b)
        if not values[0] < 0.0 < values[3]:
            return np.inf
        return float(max(abs(values[1]), abs(values[2])) / min(-values[0], values[3]))

    step, best = 0.05 * abs(eta), rank_excess(eta)
    for _ in range(TUNING.most_refinements):
        if step <= 1e-9 * abs(eta):
            break
        trials = [(rank_excess(eta + s), eta + s) for s in (-step, step)]
        if min(trials)[0] < best:
            best, eta = min(trials)
        else:
            step /= 2.0
    return eta


def cone(conic: Array, matrix: Array) -> Array:
    """The cone (4, 4) that an image conic (3, 3) and the source of a projection (3, 4) span, of norm one."""
    spanned = matrix.T @ conic @ matrix
    return np.asarray(spanned / np.linalg.norm(spanned))


def cut(quadric: Array, space_plane: Array, frame: Array) -> list[Ellipse3D]:
    """The ellipse that a plane (4,) cuts from a cone (4, 4), moved to the world; none where the cut is no ellipse."""
    size = np.linalg.norm(space_plane[:3])
    if size == 0.0:
        return []
    normal, offset = space_plane[:3] / size, space_plane[3] / size
    _, _, directions = np.linalg.svd(normal[None])
    # Columns take plane coordinates (u, v, 1) to space, so the third coordinate along n is zero by design.
    basis = np.zeros((4, 3))
    basis[:3, 0], basis[:3, 1] = directions[1], directions[2]
    basis[:3, 2], basis[3, 2] = -offset * normal, 1.0
    try:
        flat = ellipse_from_conic(basis.T @ quadric @ basis)
    except EllipseError:
        return []
    in_plane = frame[:3, :3] @ basis[:3, :2]
    centre = (frame @ basis @ np.append(flat.centre, 1.0))[:3]
    return [Ellipse3D(centre, in_plane @ flat.semi_major, in_plane @ flat.semi_minor)]
