"""The overlay over the pairs of a recording: what the node draws live, with the motions of a result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from lasso_motion_ros.config.overlay import OverlayConfig
from lasso_motion_ros.evaluation.measures import SAME_PAIR_NS, PairEstimate
from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Plane
from lasso_motion_ros.overlay.motion_history import Choice, MotionHistory
from lasso_motion_ros.overlay.painter import OverlayPainter
from lasso_motion_ros.overlay.primitives import WHITE, draw_banner, draw_text, fit_text
from lasso_motion_ros.overlay.windowing import RgbImage

OverlayView = Literal["compensated", "static", "both"]
OVERLAY_VIEWS: tuple[OverlayView, ...] = ("compensated", "static", "both")

_STRIP_PX = 34
_GAP_PX = 4


@dataclass(frozen=True, eq=False)
class DrawnPair:
    """One pair as drawn.

    Attributes:
        planes: per plane that has an image, (H, W, 3) uint8 RGB; with the view `both` static left, compensated right.
        compensated: whether a motion was applied.
        status: the words on the picture, or empty.
    """

    planes: Mapping[Plane, RgbImage]
    compensated: bool
    status: str


class OfflineOverlay:
    """Draws pair after pair, in order of time, by the node's own rule of which motion an image is drawn with.

    Args:
        painter: draws.
        config: the overlay's parameters.
        estimates: what the tracker published, in order of time.
        view: what is shown.
    """

    def __init__(
        self, painter: OverlayPainter, config: OverlayConfig, estimates: Sequence[PairEstimate], view: OverlayView
    ) -> None:
        self._painter = painter
        self._history = MotionHistory(config)
        self._estimates = list(estimates)
        self._view = view

    def draw(self, pair: FramePair) -> DrawnPair:
        """One pair; those before it must have been drawn before."""
        self._take_estimates(pair.stamp_ns)
        pictures: dict[Plane, RgbImage] = {}
        choices: list[Choice] = []
        for plane, frame in pair.frames.items():
            self._history.add_image(plane, frame.stamp_ns)
            choice = self._history.choose(plane, frame.stamp_ns)
            choices.append(choice)
            pictures[plane] = self._picture(frame, choice)
        compensated = bool(choices) and all(choice.motion is not None for choice in choices)
        return DrawnPair(pictures, compensated, choices[0].status if choices else "")

    def _take_estimates(self, stamp_ns: int) -> None:
        while self._estimates and self._estimates[0].stamp_ns <= stamp_ns + SAME_PAIR_NS:
            estimate = self._estimates.pop(0)
            # The pair's own stamp, so that what was rounded still belongs to it.
            near = abs(estimate.stamp_ns - stamp_ns) <= SAME_PAIR_NS
            at_ns = stamp_ns if near else estimate.stamp_ns
            self._history.add_state(estimate.state)
            if estimate.motion is not None:
                self._history.add_motion(at_ns, estimate.motion)
                if estimate.loop is not None:
                    self._history.add_loop(at_ns, estimate.loop)

    def _picture(self, frame: Frame, choice: Choice) -> RgbImage:
        static = self._painter.draw_static(frame.pixels, frame.projection) if self._view != "compensated" else None
        if self._view == "static" and static is not None:
            return static
        moved = self._painter.draw(frame.pixels, frame.projection, choice.motion, choice.status, loop=choice.loop)
        if static is None:
            return moved
        gap = np.zeros((moved.shape[0], _GAP_PX, 3), dtype=np.uint8)
        return np.concatenate([static, gap, moved], axis=1)


def video_picture(drawn: DrawnPair, view: OverlayView, cell_px: int, words: str) -> RgbImage:
    """One frame of a video: both planes in cells of one size (below each other where each has two), words under them.

    Args:
        drawn: the pair.
        view: as it was drawn.
        cell_px: side of a cell, pixels.
        words: what stands in the strip below.
    """
    columns = 2 if view == "both" else 1
    width, height = columns * cell_px + (columns - 1) * _GAP_PX, cell_px
    cells = []
    for plane in PLANES:
        cell = np.zeros((height, width, 3), dtype=np.uint8)
        picture = drawn.planes.get(plane)
        if picture is None:
            draw_banner(cell, f"plane {plane.upper()}: no image in this pair", (170, 170, 170))
        else:
            scale = min(width / picture.shape[1], height / picture.shape[0])
            size = max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale))
            small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA if scale < 1.0 else cv2.INTER_LINEAR)
            cell[: size[1], : size[0]] = small
        cells.append(cell)
    below = view == "both"
    gap = np.zeros((_GAP_PX, width, 3) if below else (height, _GAP_PX, 3), dtype=np.uint8)
    grid = np.concatenate([cells[0], gap, cells[1]], axis=0 if below else 1)
    strip = np.full((_STRIP_PX, grid.shape[1], 3), 26, dtype=np.uint8)
    draw_text(strip, fit_text(words, 0.55, grid.shape[1] - 24), (12, 23), WHITE, 0.55)
    return np.concatenate([grid, strip], axis=0)
