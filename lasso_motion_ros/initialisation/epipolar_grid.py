"""A plane's image on a grid whose rows both planes share: epipolar planes, half a millimetre apart at the patient."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.core.errors import GeometryError
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.triangulation import triangulate

Array = npt.NDArray[np.float64]

SMALLEST_VIEW_ANGLE_DEG = 15.0
LATER_S = 0.01  # from which on plane B is exposed later than plane A


@dataclass(frozen=True)
class _Tuning:
    """By how much one thing's heights in the two planes may differ."""

    agreeing_m: float = 1.5e-3  # of calibrated planes
    fastest_m_s: float = 0.03  # of breathing: where plane B is exposed later the ring may have moved up or down by then
    largest_lift_m: float = 5e-3


TUNING = _Tuning()


def largest_lift_m(between_s: float) -> float:
    """By how much the planes' heights may differ where plane B is exposed so much later than plane A."""
    return max(TUNING.agreeing_m, min(TUNING.largest_lift_m, TUNING.fastest_m_s * abs(between_s)))


@dataclass(frozen=True, eq=False)
class EpipolarGrid:
    """Where both planes look, and the axes in which their images are laid out.

    Attributes:
        centre: (3,) where the planes' central rays meet, world metres.
        upward: (3,) unit normal of the epipolar plane through it: the grids' rows are heights along it.
        sideways: per plane, (3,) unit vector along the grid's columns, across the plane's central ray.
        view: per plane, (3,) unit vector of its central ray.
        outward: (3,) unit vector across the baseline towards the centre.
        lever: distance of the centre from the baseline, metres.
        sources: per plane, (3,).
    """

    centre: Array
    upward: Array
    sideways: dict[Plane, Array]
    view: dict[Plane, Array]
    outward: Array
    lever: float
    sources: dict[Plane, Array]

    @classmethod
    def of(cls, projections: dict[Plane, Projection]) -> EpipolarGrid:
        """The grid of two planes.

        Raises:
            GeometryError: the planes look from nearly the same direction.
        """
        a, b = (projections[plane] for plane in PLANES)
        middles = tuple(np.array([(p.width - 1) / 2.0, (p.height - 1) / 2.0]) for p in (a, b))
        centre = triangulate((a, b), middles)
        sources = {plane: projections[plane].source for plane in PLANES}
        view = {plane: (centre - sources[plane]) / np.linalg.norm(centre - sources[plane]) for plane in PLANES}
        sine = float(np.linalg.norm(np.cross(view["a"], view["b"])))
        if sine < np.sin(np.radians(SMALLEST_VIEW_ANGLE_DEG)):
            raise GeometryError(
                f"the planes look from {np.degrees(np.arcsin(sine)):.0f}° apart; a ring is only found where it is"
                f" {SMALLEST_VIEW_ANGLE_DEG:.0f}° or more"
            )
        baseline = sources["b"] - sources["a"]
        baseline = baseline / np.linalg.norm(baseline)
        upward = np.cross(baseline, centre - sources["a"])
        upward /= np.linalg.norm(upward)
        outward = np.cross(upward, baseline)
        lever = float((centre - sources["a"]) @ outward)
        sideways = {plane: np.cross(upward, view[plane]) for plane in PLANES}
        return cls(centre, upward, sideways, view, outward, lever, sources)

    def points(self, plane: Plane, columns: Array, rows: Array) -> Array:
        """(R, C, 3) world points, across a plane's view through the centre, of grid columns (C,) and rows (R,), metres.

        A row is an epipolar plane, by its height at the centre.
        """
        aside, up = self.columns(plane, columns)
        return np.asarray(aside[None] + rows[:, None, None] * up[None])

    def columns(self, plane: Plane, columns: Array) -> tuple[Array, Array]:
        """(C, 3) world points of columns (C,) in the row of height 0, and (C, 3) how far a metre of height goes."""
        aside = self.centre + columns[:, None] * self.sideways[plane]
        out = (aside - self.sources[plane]) @ self.outward / self.lever  # nearer to the baseline planes are closer
        return aside, np.asarray(out[:, None] * self.upward)

    def point(self, plane: Plane, columns: Array, rows: Array) -> Array:
        """(N, 3) the same of a column and a row (N,) each."""
        aside = self.centre + columns[:, None] * self.sideways[plane]
        out = (aside - self.sources[plane]) @ self.outward / self.lever
        return np.asarray(aside + (rows * out)[:, None] * self.upward)

    def lay(self, plane: Plane, points: Array) -> tuple[Array, Array]:
        """Columns and rows (...) of world points (..., 3), metres in a plane's grid."""
        rays = points - self.sources[plane]
        columns = self.distance(plane) * (rays @ self.sideways[plane]) / (rays @ self.view[plane])
        rows = self.lever * (rays @ self.upward) / (rays @ self.outward)
        return np.asarray(columns), np.asarray(rows)

    def lay_along(self, plane: Plane, axes: Array, shares: Array) -> tuple[Array, Array]:
        """Columns and rows (N, P) of points that are sums of a few vectors each, metres in a plane's grid.

        As `lay`, without the points: what the grid asks of the vectors adds up as they do.

        Args:
            plane: whose grid.
            axes: (N, K, 3) vectors, the first of them a place, world metres.
            shares: (K, P) how much of each is in the points; the first's is 1.
        """
        aside, ahead, up, out = np.moveaxis(self.parts(plane, axes), 2, 0) @ shares
        return np.asarray(self.distance(plane) * aside / ahead), np.asarray(self.lever * up / out)

    def parts(self, plane: Plane, axes: Array) -> Array:
        """(N, K, 4) of vectors as in `lay_along`, what lies aside of a plane's view, along it, upward and outward."""
        asked = self.asked(plane)
        parts = axes @ asked[:, :3].T
        parts[:, 0] += asked[:, 3]
        return np.asarray(parts)

    def asked(self, plane: Plane) -> Array:
        """(4, 4) what lies aside of a plane's view, along it, upward and outward, of homogeneous world points."""
        axes = np.stack([self.sideways[plane], self.view[plane], self.upward, self.outward])
        return np.column_stack([axes, -axes @ self.sources[plane]])

    def distance(self, plane: Plane) -> float:
        """Of the centre from a plane's source, metres."""
        return float((self.centre - self.sources[plane]) @ self.view[plane])

    def places(self, columns: dict[Plane, Array], rows: Array) -> Array:
        """(N, 3) the world points that both planes show in columns (N,) of theirs and common rows (N,), metres."""
        if has_kernels():
            from lasso_motion_ros.initialisation import spot_kernels

            a, b = (np.ascontiguousarray(columns[plane], np.float64) for plane in PLANES)
            sources = np.stack([self.sources[plane] for plane in PLANES])
            axes = self.centre, np.stack([self.sideways[plane] for plane in PLANES]), self.upward, self.outward
            found = np.empty((len(rows), 3))
            spot_kernels.places(a, b, np.ascontiguousarray(rows), sources, *axes, self.lever, found)
            return found
        ends = {}
        for plane in PLANES:
            aside = self.centre + columns[plane][:, None] * self.sideways[plane]
            out = (aside - self.sources[plane]) @ self.outward / self.lever
            ends[plane] = aside + (rows * out)[:, None] * self.upward - self.sources[plane]
        # The rays lie in one epipolar plane: where they meet in it.
        across = self.sources["b"] - self.sources["a"]
        normal = np.cross(ends["a"], ends["b"])
        along = np.einsum("nk,nk->n", np.cross(across, ends["b"]), normal) / np.einsum("nk,nk->n", normal, normal)
        return np.asarray(self.sources["a"] + along[:, None] * ends["a"])
