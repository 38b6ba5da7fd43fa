"""Alpha masks: the opacity of one drawing over part of a picture, and its blending into the picture."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.overlay.primitives import Colour
from lasso_motion_ros.overlay.silhouette import WALL_CELL_PX, Silhouette
from lasso_motion_ros.overlay.style import OverlayStyle
from lasso_motion_ros.overlay.windowing import RgbImage


@dataclass(frozen=True)
class _Tuning:
    """How a drawing looks.

    Attributes:
        faint_fill: opacity of a fill that stands behind another drawing, as a share of the usual.
        faint_line: the same for an outline.
        fold: opacity of the folds inside the outline, as a share of the outline's.
        wall_fades_m: distance behind the nearest wall at which another one counts 1/e.
        densest: largest opacity of a fill: the film must stay visible.
    """

    faint_fill: float = 0.3
    faint_line: float = 0.65
    fold: float = 0.45
    wall_fades_m: float = 0.02
    densest: float = 0.75


TUNING = _Tuning()


@dataclass(frozen=True, eq=False)
class AlphaMask:
    """Opacity (h, w) uint8 of one drawing, and where its first column and row lie in the picture."""

    opacity: npt.NDArray[np.uint8]
    left: int
    top: int
    _painted: dict[Colour, RgbImage] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def kept(self) -> RgbImage:
        """(h, w, 3) uint8 the share of 255 that is left of the picture."""
        return np.asarray(cv2.cvtColor(cv2.bitwise_not(self.opacity), cv2.COLOR_GRAY2RGB), dtype=np.uint8)

    def painted(self, colour: Colour) -> RgbImage:
        """(h, w, 3) uint8 what the drawing adds in a colour; kept, since the static place is drawn on every picture."""
        known = self._painted.get(colour)
        if known is None:
            # Channel by channel: to multiply an image by a colour takes OpenCV four times as long.
            channels = [cv2.convertScaleAbs(self.opacity, alpha=value / 255.0) for value in colour]
            known = self._painted[colour] = np.asarray(cv2.merge(channels), dtype=np.uint8)
        return known


def surface_mask(shape: Silhouette, style: OverlayStyle, width_px: float, faint: bool = False) -> AlphaMask:
    """The alpha mask of a surface.

    Args:
        shape: its silhouette in the picture.
        style: what is drawn.
        width_px: the outline's width in this picture, pixels.
        faint: drawn fainter, to stand behind another drawing.
    """
    if shape.coverage.size == 0:
        return AlphaMask(np.zeros((0, 0), dtype=np.uint8), 0, 0)
    coverage = cv2.convertScaleAbs(shape.coverage, alpha=255.0)
    opacity = np.zeros_like(coverage)
    if style.fill:
        opacity = _fill_opacity(shape, style.fill_opacity * (TUNING.faint_fill if faint else 1.0))
    margin = 0
    if style.outline:
        margin = max(1, round(width_px / 2.0))
        coverage, opacity = (
            cv2.copyMakeBorder(i, margin, margin, margin, margin, cv2.BORDER_CONSTANT) for i in (coverage, opacity)
        )
        line = _outline(coverage, shape, margin)
        if faint:
            line = cv2.convertScaleAbs(line, alpha=TUNING.faint_line)
        opacity = cv2.max(opacity, line)
    return AlphaMask(opacity, shape.left - margin, shape.top - margin)


def band(coverage: npt.NDArray[np.uint8], margin: int) -> npt.NDArray[np.uint8]:
    """A band of `margin` pixels to either side of a region's edge; (H, W) uint8 like the coverage, 0–255."""
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * margin + 1, 2 * margin + 1))
    return np.asarray(cv2.morphologyEx(coverage, cv2.MORPH_GRADIENT, kernel), dtype=np.uint8)


def _outline(coverage: npt.NDArray[np.uint8], shape: Silhouette, margin: int) -> npt.NDArray[np.uint8]:
    """Opacity of the outer contour (a band centred on the region's edge) and, fainter, of the folds inside it."""
    outer = band(coverage, margin)
    folds = np.zeros_like(coverage)
    corner = np.array([shape.left - margin, shape.top - margin])
    fixed = np.rint(np.clip(shape.edges - corner, -1e4, 1e4) * 16.0).astype(np.int32)
    cv2.polylines(folds, list(fixed), False, int(255 * TUNING.fold), 1, cv2.LINE_AA, 4)
    return np.asarray(cv2.max(outer, folds), dtype=np.uint8)


def _fill_opacity(shape: Silhouette, opacity: float) -> npt.NDArray[np.uint8]:
    """Like glass: clear where the wall faces the viewer, denser towards the rim and where walls overlap."""
    rows, columns = shape.coverage.shape
    height, width = shape.wall_count.shape
    x, y = (
        ((at - first + 0.5) / WALL_CELL_PX).astype(np.intp)
        for at, first in zip(shape.centroids.T, (shape.left, shape.top), strict=True)
    )
    seen = np.flatnonzero((x >= 0) & (y >= 0) & (x < width) & (y < height) & (shape.facing > 0.0))
    flat = y[seen] * width + x[seen]
    depth = shape.depth[seen]
    # The wall nearer to the viewer, who looks from the detector's side, counts most.
    weight = np.exp(((depth - depth.max(initial=0.0)) / TUNING.wall_fades_m).astype(np.float32))
    total, tilted = (
        cv2.GaussianBlur(
            np.bincount(flat, weights=w, minlength=width * height).astype(np.float32).reshape(height, width),
            (0, 0),
            2.0,
        )
        for w in (weight, weight * (1.0 - shape.facing[seen]))
    )
    shade = (0.4 + 0.6 * tilted / np.maximum(total, 1e-12)) * np.sqrt(np.maximum(shape.wall_count, 1.0) / 2.0)
    shade = np.minimum(255.0 * opacity * shade, TUNING.densest * 255.0).astype(np.float32)
    full = cv2.resize(shade, (width * WALL_CELL_PX, height * WALL_CELL_PX), interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.multiply(full[:rows, :columns], shape.coverage, dtype=cv2.CV_8U), dtype=np.uint8)


def blend(picture: RgbImage, mask: AlphaMask, colour: Colour) -> None:
    """Paint one colour into a picture (H, W, 3) uint8, in place, with the mask's opacity."""
    rows, columns = mask.opacity.shape
    top, left = mask.top, mask.left
    y0, x0 = max(top, 0), max(left, 0)
    y1, x1 = min(top + rows, picture.shape[0]), min(left + columns, picture.shape[1])
    if y1 <= y0 or x1 <= x0:
        return
    part = slice(y0 - top, y1 - top), slice(x0 - left, x1 - left)
    target = picture[y0:y1, x0:x1]
    kept = cv2.multiply(target, mask.kept[part], scale=1.0 / 255.0)
    cv2.add(kept, mask.painted(colour)[part], dst=target)
