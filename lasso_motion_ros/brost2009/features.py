"""Feature image of the published method: ROI, equalisation, Sato, Otsu, distance map."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.brost2009 import REFERENCE_WIDTH_PX, FeatureConfig
from lasso_motion_ros.geometry.frames import Frame
from lasso_motion_ros.seeding.line_filter import sato

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """What keeps the features defined on small images and faint ones.

    Attributes:
        smallest_roi_px: side of the region of interest, pixels of this image.
        smallest_sigma_px: scale of the line filter, pixels of this image; below it the sampled kernel is no Gaussian.
        faintest_response: grey levels; a line response below it is rounding of 8 bits.
        quantile_step: every so many rows and columns serve to estimate the response's quantile.
    """

    smallest_roi_px: int = 32
    smallest_sigma_px: float = 0.7
    faintest_response: float = 0.1
    quantile_step: int = 4


TUNING = _Tuning()


@dataclass(frozen=True, eq=False)
class DistanceMap:
    """Distance to the nearest line pixel, over a region of interest.

    Attributes:
        values: (h, w) float32, pixels.
        origin: (2,) column and row of the region's first pixel in the full image.
    """

    values: npt.NDArray[np.float32]
    origin: tuple[int, int]

    def sample(self, points: Array | npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Bilinear values at full-image pixels (..., 2); outside the region, those at its edge."""
        local = np.asarray(points, dtype=np.float32) - np.asarray(self.origin, dtype=np.float32)
        flat = local.reshape(-1, 1, 2) if local.ndim == 2 else local.reshape(-1, local.shape[-2], 2)
        # remap addresses at most 32767 rows and columns of its target.
        sampled = [
            cv2.remap(self.values, part, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            for part in np.array_split(flat, -(-len(flat) // 32000))
        ]
        return np.concatenate(sampled).reshape(points.shape[:-1])


def region_of_interest(shape: tuple[int, int], centre: Array, side: int) -> tuple[slice, slice]:
    """Rows and columns of a square of `side` pixels about `centre` (x, y), shifted to lie inside the image."""
    slices = []
    for size, middle in zip(shape, (centre[1], centre[0]), strict=True):
        length = min(side, size)
        first = int(np.clip(round(float(middle)) - length // 2, 0, size - length))
        slices.append(slice(first, first + length))
    return slices[0], slices[1]


def equalise(image: npt.NDArray[np.uint8] | npt.NDArray[np.uint16]) -> npt.NDArray[np.uint8]:
    """Histogram equalisation to 8 bits; deeper images keep their full depth up to the mapping."""
    if image.dtype == np.uint8:
        return np.asarray(cv2.equalizeHist(image), dtype=np.uint8)
    counts = np.bincount(image.ravel(), minlength=int(image.max()) + 1)
    cumulative = np.cumsum(counts)
    first = int(cumulative[np.flatnonzero(counts)[0]])
    scale = 255.0 / max(int(cumulative[-1]) - first, 1)
    table = np.clip(np.rint((cumulative - first) * scale), 0, 255).astype(np.uint8)
    return np.asarray(table[image])


def line_mask(response: npt.NDArray[np.float32], clipped_share: float = 0.0) -> npt.NDArray[np.uint8]:
    """Otsu's threshold (1979) on a line response, in 256 grey levels: 255 on lines, 0 elsewhere.

    Args:
        response: (H, W) response, ≥ 0.
        clipped_share: share of the pixels that are clipped to the brightest grey level.
    """
    if clipped_share > 0.0:
        step = TUNING.quantile_step
        ceiling = float(np.quantile(response[::step, ::step], 1.0 - clipped_share))
    else:
        ceiling = float(response.max())
    grey = np.clip(response * (255.0 / max(ceiling, TUNING.faintest_response)), 0, 255).astype(np.uint8)
    _, mask = cv2.threshold(grey, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    return np.asarray(mask, dtype=np.uint8)


def distance_map(frame: Frame, centre: Array, config: FeatureConfig, *, bright: bool) -> DistanceMap:
    """Distance to the nearest line about a point: ROI → equalisation → Sato → Otsu → distance transform.

    Args:
        frame: the image; its projection tells the detector's width, with which the configured pixels scale.
        centre: (2,) middle of the region, pixels.
        config: sizes in pixels of a 1024-pixel-wide detector.
        bright: True where the catheter is brighter than its background.
    """
    scale = frame.projection.detector_width / REFERENCE_WIDTH_PX
    side = max(TUNING.smallest_roi_px, round(config.roi_px * scale))
    rows, columns = region_of_interest(frame.pixels.shape, centre, side)
    equalised = equalise(frame.pixels[rows, columns].copy())
    sigmas = np.geomspace(config.sigma_min_px, config.sigma_max_px, config.scales) * scale
    response = sato(cv2.bitwise_not(equalised) if bright else equalised, np.maximum(sigmas, TUNING.smallest_sigma_px))
    mask = line_mask(response, config.clipped_share)
    method = cv2.DIST_MASK_PRECISE if config.distance == "exact" else cv2.DIST_MASK_5
    values = cv2.distanceTransform(cv2.bitwise_not(mask), cv2.DIST_L2, method)
    if not mask.any():  # no line at all, for which OpenCV's distance is the largest float
        values[:] = sum(mask.shape)
    return DistanceMap(np.asarray(values, dtype=np.float32), (columns.start, rows.start))
