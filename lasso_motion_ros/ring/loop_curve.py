"""The loop's curve: an ellipse and a smooth offset from it, fitted to outlines in both planes, and snapped to lines."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.curves import SMALLEST_SPACING, quarter_turn, slope
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.ring.line_map import LineMap
from lasso_motion_ros.seeding.cones import Ellipse3D
from lasso_motion_ros.seeding.loop_outline import on_ellipse

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How smooth the curve is, and how far from it a line is looked for."""

    knots_per_turn: int = 14
    outline_sigma_mm: float = 0.15
    bulge_sigma_mm: float = 1.0  # of the curve about its ellipse
    bend_sigma_mm: float = 0.35  # of the spline coefficients' second differences
    snap_reach_mm: float = 1.0
    snap_step_mm: float = 0.1
    wrong_match: float = 6.0  # an outline's distance, in its standard deviations, from which on it counts less
    strong_quantile: float = (
        0.95  # of the line filter's responses beside the curve: what is stronger is no better a line
    )
    off_curve: float = 0.15  # of a strong line's gain, that a line at the end of the reach has less
    bend: float = 0.25  # of it, for each squared step aside from point to point


TUNING = _Tuning()
_OFFSETS_MM = np.arange(-TUNING.snap_reach_mm, TUNING.snap_reach_mm + 1e-9, TUNING.snap_step_mm)


class LoopCurve:
    """The ellipse plus a spline offset, a function of the eccentric angle.

    Args:
        ellipse: the loop's, roughly, world metres.
        knots: of the cubic spline, eccentric angles.
        coefficients: (K, 3) of the spline, metres.
        points: (N, 3) of the curve at the angles to which it was fitted.
    """

    def __init__(self, ellipse: Ellipse3D, knots: Array, coefficients: Array, points: Array) -> None:
        self._ellipse, self._knots, self._coefficients, self.points = ellipse, knots, coefficients, points

    def __call__(self, angles: Array) -> Array:
        """(N, 3) world metres at eccentric angles (N,)."""
        basis = _splines(angles.tobytes(), self._knots.tobytes())
        return np.asarray(on_ellipse(self._ellipse, angles) + basis @ self._coefficients)


@lru_cache(maxsize=8)
def _splines(angles: bytes, knots: bytes) -> Array:
    """(N, K) the cubic splines at angles (N,); many closed curves are asked for at the same ones."""
    basis = BSpline.design_matrix(np.frombuffer(angles), np.frombuffer(knots), 3).toarray()
    basis.setflags(write=False)
    return np.asarray(basis)


class CurveFit:
    """Curves about one ellipse, fitted to points at the same eccentric angles again and again.

    Args:
        ellipse: the loop's, roughly, world metres.
        angles: (N,) rising.
    """

    def __init__(self, ellipse: Ellipse3D, angles: Array) -> None:
        count = max(6, round(TUNING.knots_per_turn * float(np.ptp(angles)) / (2.0 * np.pi)))
        inner = np.linspace(angles[0], angles[-1], count)
        spacing = inner[1] - inner[0]
        before, after = inner[0] - spacing * np.arange(3, 0, -1), inner[-1] + spacing * np.arange(1, 4)
        self._knots = np.concatenate([before, inner, after])
        self._basis = BSpline.design_matrix(np.clip(angles, inner[0], inner[-1]), self._knots, 3).toarray()
        size = self._basis.shape[1]
        bends = np.diff(np.eye(size), 2, axis=0)
        prior = np.eye(size) / TUNING.bulge_sigma_mm**2 + bends.T @ bends / TUNING.bend_sigma_mm**2
        self._prior = np.kron(prior, np.eye(3)) * 1e6
        self._ellipse, self._points = ellipse, on_ellipse(ellipse, angles)

    def __call__(self, projections: dict[Plane, Projection], found: dict[Plane, Array]) -> LoopCurve:
        """Regularised least squares of the distances, across the curve, to the outline in both planes.

        Args:
            projections: world metres to pixels, per plane.
            found: per plane, (N, 2) pixels of the outline at the angles; NaN where it does not reach.
        """
        size = self._basis.shape[1]
        normal, right = self._prior.copy(), np.zeros(3 * size)
        for plane in PLANES:
            projection = projections[plane]
            pixels = projection.project(self._points)
            normals = _unit_normals(pixels)
            offset = np.einsum("nj,nj->n", normals, found[plane] - pixels)
            valid = np.isfinite(offset)
            offset = np.where(valid, offset, 0.0)
            scale = projection.millimetres_per_pixel(self._ellipse.centre) / TUNING.outline_sigma_mm
            px_per_m = np.einsum("nj,njk->nk", normals, projection.jacobian(self._points))
            # A point far off its outline is a wrong match (a neighbouring wire, the other side of the loop).
            weight = np.where(valid, scale / np.sqrt(1.0 + (offset * scale / TUNING.wrong_match) ** 2), 0.0)
            rows = (self._basis[:, :, None] * px_per_m[:, None, :] * weight[:, None, None]).reshape(len(offset), -1)
            normal += rows.T @ rows
            right += rows.T @ (offset * weight)
        coefficients = np.linalg.solve(normal, right).reshape(size, 3)
        return LoopCurve(self._ellipse, self._knots, coefficients, self._points + self._basis @ coefficients)


