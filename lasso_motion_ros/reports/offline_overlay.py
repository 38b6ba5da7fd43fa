"""The overlay drawn offline: what the node draws live, from a recording and a tracker's result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.overlay import OverlayConfig
from lasso_motion_ros.evaluation.measures import PairEstimate
from lasso_motion_ros.evaluation.same_pair import is_same_pair
from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Plane
from lasso_motion_ros.overlay.motion_history import Choice, MotionHistory
from lasso_motion_ros.overlay.painter import OverlayPainter
from lasso_motion_ros.overlay.windowing import RgbImage
from lasso_motion_ros.reports.picture_grid import (
    RESEARCH_ONLY,
    below_each_other,
    beside,
    fitted,
    missing_cell,
    text_strip,
)

Array = npt.NDArray[np.float64]
OverlayView = Literal["compensated", "static", "both"]
OVERLAY_VIEWS: tuple[OverlayView, ...] = ("compensated", "static", "both")

_GAP_PX = 4


@dataclass(frozen=True, eq=False)
class DrawnPair:
    """One pair as drawn.

    Attributes:
        planes: per plane that has an image, (H, W, 3) uint8 RGB; with the view `both` static left, compensated right.
        compensated: whether a motion was applied.
        status: the words on the picture, or empty.
        state: what the tracker said of this pair; empty where it did not answer.
        motion: (4, 4) the motion that was applied to plane A (else B), metres; None where there was none.
    """

    planes: Mapping[Plane, RgbImage]
    compensated: bool
    status: str
    state: str = ""
    motion: Array | None = None


class OfflineOverlay:
    """Draws pair after pair, in order of time; each image with the motion that the node would choose.

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
        """Draw one pair; pairs must come in order of time."""
        state = self._take_estimates(pair.stamp_ns)
        pictures: dict[Plane, RgbImage] = {}
        choices: list[Choice] = []
        for plane, frame in pair.frames.items():
            self._history.add_image(plane, frame.stamp_ns)
            choice = self._history.choose(plane, frame.stamp_ns)
            choices.append(choice)
            pictures[plane] = self._picture(frame, choice)
        compensated = bool(choices) and all(choice.motion is not None for choice in choices)
        motion = next((choice.motion for choice in choices if choice.motion is not None), None)
        return DrawnPair(pictures, compensated, choices[0].status if choices else "", state, motion)

    def _take_estimates(self, stamp_ns: int) -> str:
        """Take what was published up to a pair; returns the state of that pair, empty where it was not answered."""
        state = ""
        while self._estimates:
            estimate = self._estimates[0]
            near = is_same_pair(estimate.stamp_ns, stamp_ns)
            if estimate.stamp_ns > stamp_ns and not near:
                break
            self._estimates.pop(0)
            # A stamp that was rounded still belongs to its pair.
            at_ns = stamp_ns if near else estimate.stamp_ns
            self._history.add_state(estimate.state)
            state = estimate.state if near else ""
            if estimate.motion is not None:
                self._history.add_motion(at_ns, estimate.motion)
                if estimate.loop is not None:
                    self._history.add_loop(at_ns, estimate.loop)
                if estimate.covariance is not None:
                    self._history.add_covariance(at_ns, estimate.covariance)
        return state

    def _picture(self, frame: Frame, choice: Choice) -> RgbImage:
        static = self._painter.draw_static(frame.pixels, frame.projection) if self._view != "compensated" else None
        if self._view == "static" and static is not None:
            return static
        moved = self._painter.draw(
            frame.pixels,
            frame.projection,
            choice.motion,
            choice.status,
            loop=choice.loop,
            covariance=choice.covariance,
        )
        if static is None:
            return moved
        return beside([static, moved], _GAP_PX)


def video_picture(drawn: DrawnPair, view: OverlayView, cell_px: int, words: str) -> RgbImage:
    """One frame of a video: both planes in cells of one size (below each other where each has two), words under them.

    Over each plane stands its name and what is shown of it, under all that it is for research only: a frame may be
    shown by itself.

    Args:
        drawn: the pair.
        view: as it was drawn.
        cell_px: side of a cell, pixels.
        words: what stands in the strip below, before that.
    """
    columns = 2 if view == "both" else 1
    width, height = columns * cell_px + (columns - 1) * _GAP_PX, cell_px
    shown = {"compensated": "", "static": ": without compensation", "both": ": without, and with compensation"}[view]
    cells = []
    for plane in PLANES:
        name = f"Plane {plane.upper()}"
        if plane in drawn.planes:
            picture = fitted(drawn.planes[plane], width, height)
        else:
            picture = missing_cell(width, height, f"{name}: no image in this pair")
        cells.append(below_each_other([text_strip(f"{name}{shown}", width), picture]))
    grid = below_each_other(cells, _GAP_PX) if view == "both" else beside(cells, _GAP_PX)
    return below_each_other([grid, text_strip(f"{words}   {RESEARCH_ONLY}", grid.shape[1])])
