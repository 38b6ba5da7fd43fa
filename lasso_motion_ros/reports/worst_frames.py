"""Pictures of the pairs with the largest errors: both planes, with the true centreline and the model drawn in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.evaluation.measures import PairEstimate, PairScore, PairTruth
from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane
from lasso_motion_ros.overlay.primitives import (
    Colour,
    draw_curve,
    draw_legend,
)
from lasso_motion_ros.overlay.windowing import GreyImage, RgbImage, grey_to_rgb, window_image
from lasso_motion_ros.reports.picture_grid import below_each_other, beside, missing_cell, text_strip

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How a pair is cut out.

    Attributes:
        cell_px: side of one plane's picture.
        margin: side of the cut-out, as a multiple of the curves' extent.
        smallest_share: smallest side of the cut-out, as a share of the image's.
    """

    cell_px: int = 480
    margin: float = 1.6
    smallest_share: float = 0.22


TUNING = _Tuning()

TRUE_COLOUR: Colour = (96, 190, 255)
MODEL_COLOUR: Colour = (255, 176, 0)
_STRIP_PX = 30


@dataclass(frozen=True, eq=False)
class WorstFrame:
    """A pair to be shown.

    Attributes:
        score: its measures.
        picture: (H, W, 3) uint8 RGB.
    """

    score: PairScore
    picture: RgbImage


def error_mm(score: PairScore) -> float | None:
    """How far off a published pose is: of the loop's centre in space, else the larger 2-D error; None without a pose.

    A pose published while there is no lasso in its place counts too, by its distance from the atrium's motion.
    """
    if not score.has_pose or score.is_reference:
        return None
    if score.centre_m is not None and score.true_centre_m is not None:
        return 1e3 * float(np.linalg.norm(score.centre_m - score.true_centre_m))
    return max(score.error_2d_mm.values(), default=None)


def worst_pairs(scores: Sequence[PairScore], count: int) -> list[PairScore]:
    """The pairs with the largest errors, false poses before all others, the worst first."""
    known = [(score.false_pose, error, score) for score in scores if (error := error_mm(score)) is not None]
    known.sort(key=lambda one: (one[0], one[1]), reverse=True)
    return [score for *_, score in known[:count]]


def worst_picture(pair: FramePair, truth: PairTruth, estimate: PairEstimate | None) -> RgbImage:
    """Both planes of a pair beside each other, cut out about the loop.

    Args:
        pair: the images.
        truth: the true centrelines, at plane A's exposure.
        estimate: what was published, or None.

    Returns:
        (H, W, 3) uint8 RGB.
    """
    loop = None if estimate is None or estimate.motion_raw is None else estimate.loop
    cells = [_cell(pair, plane, truth.centrelines.get(plane), loop) for plane in PLANES]
    return beside(cells, gap_px=6, shade=255)


def _cell(pair: FramePair, plane: Plane, centreline: Array | None, loop: Array | None) -> RgbImage:
    frame = pair.frame(plane)
    if frame is None:
        picture = missing_cell(TUNING.cell_px, TUNING.cell_px, "no image in this pair")
        return below_each_other([_strip(f"Plane {plane.upper()}"), picture])
    model = None if loop is None else frame.projection.project(loop)
    curves = [curve for curve in (centreline, model) if curve is not None and np.isfinite(curve).all()]
    (left, top), side = _window(curves, frame.pixels.shape[1], frame.pixels.shape[0])
    scale = TUNING.cell_px / side
    # Pixel centres are at integers, in the picture that is cut out as in the one that is scaled.
    change = np.array([[scale, 0.0, scale * (0.5 - left) - 0.5], [0.0, scale, scale * (0.5 - top) - 0.5]])
    cut: GreyImage = cv2.warpAffine(
        frame.pixels, change, (TUNING.cell_px, TUNING.cell_px), flags=cv2.INTER_LINEAR, borderValue=0
    )
    # Windowed after cutting out: bright lung elsewhere would leave the loop's surroundings dark.
    picture = grey_to_rgb(window_image(cut))
    legend = []
    for curve, colour, name in ((centreline, TRUE_COLOUR, "truth"), (model, MODEL_COLOUR, "model")):
        if curve is not None:
            draw_curve(picture, curve @ change[:, :2].T + change[:, 2], colour, width=1)
            legend.append((name, colour))
    draw_legend(picture, legend)
    words = f"Plane {plane.upper()}"
    if centreline is None:
        words += ": no true centreline here"
    if model is None:
        words += ": no model"
    return below_each_other([_strip(words), picture])


def _strip(words: str) -> RgbImage:
    return text_strip(words, TUNING.cell_px, height=_STRIP_PX, at=(10, 20), scale=0.5)


def _window(curves: Sequence[Array], width: int, height: int) -> tuple[Array, float]:
    """Upper left corner and side, in pixels, of the square that is shown: about the curves, with a margin."""
    least = TUNING.smallest_share * max(width, height)
    inside = [np.clip(curve, 0.0, [width - 1.0, height - 1.0]) for curve in curves]
    if not inside:
        side = float(max(width, height))
        return np.array([0.0, 0.0]), side
    points = np.concatenate(inside)
    low, high = points.min(axis=0), points.max(axis=0)
    side = float(min(max(TUNING.margin * (high - low).max(), least), max(width, height)))
    corner = (low + high) / 2.0 - side / 2.0
    return np.clip(corner, 0.0, np.maximum([width - side, height - side], 0.0)), side
