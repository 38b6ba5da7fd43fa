"""The 3-D ellipse from two outlines: cone against cone (Quan), or plane against cone when seen edge-on.

The conic that both image ellipses show lies in one of two planes (`cones`); a lasso being nearly a circle, the more
circular conic is the one (Brost et al., MICCAI 2009). Edge-on in both planes, where both cones have collapsed, a circle
between the four rays that touch the loop is the fourth candidate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import EllipseError, GeometryError, ReconstructionError
from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.geometry.directions import cross
from lasso_motion_ros.geometry.ellipse import fit_ellipse, fit_line
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.triangulation import triangulate
from lasso_motion_ros.seeding.cones import Ellipse3D, cone, cut, quan_planes

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How candidates are made and judged.

    Attributes:
        smallest_view_angle_deg: between the two central rays; below it depth is undetermined.
        outline_noise_px: a click or a point of a path is about this far off the wire.
        circularity_spread: a lasso's axis ratio is about this far from that of a circle.
        largest_reprojection_share: of the outline's radius; a candidate that reprojects worse does not explain it.
        open_share: of the ellipse, which an open loop's outline leaves uncovered.
        edge_on_in_both_deg: where the planes through line and source differ by less, both may be the loop's own.
    """

    smallest_view_angle_deg: float = 5.0
    outline_noise_px: float = 1.5
    circularity_spread: float = 0.15
    largest_reprojection_share: float = 0.25
    open_share: float = 0.15
    edge_on_in_both_deg: float = 15.0


TUNING = _Tuning()


@dataclass(frozen=True, eq=False)
class Candidate:
    """One 3-D ellipse that may be the loop.

    Attributes:
        ellipse: the ellipse, world metres.
        edge_on: the planes in which the loop was taken as a line; none for cone against cone.
        reprojection_px: mean distance between the outlines and the projected ellipse, the larger of both planes.
    """

    ellipse: Ellipse3D
    edge_on: tuple[Plane, ...]
    reprojection_px: float

    @property
    def misfit(self) -> float:
        """Squared misfit of outline and circularity together, each in units of its spread."""
        return (self.reprojection_px / TUNING.outline_noise_px) ** 2 + (
            (1.0 - self.ellipse.circularity) / TUNING.circularity_spread
        ) ** 2


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """The loop's ellipse and what else it might have been.

    Attributes:
        chosen: the candidate with the smallest misfit.
        candidates: all candidates, the chosen one first, by rising misfit.
    """

    chosen: Candidate
    candidates: tuple[Candidate, ...]


