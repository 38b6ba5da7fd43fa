"""Drawing primitives: text, banners, legends and curves, scaled to the picture."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.overlay.windowing import RgbImage

Array = npt.NDArray[np.float64]
Colour = tuple[int, int, int]

WHITE: Colour = (240, 240, 240)
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_SUBPIXEL_BITS = 4
# OpenCV's font is ASCII only; other characters would come out as question marks.
_ASCII = str.maketrans(
    {"–": "-", "—": "-", "−": "-", "°": " deg", "±": "+/-", "×": "x", "µ": "u", "…": "...", "’": "'"}
)


def parse_colour(text: str) -> Colour:
    """Red, green and blue (0–255) of "#rrggbb".

    Raises:
        ConfigurationError: any other text.
    """
    digits = text.removeprefix("#")
    try:
        if len(digits) != 6 or not text.startswith("#"):
            raise ValueError
        value = bytes.fromhex(digits)
    except ValueError:
        raise ConfigurationError(f"a colour is written #rrggbb, found {text!r}") from None
    return value[0], value[1], value[2]


def text_scale(image: RgbImage) -> float:
    """Text size for a picture, from its smaller side; never too small to read."""
    return max(0.45, 0.8 * float(min(image.shape[:2])) / 1024.0)


def line_width(image: RgbImage, at_1024_px: float) -> float:
    """A line's width in pixels of this picture, given its width in a 1024-pixel one; at least 1."""
    return max(1.0, at_1024_px * float(min(image.shape[:2])) / 1024.0)


def text_size(text: str, scale: float) -> tuple[int, int]:
    """Width and height in pixels."""
    (width, height), _ = cv2.getTextSize(text.translate(_ASCII), _FONT, scale, _stroke(scale))
    return int(width), int(height)


def draw_text(image: RgbImage, text: str, at: tuple[int, int], colour: Colour, scale: float) -> None:
    """Write one line in place, its baseline beginning at (x, y), with a dark rim that keeps it legible on lung."""
    left, baseline = at
    text = text.translate(_ASCII)
    stroke = _stroke(scale)
    # Shifted copies, not a thicker stroke: with some fonts thicker letters are also wider.
    for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1), (1, 1)):
        cv2.putText(image, text, (left + dx, baseline + dy), _FONT, scale, (0, 0, 0), stroke, cv2.LINE_AA)
    cv2.putText(image, text, at, _FONT, scale, colour, stroke, cv2.LINE_AA)


def fit_text(text: str, scale: float, width: int) -> str:
    """The text, shortened with dots if it is wider than `width` pixels."""
    if text_size(text, scale)[0] <= width:
        return text
    while text and text_size(text + "...", scale)[0] > width:
        text = text[:-1]
    return text.rstrip() + "..."


def draw_banner(image: RgbImage, text: str, colour: Colour) -> None:
    """A warning that cannot be missed: a bar with text across the top and a frame of the same colour."""
    scale = 1.15 * text_scale(image)
    height = round(46 * scale / 0.7)
    width = image.shape[1]
    image[:height] = colour
    line = fit_text(text, scale, width - 24)
    text_width, text_height = text_size(line, scale)
    origin = ((width - text_width) // 2, (height + text_height) // 2)
    cv2.putText(image, line.translate(_ASCII), origin, _FONT, scale, (0, 0, 0), _stroke(scale) + 1, cv2.LINE_AA)
    border = max(2, image.shape[0] // 200)
    cv2.rectangle(image, (0, 0), (width - 1, image.shape[0] - 1), colour, 2 * border)


def draw_legend(image: RgbImage, entries: list[tuple[str, Colour]]) -> None:
    """Short names with a stroke of their colour, stacked in the lower left corner."""
    scale = text_scale(image)
    step = round(36 * scale)
    baseline = image.shape[0] - step - step * (len(entries) - 1)
    for text, colour in entries:
        middle = baseline - text_size("x", scale)[1] // 2
        for shade, width in (((0, 0, 0), 5), (colour, 3)):
            cv2.line(image, (step, middle), (2 * step, middle), shade, width, cv2.LINE_AA)
        draw_text(image, text, (2 * step + step // 2, baseline), colour, scale)
        baseline += step


def draw_curve(image: RgbImage, points: Array, colour: Colour, width: int = 1, closed: bool = False) -> None:
    """Draw a curve of pixels (N, 2) in place, with sub-pixel accuracy; points that are not finite are skipped."""
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < 2:
        return
    # Far outside the image, coordinates would overflow OpenCV's fixed-point format.
    points = np.clip(points, -1e4, 1e4)
    fixed = np.rint(points * 2**_SUBPIXEL_BITS).astype(np.int32)
    cv2.polylines(image, [fixed.reshape(-1, 1, 2)], closed, colour, width, cv2.LINE_AA, _SUBPIXEL_BITS)


def draw_loop(image: RgbImage, projection: Projection, loop: Array, colour: Colour) -> None:
    """Draw the catheter's 3-D curve (N, 3), world metres, as a thin line in place."""
    draw_curve(image, projection.project(loop), colour, width=max(1, round(line_width(image, 1.4))))


def _stroke(scale: float) -> int:
    return 2 if scale > 0.75 else 1
