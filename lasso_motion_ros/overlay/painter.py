"""The overlay: a surface or a volume drawn over an X-ray image, at its static and at its compensated place."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.overlay.compositing import AlphaMask, blend, surface_mask
from lasso_motion_ros.overlay.error_band import error_band
from lasso_motion_ros.overlay.primitives import (
    Colour,
    draw_banner,
    draw_legend,
    draw_loop,
    draw_text,
    fit_text,
    line_width,
    text_scale,
)
from lasso_motion_ros.overlay.silhouette import silhouette
from lasso_motion_ros.overlay.style import OverlayStyle
from lasso_motion_ros.overlay.triangle_mesh import TriangleMesh
from lasso_motion_ros.overlay.volume_cloud import VolumeCloud, cloud_mask
from lasso_motion_ros.overlay.windowing import GreyImage, RgbImage, grey_to_rgb, window_image

Array = npt.NDArray[np.float64]

LOOP_COLOUR: Colour = (255, 226, 64)
_MASKS_KEPT = 8


class OverlayPainter:
    """Draws one object over a sequence of images and caches what does not change between them.

    One painter serves both planes. Draw from one thread only; `style` may be set from another.

    Args:
        shown: the surface, or the cloud of a volume, at the reference, world metres.
        style: colours and widths; by default `OverlayStyle()`.
    """

    def __init__(self, shown: TriangleMesh | VolumeCloud, style: OverlayStyle | None = None) -> None:
        self.shown = shown
        self.style = OverlayStyle() if style is None else style
        self._still: dict[tuple[object, ...], AlphaMask] = {}

    def draw(
        self,
        image: GreyImage,
        projection: Projection,
        motion: Array | None,
        status: str = "",
        *,
        loop: Array | None = None,
        covariance: Array | None = None,
    ) -> RgbImage:
        """The surface over an image: compensated, or, where there is no motion, static with a warning in words.

        Args:
            image: (H, W) uint8 or uint16 X-ray image.
            projection: world metres to the image's pixels.
            motion: (4, 4) T with p_now = T · p_reference; None where none can be trusted.
            status: with a motion, a remark printed small ("DEGRADED: …", "motion 0.3 s old"), or empty; without one,
                why not ("LOST: too few electrodes are seen"), printed in the banner.
            loop: (N, 3) the catheter's curve now, world metres; drawn thin beside a motion, never without one.
            covariance: (6, 6) of the motion at the world origin (x, y, z, then about the fixed axes; m, rad), for the
                band about a surface's outline; None where it is not known.

        Returns:
            (H, W, 3) uint8 RGB.
        """
        style = self.style
        picture = grey_to_rgb(window_image(image))
        width = line_width(picture, style.outline_width_px)
        if motion is None:
            blend(picture, self._still_mask(projection, style, width, faint=False), style.warning)
            draw_legend(picture, [("static, NOT compensated", style.warning)])
            draw_banner(picture, static_banner(status), style.warning)
            return picture
        legend = [("compensated", style.compensated)]
        if style.show_static:
            blend(picture, self._still_mask(projection, style, width, faint=True), style.static)
            legend.append(("static", style.static))
        if style.error_band and covariance is not None and isinstance(self.shown, TriangleMesh):
            shape = silhouette(self.shown, projection, motion)
            band = error_band(self.shown, shape, projection, motion, covariance)
            blend(picture, band, style.compensated)
            legend.append(("95 % error band", _lighter(style.compensated)))
            blend(picture, surface_mask(shape, style, width), style.compensated)
        else:
            blend(picture, self._mask(projection, motion, style, width, faint=False), style.compensated)
        if loop is not None:
            draw_loop(picture, projection, loop, LOOP_COLOUR)
            legend.append(("lasso as tracked", LOOP_COLOUR))
        draw_legend(picture, legend)
        if status:
            scale = text_scale(picture)
            line = fit_text(status, scale, picture.shape[1] - 24)
            draw_text(picture, line, (12, int(12 + 26 * scale)), style.warning, scale)
        return picture

    def draw_static(self, image: GreyImage, projection: Projection) -> RgbImage:
        """The object at its static place only, in the static colour: the overlay without compensation."""
        picture = grey_to_rgb(window_image(image))
        width = line_width(picture, self.style.outline_width_px)
        blend(picture, self._still_mask(projection, self.style, width, faint=False), self.style.static)
        draw_legend(picture, [("static", self.style.static)])
        return picture

    def _mask(self, projection: Projection, motion: Array, style: OverlayStyle, width: float, faint: bool) -> AlphaMask:
        if isinstance(self.shown, VolumeCloud):
            return cloud_mask(self.shown, projection, motion, style, width, faint)
        return surface_mask(silhouette(self.shown, projection, motion), style, width, faint)

    def _still_mask(self, projection: Projection, style: OverlayStyle, width: float, faint: bool) -> AlphaMask:
        key = (projection.matrix.tobytes(), projection.width, projection.height, width, faint, style)
        mask = self._still.get(key)
        if mask is None:
            if len(self._still) >= _MASKS_KEPT:
                self._still.clear()
            mask = self._mask(projection, np.eye(4), style, width, faint)
            self._still[key] = mask
        return mask


def _lighter(colour: Colour) -> Colour:
    """The colour by which a legend tells what is drawn translucent from its outline."""
    red, green, blue = ((value + 255) // 2 for value in colour)
    return red, green, blue


def static_banner(status: str) -> str:
    """The words over a picture that is not compensated."""
    return f"STATIC OVERLAY – {status or 'no motion'}"
