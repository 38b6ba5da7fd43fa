"""The overlay: a surface drawn over an X-ray image, at its static and at its compensated place."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.configuration import OverlayStyleConfig
from lasso_motion_ros.geometry import Projection
from lasso_motion_ros.rendering.annotation import (
    Colour,
    draw_banner,
    draw_legend,
    draw_loop,
    draw_text,
    fit_text,
    line_width,
    parse_colour,
    text_scale,
)
from lasso_motion_ros.rendering.silhouette import LAYER_CELL_PX, Silhouette, silhouette
from lasso_motion_ros.rendering.surface import TriangleMesh
from lasso_motion_ros.rendering.windowing import GreyImage, RgbImage, grey_to_rgb, window_image

Array = npt.NDArray[np.float64]

LOOP_COLOUR: Colour = (255, 226, 64)
_STATIC_FILL_SHARE = 0.3
_STATIC_LINE_SHARE = 0.65
_FOLD_SHARE = 0.45
_WALL_FADES_M = 0.02
_DENSEST = 0.75
_LAYERS_KEPT = 8


@dataclass(frozen=True)
class OverlayStyle:
    """How the overlay looks; `overlay_style` makes it from the node's parameters.

    Attributes:
        outline: whether the outline and the folds are drawn.
        fill: whether the region is filled.
        fill_opacity: opacity of the fill at its rim, 0–1.
        outline_width_px: width of the outline in a 1024-pixel image.
        show_static: whether the static place is drawn beside the compensated one.
        compensated: colour of the compensated place.
        static: colour of the static place beside it.
        warning: colour of everything where there is no compensation.
    """

    outline: bool = True
    fill: bool = True
    fill_opacity: float = 0.30
    outline_width_px: float = 2.0
    show_static: bool = True
    compensated: Colour = (75, 224, 138)
    static: Colour = (143, 180, 216)
    warning: Colour = (255, 176, 0)


def overlay_style(config: OverlayStyleConfig) -> OverlayStyle:
    """The style that a configuration names.

    Raises:
        ConfigurationError: a colour that is not #rrggbb.
    """
    return OverlayStyle(
        outline=config.drawing != "fill",
        fill=config.drawing != "outline",
        fill_opacity=config.fill_opacity,
        outline_width_px=config.outline_width_px,
        show_static=config.show_static,
        compensated=parse_colour(config.compensated_colour),
        static=parse_colour(config.static_colour),
        warning=parse_colour(config.warning_colour),
    )


class OverlayPainter:
    """Draws one surface over image after image; what does not change from one to the next is kept.

    One painter serves both planes. It is not meant for several threads at once.

    Args:
        mesh: the surface at the reference, world metres.
        style: colours and widths; by default `OverlayStyle()`.
    """

    def __init__(self, mesh: TriangleMesh, style: OverlayStyle | None = None) -> None:
        self.mesh = mesh
        self.style = OverlayStyle() if style is None else style
        self._still: dict[tuple[object, ...], _Layer] = {}

    def draw(
        self,
        image: GreyImage,
        projection: Projection,
        motion: Array | None,
        status: str = "",
        *,
        loop: Array | None = None,
    ) -> RgbImage:
        """The surface over an image: compensated, or, where there is no motion, static with a warning in words.

        Args:
            image: (H, W) uint8 or uint16 X-ray image.
            projection: world metres to the image's pixels.
            motion: (4, 4) T with p_now = T · p_reference; None where there is none that may be trusted.
            status: with a motion, a remark printed small ("DEGRADED: …", "motion 0.3 s old"), or empty; without one,
                why not ("LOST: too few electrodes are seen"), printed in the banner.
            loop: (N, 3) the catheter's curve now, world metres; drawn thin beside a motion, never without one.

        Returns:
            (H, W, 3) uint8 RGB.
        """
        style = self.style
        picture = grey_to_rgb(window_image(image))
        width = line_width(picture, style.outline_width_px)
        if motion is None:
            _blend(picture, self._still_layer(projection, width, faint=False), style.warning)
            draw_legend(picture, [("static, NOT compensated", style.warning)])
            draw_banner(picture, static_banner(status), style.warning)
            return picture
        legend = [("compensated", style.compensated)]
        if style.show_static:
            _blend(picture, self._still_layer(projection, width, faint=True), style.static)
            legend.append(("static", style.static))
        draw_surface(picture, silhouette(self.mesh, projection, motion), style.compensated, style, width)
        if loop is not None:
            draw_loop(picture, projection, loop, LOOP_COLOUR)
            legend.append(("lasso as tracked", LOOP_COLOUR))
        draw_legend(picture, legend)
        if status:
            scale = text_scale(picture)
            line = fit_text(status, scale, picture.shape[1] - 24)
            draw_text(picture, line, (12, int(12 + 26 * scale)), style.warning, scale)
        return picture

    def _still_layer(self, projection: Projection, width: float, faint: bool) -> _Layer:
        style = self.style
        key = (
            projection.matrix.tobytes(), projection.width, projection.height, width, faint,
            style.fill, style.outline, style.fill_opacity,
        )  # fmt: skip
        layer = self._still.get(key)
        if layer is None:
            if len(self._still) >= _LAYERS_KEPT:
                self._still.clear()
            layer = _surface_layer(silhouette(self.mesh, projection, np.eye(4)), style, width, faint)
            self._still[key] = layer
        return layer


def draw_overlay(
    image: GreyImage,
    projection: Projection,
    mesh: TriangleMesh,
    motion: Array | None,
    status: str = "",
    *,
    loop: Array | None = None,
    style: OverlayStyle | None = None,
) -> RgbImage:
    """One overlay picture; arguments and result as in `OverlayPainter`, which is faster for a sequence."""
    return OverlayPainter(mesh, style).draw(image, projection, motion, status, loop=loop)


def static_banner(status: str) -> str:
    """The words over a picture that is not compensated."""
    return f"STATIC OVERLAY – motion {status}" if status else "STATIC OVERLAY – no motion"


def draw_surface(picture: RgbImage, shape: Silhouette, colour: Colour, style: OverlayStyle, width_px: float) -> None:
    """Blend one place of the surface into a picture, in place.

    Args:
        picture: (H, W, 3) uint8 RGB, changed.
        shape: the surface's silhouette in this picture.
        colour: of outline and fill.
        style: what is drawn.
        width_px: the outline's width in this picture, pixels.
    """
    _blend(picture, _surface_layer(shape, style, width_px, faint=False), colour)


@dataclass(frozen=True, eq=False)
class _Layer:
    """Opacity (h, w) uint8 of one drawing, and where its first column and row lie in the picture."""

    opacity: npt.NDArray[np.uint8]
    left: int
    top: int


def _surface_layer(shape: Silhouette, style: OverlayStyle, width_px: float, faint: bool) -> _Layer:
    if shape.coverage.size == 0:
        return _Layer(np.zeros((0, 0), dtype=np.uint8), 0, 0)
    coverage = cv2.convertScaleAbs(shape.coverage, alpha=255.0)
    opacity = np.zeros_like(coverage)
    if style.fill:
        opacity = _fill_opacity(shape, style.fill_opacity * (_STATIC_FILL_SHARE if faint else 1.0))
    margin = 0
    if style.outline:
        margin = max(1, round(width_px / 2.0))
        coverage, opacity = (
            cv2.copyMakeBorder(i, margin, margin, margin, margin, cv2.BORDER_CONSTANT) for i in (coverage, opacity)
        )
        line = _outline(coverage, shape, margin)
        if faint:
            line = cv2.convertScaleAbs(line, alpha=_STATIC_LINE_SHARE)
        opacity = cv2.max(opacity, line)
    return _Layer(opacity, shape.left - margin, shape.top - margin)


def _outline(coverage: npt.NDArray[np.uint8], shape: Silhouette, margin: int) -> npt.NDArray[np.uint8]:
    """Opacity of the outer contour (a band centred on the region's edge) and, fainter, of the folds inside it."""
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * margin + 1, 2 * margin + 1))
    outer = cv2.morphologyEx(coverage, cv2.MORPH_GRADIENT, kernel)
    folds = np.zeros_like(coverage)
    corner = np.array([shape.left - margin, shape.top - margin])
    fixed = np.rint(np.clip(shape.edges - corner, -1e4, 1e4) * 16.0).astype(np.int32)
    cv2.polylines(folds, list(fixed), False, int(255 * _FOLD_SHARE), 1, cv2.LINE_AA, 4)
    return np.asarray(cv2.max(outer, folds), dtype=np.uint8)


