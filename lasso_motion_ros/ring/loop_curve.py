"""The loop's curve: an ellipse and a smooth offset from it, fitted to outlines in both planes, and snapped to lines."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline

from lasso_motion_ros.geometry.curves import SMALLEST_SPACING, quarter_turn, slope
from lasso_motion_ros.geometry.frames import PLANES, Frame, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.seeding.cones import Ellipse3D
from lasso_motion_ros.seeding.line_filter import sato
from lasso_motion_ros.seeding.loop_outline import on_ellipse
from lasso_motion_ros.seeding.outlines import line_sigma_px

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
    margin_px: int = 16  # of the part of the image in which lines are looked for
    strong_quantile: float = (
        0.95  # of the line filter's responses beside the curve: what is stronger is no better a line
    )
    off_curve: float = 0.15  # of a strong line's gain, that a line at the end of the reach has less
    bend: float = 0.25  # of it, for each squared step aside from point to point


TUNING = _Tuning()


class LoopCurve:
    """The ellipse plus a spline offset, a function of the eccentric angle."""

    def __init__(self, ellipse: Ellipse3D, knots: Array, coefficients: Array) -> None:
        self._ellipse, self._knots, self._coefficients = ellipse, knots, coefficients

    def __call__(self, angles: Array) -> Array:
        """(N, 3) world metres at eccentric angles (N,)."""
        basis = BSpline.design_matrix(angles, self._knots, 3).toarray()
        return np.asarray(on_ellipse(self._ellipse, angles) + basis @ self._coefficients)


def fit_curve(
    ellipse: Ellipse3D, angles: Array, projections: dict[Plane, Projection], found: dict[Plane, Array]
) -> LoopCurve:
    """Regularised least squares of the distances, across the curve, to the outline in both planes."""
    count = max(6, round(TUNING.knots_per_turn * float(np.ptp(angles)) / (2.0 * np.pi)))
    inner = np.linspace(angles[0], angles[-1], count)
    spacing = inner[1] - inner[0]
    knots = np.concatenate([inner[0] - spacing * np.arange(3, 0, -1), inner, inner[-1] + spacing * np.arange(1, 4)])
    basis = BSpline.design_matrix(np.clip(angles, inner[0], inner[-1]), knots, 3).toarray()
    size = basis.shape[1]
    bends = np.diff(np.eye(size), 2, axis=0)
    prior = np.eye(size) / TUNING.bulge_sigma_mm**2 + bends.T @ bends / TUNING.bend_sigma_mm**2
    normal = np.kron(prior, np.eye(3)) * 1e6
    right = np.zeros(3 * size)
    points = on_ellipse(ellipse, angles)
    for plane in PLANES:
        projection = projections[plane]
        pixels = projection.project(points)
        normals = _unit_normals(pixels)
        offset = np.einsum("nj,nj->n", normals, found[plane] - pixels)
        valid = np.isfinite(offset)
        scale = projection.millimetres_per_pixel(ellipse.centre) / TUNING.outline_sigma_mm
        px_per_m = np.einsum("nj,njk->nk", normals, projection.jacobian(points))
        # A point far off its outline is a wrong match (a neighbouring wire, the other side of the loop).
        weight = np.where(valid, scale / np.sqrt(1.0 + (np.nan_to_num(offset) * scale / TUNING.wrong_match) ** 2), 0.0)
        rows = (basis[:, :, None] * px_per_m[:, None, :] * weight[:, None, None]).reshape(len(angles), -1)
        normal += rows.T @ rows
        right += rows.T @ (np.nan_to_num(offset) * weight)
    return LoopCurve(ellipse, knots, np.linalg.solve(normal, right).reshape(size, 3))


def _unit_normals(pixels: Array) -> Array:
    """(N, 2) unit normals of an open curve (N, 2) of pixels."""
    normals = quarter_turn(slope(pixels, axis=0))
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), SMALLEST_SPACING))


def snap(curve: Array, frame: Frame, projection: Projection, bright: bool, sigma_mm: float) -> Array:
    """(N, 2) pixels of the line beside a projected curve (N, 3): the smoothest strong path through the strip."""
    pixels = projection.project(curve)
    normals = _unit_normals(pixels)
    unit = projection.millimetres_per_pixel(curve.mean(axis=0))
    offsets = np.arange(-TUNING.snap_reach_mm, TUNING.snap_reach_mm + 1e-9, TUNING.snap_step_mm) / unit
    margin = TUNING.margin_px
    low = np.maximum(np.floor(pixels.min(axis=0)).astype(int) - margin, 0)
    high = np.ceil(pixels.max(axis=0)).astype(int) + margin
    grey = frame.pixels[low[1] : high[1], low[0] : high[0]].astype(np.float32)
    response = sato(-grey if bright else grey, (line_sigma_px(projection, sigma_mm),))
    at = (pixels[:, None] + offsets[None, :, None] * normals[:, None] - low).astype(np.float32)
    strip = cv2.remap(response, at, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    strip = strip / max(float(np.quantile(strip, TUNING.strong_quantile)), 1e-6)
    gain = np.minimum(strip, 1.0).astype(np.float64) - TUNING.off_curve * (offsets * unit / TUNING.snap_reach_mm) ** 2
    best = _ridge_path(gain)
    return np.asarray(pixels + (offsets[best])[:, None] * normals)


def _ridge_path(gain: Array) -> npt.NDArray[np.int64]:
    """(N,) column per row that maximises the gain less a penalty per squared column step (dynamic programming)."""
    rows, columns = gain.shape
    steps = np.arange(-3, 4)
    penalty = (TUNING.bend * steps**2)[:, None]
    total = gain[0].copy()
    choices = np.zeros((rows, columns), dtype=np.int64)
    padded = np.full(columns + 6, -np.inf)
    from_steps = np.lib.stride_tricks.sliding_window_view(padded, columns)  # a row for each step, of the same memory
    for row in range(1, rows):
        padded[3:-3] = total
        options = from_steps - penalty
        choice = np.argmax(options, axis=0)
        choices[row] = steps[choice]
        total = options[choice, np.arange(columns)] + gain[row]
    path = np.empty(rows, dtype=np.int64)
    path[-1] = int(np.argmax(total))
    for row in range(rows - 1, 0, -1):
        path[row - 1] = path[row] + choices[row, path[row]]
    return path