def _unit_normals(pixels: Array) -> Array:
    """(N, 2) unit normals of an open curve (N, 2) of pixels."""
    normals = quarter_turn(slope(pixels, axis=0))
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), SMALLEST_SPACING))


def snap(curve: Array, lines: dict[Plane, LineMap], projections: dict[Plane, Projection]) -> dict[Plane, Array]:
    """Per plane, (N, 2) pixels of the line beside a projected curve (N, 3): the smoothest strong path in the strip."""
    on_curve, across, gains = {}, {}, []
    for plane, projection in projections.items():
        pixels = projection.project(curve)
        unit = projection.millimetres_per_pixel(curve.mean(axis=0))
        offsets = _OFFSETS_MM / unit
        normals = _unit_normals(pixels)
        response, corner = lines[plane].about(pixels)
        at = (pixels[:, None] + offsets[None, :, None] * normals[:, None] - corner).astype(np.float32)
        strip = cv2.remap(response, at, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        strip = strip / max(_quantile(strip, TUNING.strong_quantile), 1e-6)
        off = TUNING.off_curve * (offsets * unit / TUNING.snap_reach_mm) ** 2
        gains.append(np.minimum(strip, 1.0).astype(np.float64) - off)
        on_curve[plane], across[plane] = pixels, offsets[:, None, None] * normals
    best = _ridge_paths(np.stack(gains))
    points = np.arange(len(curve))
    return {p: on_curve[p] + across[p][columns, points] for p, columns in zip(projections, best, strict=True)}


def _quantile(values: npt.NDArray[np.float32], share: float) -> float:
    """What `np.quantile` gives, in a fifth of its time."""
    place, rest = divmod(share * (values.size - 1), 1.0)
    low, high = np.partition(values, (int(place), int(place) + 1), axis=None)[int(place) : int(place) + 2].tolist()
    return float(low + rest * (high - low))


def _ridge_paths(gains: Array) -> npt.NDArray[np.int64]:
    """(P, N) column per row that maximises the gain (P, N, C) less a penalty per squared column step, strip by strip.

    Dynamic programming from both ends at once, which meets in the middle row.
    """
    if has_kernels():
        from lasso_motion_ros.ring.kernels.seed import ridge_paths

        best: npt.NDArray[np.int64] = ridge_paths(gains, TUNING.bend)
        return best
    strips, rows, columns = gains.shape
    middle = rows // 2
    upwards = gains[:, middle:][:, ::-1]
    if rows % 2 == 0:  # a row that says nothing makes both halves equally long
        upwards = np.concatenate([np.zeros((strips, 1, columns)), upwards], axis=1)
    totals, choices = _best_ways(np.concatenate([gains[:, : middle + 1], upwards]))
    meeting = (totals[:strips] + totals[strips:] - gains[:, middle]).argmax(axis=1).tolist()
    paths = []
    for strip, column in enumerate(meeting):
        halves = []
        for half in (strip, strips + strip):
            path = [column]
            for choice in reversed(choices[:, half].tolist()):
                path.append(path[-1] + choice[path[-1]])
            halves.append(path)
        paths.append(halves[0][:0:-1] + halves[1][: rows - middle])
    return np.array(paths, dtype=np.int64)


def _best_ways(gains: Array) -> tuple[Array, npt.NDArray[np.int64]]:
    """(P, C) the gain of the best way to each column of the last row, and (N - 1, P, C) the step into each column."""
    strips, rows, columns = gains.shape
    steps = np.arange(-3, 4)
    penalty = TUNING.bend * (steps**2)[:, None, None]
    padded = np.full((strips, columns + 6), -np.inf)
    total = padded[:, 3:-3]
    total[:] = gains[:, 0]
    # By the step with which a column is reached, (steps, P, C): of the same memory.
    before = np.lib.stride_tricks.sliding_window_view(padded, columns, axis=1).swapaxes(0, 1)
    options = np.empty((rows, len(steps), strips, columns))
    for row in range(1, rows):
        np.subtract(before, penalty, out=options[row])
        np.add(np.maximum.reduce(options[row]), gains[:, row], out=total)
    return total, steps[options[1:].argmax(axis=1)]