def _fill_opacity(shape: Silhouette, opacity: float) -> npt.NDArray[np.uint8]:
    """Like glass: clear where the wall faces the viewer, denser towards the rim and where walls overlap."""
    rows, columns = shape.coverage.shape
    height, width = shape.layers.shape
    at = ((shape.centroids - (shape.left, shape.top) + 0.5) / LAYER_CELL_PX).astype(np.int32)
    seen = np.flatnonzero(
        (at[:, 0] >= 0) & (at[:, 1] >= 0) & (at[:, 0] < width) & (at[:, 1] < height) & (shape.facing > 0.0)
    )
    flat = at[seen, 1] * width + at[seen, 0]
    depth = shape.depth[seen]
    # The wall nearer to the viewer, who looks from the detector's side, counts most.
    weight = np.exp((depth - depth.max(initial=0.0)) / _WALL_FADES_M)
    total, tilted = (
        cv2.GaussianBlur(np.bincount(flat, weights=w, minlength=width * height).reshape(height, width), (0, 0), 2.0)
        for w in (weight, weight * (1.0 - shape.facing[seen]))
    )
    shade = (0.4 + 0.6 * tilted / np.maximum(total, 1e-12)) * np.sqrt(np.maximum(shape.layers, 1.0) / 2.0)
    shade = np.minimum(255.0 * opacity * shade, _DENSEST * 255.0).astype(np.float32)
    full = cv2.resize(shade, (width * LAYER_CELL_PX, height * LAYER_CELL_PX), interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.convertScaleAbs(cv2.multiply(full[:rows, :columns], shape.coverage)), dtype=np.uint8)


def _blend(picture: RgbImage, layer: _Layer, colour: Colour) -> None:
    rows, columns = layer.opacity.shape
    top, left = layer.top, layer.left
    y0, x0 = max(top, 0), max(left, 0)
    y1, x1 = min(top + rows, picture.shape[0]), min(left + columns, picture.shape[1])
    if y1 <= y0 or x1 <= x0:
        return
    part = layer.opacity[y0 - top : y1 - top, x0 - left : x1 - left]
    weights = cv2.merge((part, part, part))
    target = picture[y0:y1, x0:x1]
    paint = cv2.multiply(weights, np.array([*colour, 0.0]), scale=1.0 / 255.0)
    kept = cv2.multiply(target, cv2.bitwise_not(weights), scale=1.0 / 255.0)
    picture[y0:y1, x0:x1] = cv2.add(kept, paint)