def reconstruct_ellipse(projections: dict[Plane, Projection], outlines: dict[Plane, Array]) -> Reconstruction:
    """The 3-D ellipse whose projections are the two outlines.

    All candidates are built, two from cone against cone, one per plane taken as edge-on, and one for edge-on in both;
    they are judged by their reprojection and circularity, so that no threshold on conditioning decides.

    Args:
        projections: world metres to pixels, per plane.
        outlines: (N, 2) pixels along the loop, per plane, N ≥ 6.

    Raises:
        ReconstructionError: the two views are (nearly) the same, or no ellipse explains both outlines.
    """
    frame = _well_scaled_frame(projections, outlines)
    scaled = {p: projections[p].matrix @ frame for p in PLANES}
    conics: dict[Plane, Array] = {}
    refusals = []
    for plane in PLANES:
        try:
            conics[plane] = cone(fit_ellipse(outlines[plane]).conic, scaled[plane])
        except EllipseError as error:
            refusals.append(f"plane {plane.upper()}: {error}")

    def reprojection_px(ellipse: Ellipse3D, beaten_by: float = np.inf) -> float:
        """The larger of both planes'; infinite where the first alone is no less than what it is beaten by."""
        largest = 0.0
        for plane in PLANES:
            largest = max(largest, _reprojection(ellipse, projections[plane], outlines[plane]))
            if largest >= beaten_by:
                return np.inf
        return largest

    def candidate(ellipse: Ellipse3D, edge_on: tuple[Plane, ...]) -> Candidate:
        return Candidate(ellipse, edge_on, reprojection_px(ellipse))

    cone_cone: list[Candidate] = []
    if len(conics) == 2:
        for space_plane in quan_planes(conics["a"], conics["b"]):
            # Under noise one plane cuts the two cones a little differently: the cut that reprojects better is kept.
            best, best_px = list[Ellipse3D](), np.inf
            for ellipse in (one for plane in PLANES for one in cut(conics[plane], space_plane, frame)):
                if (px := reprojection_px(ellipse, best_px)) < best_px:
                    best, best_px = [ellipse], px
            cone_cone += [Candidate(ellipse, (), best_px) for ellipse in best]
    line_planes: dict[Plane, Array] = {}
    for plane in PLANES:
        try:
            # Through the source and the line: Pᵀ l (H&Z eq. 8.2).
            line_planes[plane] = scaled[plane].T @ fit_line(outlines[plane])
        except EllipseError as error:
            refusals.append(f"plane {plane.upper()}: {error}")
    as_line: list[Candidate] = []
    pairs: tuple[tuple[Plane, Plane], ...] = (("a", "b"), ("b", "a"))
    for edge_on, other in pairs:
        if other in conics and edge_on in line_planes:
            as_line += [candidate(e, (edge_on,)) for e in cut(conics[other], line_planes[edge_on], frame)]
    if len(line_planes) == 2:
        circles = _circle_between_rays(projections, outlines, line_planes, frame[:3, 3])
        as_line += [candidate(circle, PLANES) for circle in circles]
    candidates = sorted(cone_cone + as_line, key=lambda c: c.misfit)
    if not candidates:
        raise ReconstructionError("no 3-D ellipse explains the two outlines: " + ("; ".join(refusals) or "cones miss"))
    chosen = candidates[0]
    # The outlines' own radius: a wrong candidate may be very long, and would then excuse itself.
    radius_px = min(np.linalg.norm(outlines[p] - outlines[p].mean(axis=0), axis=1).max() for p in PLANES)
    limit_px = TUNING.largest_reprojection_share * radius_px
    if not chosen.reprojection_px < limit_px:
        raise ReconstructionError(
            f"no 3-D ellipse explains the two outlines: the best lies {chosen.reprojection_px:.1f} px from them, "
            f"expected under {limit_px:.1f} px; do both show the same loop at once?"
        )
    return Reconstruction(chosen, tuple(candidates))


def _well_scaled_frame(projections: dict[Plane, Projection], outlines: dict[Plane, Array]) -> Array:
    """(4, 4) from coordinates in which the loop is near the origin and of size one, to world metres."""
    centre = _centre(projections, outlines)
    sizes = []
    for plane in PLANES:
        spread_px = np.sqrt(((outlines[plane] - outlines[plane].mean(axis=0)) ** 2).sum(axis=1).mean())
        sizes.append(spread_px * projections[plane].millimetres_per_pixel(centre) / 1e3)
    frame = np.eye(4)
    frame[:3] *= max(sizes)
    frame[:3, 3] = centre
    return frame


def _centre(projections: dict[Plane, Projection], outlines: dict[Plane, Array]) -> Array:
    """(3,) about the loop's, world metres, from the outlines' middles."""
    a, b = projections["a"], projections["b"]
    middles = {p: outlines[p].mean(axis=0) for p in PLANES}
    cosine = abs(float(a.rays(middles["a"]) @ b.rays(middles["b"])))
    angle = float(np.degrees(np.arccos(min(1.0, cosine))))
    if angle < TUNING.smallest_view_angle_deg:
        raise ReconstructionError(
            f"the two planes look from {angle:.1f}° apart; depth needs at least {TUNING.smallest_view_angle_deg:.0f}°"
        )
    try:
        centre = triangulate((a, b), (middles["a"], middles["b"]))
    except GeometryError as error:
        raise ReconstructionError(str(error)) from error
    for plane in PLANES:
        if projections[plane].depth(centre) <= 0.0:
            raise ReconstructionError(f"the clicked loop would lie behind the source of plane {plane.upper()}")
    return centre


