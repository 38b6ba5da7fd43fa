"""What each plane shows of dark or bright lines, a map for each direction, on the epipolar grid."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.initialisation.laid_image import CELL_MM, LaidImage

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.float32]

DIRECTIONS = 16


@dataclass(frozen=True)
class _Tuning:
    """How lines are seen."""

    sigma_mm: float = 0.4  # 0.5 in all: a wire and an electrode
    along_cells: float = 3.5  # standard deviation of the mean along a line: noise has no direction
    along_steps: tuple[int, ...] = (-6, -4, -2, 0, 2, 4, 6)  # cells
    distinct_quantiles: tuple[float, ...] = (0.999, 0.9999)
    doubtful_brightness: float = 0.3  # of both planes together: with less either polarity may be meant
    noise_window_cells: tuple[int, int] = (41, 41)
    outlier: float = 4.0  # in units of the local rms: what is denser counts no more
    floor: float = 0.5  # of the mean along a line, in units of its rms, that noise shows, too
    ceiling: float = 2.8


TUNING = _Tuning()
_SECOND = np.array([[1.0, -2.0, 1.0]], np.float32)
_MIXED = np.array([[0.25, 0.0, -0.25], [0.0, 0.0, 0.0], [-0.25, 0.0, 0.25]], np.float32)


@dataclass(frozen=True, eq=False)
class DirectionMaps:
    """One plane: a map of its lines for each direction.

    Attributes:
        responses: (DIRECTIONS, H, W) float32 in [0, 1], for a line's tangent at angle k·180°/DIRECTIONS from the
            columns' axis towards the rows'.
        left: of the first column, metres in the grid.
        top: of the first row, metres in the grid.
    """

    responses: Image
    left: float
    top: float

    @cached_property
    def widened(self) -> Image:
        """(DIRECTIONS, H, W) the strongest within a cell."""
        return np.stack([cv2.dilate(one, np.ones((3, 3), np.uint8)) for one in self.responses])

    def at(self, columns: Array, rows: Array, direction: npt.NDArray[np.intp], *, widened: bool = False) -> Image:
        """The responses (...) at columns and rows (...), metres, zero outside.

        Args:
            columns: in the grid.
            rows: likewise.
            direction: from `nearest_direction`, of a shape that broadcasts.
            widened: the strongest within a cell.
        """
        values = self.widened if widened else self.responses
        _, height, width = values.shape
        x = np.rint((columns - self.left) / (1e-3 * CELL_MM)).astype(np.intp)
        y = np.rint((rows - self.top) / (1e-3 * CELL_MM)).astype(np.intp)
        is_inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
        index = (direction * height + np.where(is_inside, y, 0)) * width + np.where(is_inside, x, 0)
        return np.asarray(values.reshape(-1)[index] * is_inside)


def tangents(columns: Array, rows: Array) -> tuple[Array, Array, Array]:
    """(N, P) closed curves' unit tangents along columns and rows, and their lengths from neighbour to neighbour."""
    along, down = (np.roll(one, -1, axis=1) - np.roll(one, 1, axis=1) for one in (columns, rows))
    length = np.maximum(np.hypot(along, down), 1e-12)
    return along / length, down / length, length


def nearest_direction(columns: Array, rows: Array) -> npt.NDArray[np.intp]:
    """(N, P) the direction of the maps that is nearest to closed curves' tangents at points (N, P)."""
    if has_kernels():
        from lasso_motion_ros.initialisation.kernels import directions

        return directions(columns, rows, DIRECTIONS)
    along, down, _ = tangents(columns, rows)
    return np.asarray(np.rint(np.arctan2(down, along) * (DIRECTIONS / np.pi)).astype(np.intp) % DIRECTIONS)


@dataclass(frozen=True, eq=False)
class Curvature:
    """The second derivatives of one plane's grey values or their logarithm, relative to their local root mean square.

    Attributes:
        xx: (H, W) float32 along the grid's columns' axis.
        yy: (H, W) float32 along the rows'.
        xy: (H, W) float32 mixed.
        inside: (H, W) float32, 1 where the image reaches.
        left: of the first column, metres in the grid.
        top: of the first row, metres in the grid.
    """

    xx: Image
    yy: Image
    xy: Image
    inside: Image
    left: float
    top: float

    @property
    def brightness(self) -> float:
        """How far the most distinct bright spots stand out beyond the most distinct dark ones (log of the ratio).

        Of grey values themselves: their logarithm has more dark ones, whichever the electrodes are.
        """
        spots = (self.xx + self.yy)[self.inside > 0.0]
        if not len(spots):
            return 0.0
        dark, bright = (np.quantile(way * spots, TUNING.distinct_quantiles) for way in (1.0, -1.0))
        return float(np.log(np.maximum(bright, 1e-6) / np.maximum(dark, 1e-6)).sum())


