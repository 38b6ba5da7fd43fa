"""The overlay's colours, widths and opacities, from the node's parameters."""

from __future__ import annotations

from dataclasses import dataclass

from lasso_motion_ros.config.overlay import OverlayStyleConfig
from lasso_motion_ros.overlay.primitives import Colour, parse_colour


@dataclass(frozen=True)
class OverlayStyle:
    """How the overlay looks; `overlay_style` makes it from the node's parameters.

    Attributes:
        outline: whether the outline and the folds are drawn.
        fill: whether the region is filled.
        fill_opacity: opacity of the fill at its rim, 0–1.
        outline_width_px: width of the outline in a 1024-pixel image.
        error_band: whether the band that holds 95 % of the error is drawn about the compensated outline.
        show_static: whether the static place is drawn beside the compensated one.
        compensated: colour of the compensated place.
        static: colour of the static place beside it.
        warning: colour of everything where there is no compensation.
        projection_depth_m: thickness of a volume that is drawn with `fill_opacity` where its projection is drawn.
    """

    outline: bool = True
    fill: bool = True
    fill_opacity: float = 0.30
    outline_width_px: float = 2.0
    error_band: bool = True
    show_static: bool = True
    compensated: Colour = (75, 224, 138)
    static: Colour = (143, 180, 216)
    warning: Colour = (255, 176, 0)
    projection_depth_m: float = 0.03


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
        error_band=config.error_band,
        show_static=config.show_static,
        compensated=parse_colour(config.compensated_colour),
        static=parse_colour(config.static_colour),
        warning=parse_colour(config.warning_colour),
        projection_depth_m=1e-3 * config.projection_depth_mm,
    )