def _circle_between_rays(
    projections: dict[Plane, Projection], outlines: dict[Plane, Array], line_planes: dict[Plane, Array], centre: Array
) -> list[Ellipse3D]:
    """The circle that touches the outermost rays to the loop in both planes, seen edge-on by both; none if it is not.

    Both planes through line and source are then the loop's own; in it, a circle with centre c and radius r that touches
    a ray with unit normal m through the source s fulfils m · (c − s) = r: four equations, linear in three unknowns.

    Args:
        projections: world metres to pixels, per plane.
        outlines: (N, 2) pixels along the loop, per plane.
        line_planes: per plane, (4,) through the outline's line and the source, in any scale.
        centre: (3,) about the loop's, world metres.
    """
    normals = {p: line_planes[p][:3] / np.linalg.norm(line_planes[p][:3]) for p in PLANES}
    cosine = float(normals["a"] @ normals["b"])
    if abs(cosine) < np.cos(np.radians(TUNING.edge_on_in_both_deg)):
        return []
    normal = normals["a"] + np.sign(cosine) * normals["b"]
    basis = np.linalg.svd(normal[None])[2][1:]
    rows, right = [], []
    for plane in PLANES:
        outline, source = outlines[plane], basis @ (projections[plane].source - centre)
        _, _, directions = np.linalg.svd(outline - outline.mean(axis=0), full_matrices=False)
        along = (outline - outline.mean(axis=0)) @ directions[0]
        ends = projections[plane].rays(outline[[int(along.argmin()), int(along.argmax())]]) @ basis.T
        ends /= np.linalg.norm(ends, axis=1, keepdims=True)
        for ray, other in (ends, ends[::-1]):
            towards = np.array([-ray[1], ray[0]])
            towards *= np.sign(towards @ other)  # the loop lies on the other ray's side
            rows.append([*towards, -1.0])
            right.append(float(towards @ source))
    (x, y, radius), *_ = np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)
    if not radius > 0.0:
        return []
    return [Ellipse3D(centre + np.array([x, y]) @ basis, radius * basis[0], radius * basis[1])]


def _reprojection(ellipse: Ellipse3D, projection: Projection, outline: Array) -> float:
    """Mean distance between outline and projected ellipse, both ways: one that reaches too far is no better."""
    projected = projection.project(ellipse.points(120))
    to_ellipse = distance_to_curve(outline, np.vstack([projected, projected[:1]]))
    to_outline = np.sort(distance_to_curve(projected, outline))[: round((1.0 - TUNING.open_share) * len(projected))]
    return 0.5 * float(to_ellipse.mean() + to_outline.mean())


def epipolar_shift(
    projections: dict[Plane, Projection], outlines: dict[Plane, Array], share_of_a: float
) -> dict[Plane, Array]:
    """Pixel shifts that bring the outlines' epipolar tangents of both planes together.

    A plane through both sources that touches the loop shows as a line that touches both outlines. Where the
    two tangents' mean differs, the planes are off to each other: their calibration, or the loop moved
    between the exposures.

    Args:
        projections: world metres to pixels, per plane.
        outlines: (N, 2) pixels along the loop, per plane.
        share_of_a: share of the correction that plane A's images take, in [0, 1].

    Returns:
        Per plane, (2,) pixels by which its images lie off: project, then add.

    Raises:
        ReconstructionError: the two views are the same.
    """
    a, b = projections["a"], projections["b"]
    centre = _centre(projections, outlines)
    baseline = b.source - a.source
    baseline = baseline / np.linalg.norm(baseline)
    # Height of a point above the baseline–centre plane, which any epipolar plane's angle measures.
    towards = centre - a.source
    upward = cross(baseline, towards)
    upward /= np.linalg.norm(upward)
    outward = cross(upward, baseline)
    middles = {}
    for plane, projection in projections.items():
        rays = projection.rays(outlines[plane])
        angles = np.arctan2(rays @ upward, rays @ outward)
        middles[plane] = 0.5 * float(angles.min() + angles.max())
    lever = float(np.linalg.norm(cross(baseline, towards)))
    height = (middles["b"] - middles["a"]) * lever  # B sees the loop this much higher
    shifts: dict[Plane, Array] = {}
    corrections: tuple[tuple[Plane, float, float], ...] = (("a", share_of_a, -1.0), ("b", 1.0 - share_of_a, 1.0))
    for plane, share, sign in corrections:
        shifts[plane] = np.asarray(sign * share * height * (projections[plane].jacobian(centre) @ upward))
    return shifts
