"""Where a plane's image shows lines: the line filter's response, worked out where it is asked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import Frame
from lasso_motion_ros.seeding.line_filter import Image, sato
from lasso_motion_ros.seeding.outlines import line_sigma_px

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How much of the image is filtered at once."""

    margin_px: int = 16  # about what is asked for, for the filter's kernel and what lies beside a curve
    ahead_px: int = 32  # and further, so that the next curve, some pixels off, is found there


TUNING = _Tuning()


class LineMap:
    """The line filter's response to one frame, kept for the part of it that was asked for so far.

    Args:
        frame: the plane's frame.
        bright: whether lines are brighter than their background.
        sigma_mm: scale of the filter, at the world origin's depth.
    """

    def __init__(self, frame: Frame, *, bright: bool, sigma_mm: float) -> None:
        self._pixels, self._bright = frame.pixels, bright
        self._sigma_px = line_sigma_px(frame.projection, sigma_mm)
        self._low: npt.NDArray[np.int64] = np.zeros(2, dtype=np.int64)
        self._high = self._low
        self._response: Image = np.zeros((0, 0), dtype=np.float32)

    def about(self, pixels: Array) -> tuple[Image, npt.NDArray[np.int64]]:
        """The response (h, w) about pixels (N, 2) of the frame, and the pixel (2,) x, y of its corner."""
        size = np.array(self._pixels.shape[::-1])
        low = np.clip(np.floor(pixels.min(axis=0)).astype(int) - TUNING.margin_px, 0, size)
        high = np.clip(np.ceil(pixels.max(axis=0)).astype(int) + TUNING.margin_px, 0, size)
        is_first = self._response.size == 0
        if is_first or (low < self._low).any() or (high > self._high).any():
            if not is_first:
                low, high = np.minimum(low, self._low), np.maximum(high, self._high)
            self._low = np.maximum(low - TUNING.ahead_px, 0)
            self._high = np.minimum(high + TUNING.ahead_px, size)
            (left, top), (right, bottom) = self._low, self._high
            grey = self._pixels[top:bottom, left:right].astype(np.float32)
            self._response = sato(-grey if self._bright else grey, (self._sigma_px,))
        return self._response, self._low
