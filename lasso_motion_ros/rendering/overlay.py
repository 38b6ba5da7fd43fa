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
    """Draw a surface over an image: compensated, or, where there is no motion, static with a warning in words.

    Args:
        image: (H, W) uint8 or uint16 X-ray image.
        projection: world metres to the image's pixels.
        mesh: the surface at the reference, world metres.
        motion: (4, 4) T with p_now = T · p_reference; None where there is none that may be trusted.
        status: with a motion, a remark printed small ("DEGRADED: …", "motion 0.3 s old"), or empty; without one,
            why not ("LOST: too few electrodes seen"), printed in the banner.
        loop: (N, 3) the catheter's curve now, world metres; drawn thin if given.
        style: colours and widths; by default `OverlayStyle()`.

    Returns:
        (H, W, 3) uint8 RGB.
    """
    style = OverlayStyle() if style is None else style
    picture = grey_to_rgb(window_image(image))
    width = line_width(picture, style.outline_width_px)
    still = np.eye(4)
    legend: list[tuple[str, Colour]] = []
    if motion is None:
        draw_surface(picture, silhouette(mesh, projection, still), style.warning, style, width)
        legend.append(("static, NOT compensated", style.warning))
    else:
        if style.show_static:
            draw_surface(picture, silhouette(mesh, projection, still), style.static, style, width, faint=True)
        draw_surface(picture, silhouette(mesh, projection, motion), style.compensated, style, width)
        legend.append(("compensated", style.compensated))
        if style.show_static:
            legend.append(("static", style.static))
    if loop is not None and motion is not None:
        draw_loop(picture, projection, loop, LOOP_COLOUR)
        legend.append(("lasso as tracked", LOOP_COLOUR))
    draw_legend(picture, legend)
    if motion is None:
        draw_banner(picture, static_banner(status), style.warning)
    elif status:
        scale = text_scale(picture)
        line = fit_text(status, scale, picture.shape[1] - 24)
        draw_text(picture, line, 12, int(12 + 26 * scale), style.warning, scale)
    return picture


def static_banner(status: str) -> str:
    """The words over a picture that is not compensated."""
    return f"STATIC OVERLAY – motion {status}" if status else "STATIC OVERLAY – no motion"


def draw_surface(
    picture: RgbImage, shape: Silhouette, colour: Colour, style: OverlayStyle, width_px: float, faint: bool = False
) -> None:
    """Blend one place of the surface into a picture, in place.

    Args:
        picture: (H, W, 3) uint8 RGB, changed.
        shape: the surface's silhouette in this picture.
        colour: of outline and fill.
        style: what is drawn.
        width_px: the outline's width in this picture, pixels.
        faint: draw it as the lesser of two.
    """
    rows, columns = shape.coverage.shape
    if rows == 0 or columns == 0:
        return
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
        opacity = np.maximum(opacity, line)
    _blend(picture, opacity, shape.left - margin, shape.top - margin, colour)


def _outline(coverage: npt.NDArray[np.uint8], shape: Silhouette, margin: int) -> npt.NDArray[np.uint8]:
    """Opacity of the outer contour (a band centred on the region's edge) and, fainter, of the folds inside it."""
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * margin + 1, 2 * margin + 1))
    outer = cv2.morphologyEx(coverage, cv2.MORPH_GRADIENT, kernel)
    folds = np.zeros_like(coverage)
    corner = np.array([shape.left - margin, shape.top - margin])
    fixed = np.rint(np.clip(shape.edges - corner, -1e4, 1e4) * 16.0).astype(np.int32)
    cv2.polylines(folds, list(fixed), False, int(255 * _FOLD_SHARE), 1, cv2.LINE_AA, 4)
    return np.maximum(outer, folds)


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


def _blend(picture: RgbImage, opacity: npt.NDArray[np.uint8], left: int, top: int, colour: Colour) -> None:
    rows, columns = opacity.shape
    y0, x0 = max(top, 0), max(left, 0)
    y1, x1 = min(top + rows, picture.shape[0]), min(left + columns, picture.shape[1])
    if y1 <= y0 or x1 <= x0:
        return
    part = opacity[y0 - top : y1 - top, x0 - left : x1 - left]
    weights = cv2.merge((part, part, part))
    target = picture[y0:y1, x0:x1]
    paint = cv2.multiply(weights, np.array([*colour, 0.0]), scale=1.0 / 255.0)
    kept = cv2.multiply(target, cv2.bitwise_not(weights), scale=1.0 / 255.0)
    picture[y0:y1, x0:x1] = cv2.add(kept, paint)