def curvature(laid: LaidImage) -> Curvature:
    """The second derivatives of a plane's image on the grid.

    Args:
        laid: the grey values' logarithm, in which attenuation adds up; where dense things are bright the grey values.
    """
    smooth = cv2.GaussianBlur(laid.values, (0, 0), TUNING.sigma_mm / CELL_MM)
    inside = laid.inside
    xx = cv2.filter2D(smooth, cv2.CV_32F, _SECOND)
    yy = cv2.filter2D(smooth, cv2.CV_32F, _SECOND.T)
    xy = cv2.filter2D(smooth, cv2.CV_32F, _MIXED)
    window = TUNING.noise_window_cells
    mean = cv2.blur((xx * xx + yy * yy + 2.0 * xy * xy) * inside, window) / np.maximum(cv2.blur(inside, window), 0.02)
    scale = inside / np.sqrt(np.maximum(0.5 * mean, np.float32(1e-10)))
    xx, yy, xy = (np.asarray(one * scale) for one in (xx, yy, xy))
    return Curvature(xx, yy, xy, inside, laid.left, laid.top)


def are_catheters_bright(seen: Iterable[Curvature], *, other: bool) -> bool:
    """Whether the catheters of both planes' grey values are bright: electrodes stand out more than anything opposite.

    Args:
        seen: of grey values, not of their logarithm.
        other: where that is in doubt, the less likely.
    """
    brightness = sum(one.brightness for one in seen)
    return (brightness > 0.0) is not (other and abs(brightness) < TUNING.doubtful_brightness)


def direction_maps(seen: Curvature, *, bright: bool) -> DirectionMaps:
    """The maps of one plane's lines that are darker, or brighter, than what is behind them."""
    xx, yy, xy = (-one if bright else one for one in (seen.xx, seen.yy, seen.xy))
    height, width = xx.shape
    responses = np.zeros((DIRECTIONS, height, width), np.float32)
    weights = np.exp(-0.5 * (np.array(TUNING.along_steps) / TUNING.along_cells) ** 2)
    weights /= weights.sum()
    turn = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    cosine, sine, steps = np.cos(turn), np.sin(turn), np.array(TUNING.along_steps)
    shares = np.stack([sine**2, cosine**2, -2.0 * sine * cosine], axis=1)  # of the derivatives in that across a line
    right, down = (np.rint(one[:, None] * steps).astype(np.int64) for one in (cosine, sine))
    if has_kernels():
        from lasso_motion_ros.initialisation import kernels

        limits = TUNING.outlier, TUNING.floor, TUNING.ceiling
        kernels.lines(xx, yy, xy, seen.inside, shares, right, down, weights, *limits, responses)
        return DirectionMaps(responses, seen.left, seen.top)
    reach = int(max(TUNING.along_steps))
    # One array within a margin of nothing for all directions, and sums that are made in place.
    padded = np.zeros((height + 2 * reach, width + 2 * reach), np.float32)
    inner = padded[reach : reach + height, reach : reach + width]
    for k, response in enumerate(responses):
        of_xx, of_yy, of_xy = shares[k].tolist()
        across = cv2.scaleAdd(xy, of_xy, cv2.addWeighted(xx, of_xx, yy, of_yy, 0.0))
        np.clip(across, -TUNING.outlier, TUNING.outlier, out=inner)
        for x, y, weight in zip(right[k] + reach, down[k] + reach, weights.tolist(), strict=True):
            cv2.scaleAdd(padded[y : y + height, x : x + width], weight, response, response)
    power = cv2.norm(responses.reshape(DIRECTIONS, -1), cv2.NORM_L2SQR)
    rms = float(np.sqrt(power / max(DIRECTIONS * float(seen.inside.sum()), 1.0)))
    responses *= seen.inside / np.float32(max(rms, 1e-6))
    responses -= np.float32(TUNING.floor)
    responses *= np.float32(1.0 / (TUNING.ceiling - TUNING.floor))
    np.clip(responses, 0.0, 1.0, out=responses)
    return DirectionMaps(responses, seen.left, seen.top)
