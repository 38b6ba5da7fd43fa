"""Grey values for the eye: any bit depth stretched to 8 bits."""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

GreyImage = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]
RgbImage = npt.NDArray[np.uint8]

_SHARE_CLIPPED = 0.005
_SAMPLES = 65_536


def window_limits(image: GreyImage) -> tuple[float, float]:
    """Darkest and brightest value to show: all but half a percent at either end.

    Args:
        image: (H, W) uint8 or uint16.
    """
    # A regular subset gives the same percentiles in a hundredth of the time.
    step = max(1, int(np.sqrt(image.size / _SAMPLES)))
    counted = np.bincount(image[::step, ::step].ravel()).cumsum()
    low, high = (_quantile(counted, share) for share in (_SHARE_CLIPPED, 1.0 - _SHARE_CLIPPED))
    return low, max(high, low + 1.0)


def _quantile(counted: npt.NDArray[np.int64], share: float) -> float:
    """A quantile of whole values from how many are not above 0, 1, 2, …, between neighbours as `np.quantile` does."""
    place = share * (int(counted[-1]) - 1)
    before = int(place)
    low, high = np.searchsorted(counted, (before, before + 1), side="right").tolist()
    return float(low + (place - before) * (high - low))


def window_image(image: GreyImage, limits: tuple[float, float] | None = None) -> npt.NDArray[np.uint8]:
    """(H, W) uint8: the values between the limits stretched over black to white, those beyond clipped.

    Args:
        image: (H, W) uint8 or uint16 of any used depth (8, 10, 12, 16 bits).
        limits: values shown black and white; by default `window_limits` of this image.
    """
    low, high = window_limits(image) if limits is None else limits
    scale = 255.0 / (high - low)
    # Nothing below black, which convertScaleAbs would fold up.
    bounded = cv2.max(image, math.ceil(low)) if low > 0.0 else image
    return np.asarray(cv2.convertScaleAbs(bounded, alpha=scale, beta=-low * scale), dtype=np.uint8)


def grey_to_rgb(grey: npt.NDArray[np.uint8]) -> RgbImage:
    """(H, W) uint8 to (H, W, 3) uint8."""
    return np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2RGB), dtype=np.uint8)
