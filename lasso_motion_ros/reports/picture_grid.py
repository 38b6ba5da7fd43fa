"""Pictures composed of others: fitted into cells, joined with gaps, with strips of text."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from lasso_motion_ros.overlay.primitives import WHITE, Colour, draw_banner, draw_text, fit_text
from lasso_motion_ros.overlay.windowing import RgbImage

RESEARCH_ONLY = "Research use only, not a medical device"
"""Stands in every frame of a video."""
STRIP_PX = 34
STRIP_TEXT_SCALE = 0.55
STRIP_TEXT_AT = (12, 23)
_STRIP_SHADE = 26
_MISSING_COLOUR: Colour = (170, 170, 170)


def fitted(picture: RgbImage, width: int, height: int) -> RgbImage:
    """A picture in the upper left corner of a cell (height, width, 3), as large as it goes; black beside it."""
    scale = min(width / picture.shape[1], height / picture.shape[0])
    size = max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale))
    cell = np.zeros((height, width, 3), dtype=np.uint8)
    cell[: size[1], : size[0]] = cv2.resize(
        picture, size, interpolation=cv2.INTER_AREA if scale < 1.0 else cv2.INTER_LINEAR
    )
    return cell


def missing_cell(width: int, height: int, words: str) -> RgbImage:
    """A black cell with a banner that says what is missing."""
    cell = np.zeros((height, width, 3), dtype=np.uint8)
    draw_banner(cell, words, _MISSING_COLOUR)
    return cell


def text_strip(
    words: str,
    width: int,
    *,
    height: int = STRIP_PX,
    at: tuple[int, int] = STRIP_TEXT_AT,
    scale: float = STRIP_TEXT_SCALE,
) -> RgbImage:
    """Words in a dark strip (height, width, 3), shortened to fit."""
    strip = np.full((height, width, 3), _STRIP_SHADE, dtype=np.uint8)
    draw_text(strip, fit_text(words, scale, width - 2 * at[0]), at, WHITE, scale)
    return strip


def beside(pictures: Sequence[RgbImage], gap_px: int, shade: int = 0) -> RgbImage:
    """Pictures of one height, from left to right, with gaps of one grey."""
    return _joined(pictures, gap_px, shade, axis=1)


def below_each_other(pictures: Sequence[RgbImage], gap_px: int = 0, shade: int = 0) -> RgbImage:
    """Pictures of one width, from top to bottom, with gaps of one grey."""
    return _joined(pictures, gap_px, shade, axis=0)


def _joined(pictures: Sequence[RgbImage], gap_px: int, shade: int, axis: int) -> RgbImage:
    shape = list(pictures[0].shape)
    shape[axis] = gap_px
    gap = np.full(shape, shade, dtype=np.uint8)
    parts = [part for picture in pictures for part in (gap, picture)][1:]
    return np.concatenate(parts, axis=axis)
