"""Gaussian blurs of a few fixed widths, compiled: see `core/compiled.py`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Image = npt.NDArray[np.float32]
Blur = Callable[[Image, Image], Image]


def _blur(reach: int) -> Blur:
    """A blur by so many taps on either side: known when it is compiled, their number makes one expression of them."""

    @compiled("float32[:, ::1](float32[:, ::1], Array(float32, 1, 'C', readonly=True))")
    def blurred(values: Image, taps: Image) -> Image:
        """Blur along rows and columns, as `cv2.GaussianBlur`: mirrored in the pixels at the border.

        Args:
            values: (h, w), both larger than the reach.
            taps: (reach + 1,) from the middle one on; the others are the same.

        Returns:
            (h, w).
        """
        height, width = values.shape
        made, line = np.empty_like(values), np.empty(width + 2 * reach, np.float32)
        for i in range(height):
            for j in range(width):
                total = taps[0] * values[i, j]
                for k in range(1, reach + 1):
                    total += taps[k] * (values[abs(i - k), j] + values[height - 1 - abs(height - 1 - k - i), j])
                line[j + reach] = total
            for k in range(1, reach + 1):
                line[reach - k], line[reach + width - 1 + k] = line[reach + k], line[reach + width - 1 - k]
            for j in range(width):
                total = taps[0] * line[j + reach]
                for k in range(1, reach + 1):
                    total += taps[k] * (line[j + reach - k] + line[j + reach + k])
                made[i, j] = total
        return made

    return blurred


BY_REACH: dict[int, Blur] = {reach: _blur(reach) for reach in (4, 5, 8)}
