"""A plane's image laid out on the epipolar grid: where, how finely, and which part of the grid it reaches."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.frames import Frame, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid
from lasso_motion_ros.ring.working_image import reduction_factor

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.float32]

CELL_MM = 0.5
CELL_M = 1e-3 * CELL_MM
SMOOTHED_MM = 0.3  # standard deviation that a laid image has been smoothed by


@dataclass(frozen=True)
class _Tuning:
    """How much of an image is laid out."""

    margin_px: int = 8  # of the image, where its edge would be a line
    widest_mm: float = 200.0


TUNING = _Tuning()


@dataclass(frozen=True, eq=False)
class LaidImage:
    """One plane's grey values, or their logarithm, on the grid.

    Attributes:
        values: (H, W) float32, smoothed by `SMOOTHED_MM`.
        inside: (H, W) float32, 1 where the image reaches.
        left: of the first column, metres in the grid.
        top: of the first row, metres in the grid.
    """

    values: Image
    inside: Image
    left: float
    top: float

    @classmethod
    def of(
        cls, frame: Frame, plane: Plane, grid: EpipolarGrid, rows: tuple[float, float], *, logarithm: bool
    ) -> LaidImage:
        """A frame between two rows, metres.

        Args:
            frame: the image.
            plane: whose it is.
            grid: on which it is laid out.
            rows: the first and the last.
            logarithm: of the grey values' logarithm, in which attenuation adds up.
        """
        columns = _column_range(frame, plane, grid)
        xs = np.arange(columns[0], columns[1], CELL_MM * 1e-3)
        hs = np.arange(rows[0], rows[1], CELL_MM * 1e-3)
        grey, projection = reduced(frame, grid.centre)
        values = grey.astype(np.float32)
        if logarithm:
            values = cv2.log(np.maximum(values, np.float32(1.0)))
        smooth = cv2.GaussianBlur(values, (0, 0), SMOOTHED_MM / projection.millimetres_per_pixel(grid.centre))
        at, inside = _places(projection, plane, grid, xs, hs)
        laid = cv2.remap(smooth, at, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return cls(np.asarray(laid, np.float32), inside, float(xs[0]), float(hs[0]))


def _places(projection: Projection, plane: Plane, grid: EpipolarGrid, xs: Array, hs: Array) -> tuple[Image, Image]:
    """Where an image shows the grid's columns (W,) and rows (H,): (H, W, 2) pixels, and (H, W) 1 where it reaches."""
    width, height, margin = projection.width, projection.height, TUNING.margin_px
    if has_kernels():
        from lasso_motion_ros.initialisation import kernels

        at, inside = np.empty((len(hs), len(xs), 2), np.float32), np.empty((len(hs), len(xs)), np.float32)
        aside, up = grid.columns(plane, xs)
        kernels.laid_places(np.array(projection.matrix), aside, up, hs, margin, width, height, at, inside)
        return at, inside
    at = projection.project(grid.points(plane, xs, hs)).astype(np.float32)
    is_inside = (at > margin) & (at < np.array([width, height]) - margin - 1)
    return at, np.asarray(is_inside.all(axis=2), np.float32)


def reduced(frame: Frame, centre: Array) -> tuple[npt.NDArray[np.uint8 | np.uint16], Projection]:
    """A frame's pixels at about the working image's size, and the projection to those.

    Args:
        frame: the image.
        centre: (3,) the world point at which it is as fine as that.
    """
    factor = reduction_factor(frame.projection, centre)
    projection = frame.projection.binned(factor, factor)
    grey = frame.pixels[: projection.height * factor, : projection.width * factor]
    if factor > 1:
        grey = np.asarray(cv2.resize(grey, (projection.width, projection.height), interpolation=cv2.INTER_AREA))
    return grey, projection


def row_range(frames: Mapping[Plane, Frame], grid: EpipolarGrid) -> tuple[float, float]:
    """Heights, metres, that both planes show."""
    low, high = -0.5e-3 * TUNING.widest_mm, 0.5e-3 * TUNING.widest_mm
    for frame in frames.values():
        heights = _ray_heights(frame, grid)
        low, high = max(low, float(heights.min())), min(high, float(heights.max()))
    return low, high


def _corner_rays(frame: Frame) -> Array:
    w, h = frame.projection.width - 1.0, frame.projection.height - 1.0
    corners = np.array([[x, y] for x in (0.0, w / 2, w) for y in (0.0, h / 2, h)])
    return frame.projection.rays(corners)


def _ray_heights(frame: Frame, grid: EpipolarGrid) -> Array:
    rays = _corner_rays(frame)
    return np.asarray(grid.lever * (rays @ grid.upward) / (rays @ grid.outward))


def _column_range(frame: Frame, plane: Plane, grid: EpipolarGrid) -> tuple[float, float]:
    rays = _corner_rays(frame)
    distance = np.linalg.norm(grid.centre - grid.sources[plane])
    columns = distance * (rays @ grid.sideways[plane]) / (rays @ grid.view[plane])
    most = 0.5e-3 * TUNING.widest_mm
    return max(-most, float(columns.min())), min(most, float(columns.max()))
