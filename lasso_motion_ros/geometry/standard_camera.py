"""The plain camera that other tools can draw with: focal lengths, principal point, a rigid pose, no mirror, no skew.

A projection P = K [R | t] of an X-ray display may be mirrored (K[0, 0] < 0) or skewed; tools that know a camera by
K and its pose alone take neither. Such an image is flipped, or resampled. A display that is turned needs nothing: its
turn goes into R.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias, cast

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.projection import Projection

Array = npt.NDArray[np.float64]
Pixels: TypeAlias = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]

NEGLIGIBLE_SKEW_PX = 0.05
"""A skew that moves no pixel by more than this is left out instead of resampled away."""


@dataclass(frozen=True, eq=False)
class StandardCamera:
    """A pinhole camera and the way from the display's pixels to its own.

    Attributes:
        k: (3, 3) camera matrix: k[0, 0] and k[1, 1] positive, no skew, k[2, 2] = 1.
        pose: (4, 4) T with x_camera = T · x_world, metres; the camera looks along +z, +x right, +y down.
        mirrored: the display's columns are the other way round.
        to_standard: (3, 3) from the display's pixels to this camera's.
        resampled: the display is skewed: its pixels are interpolated.
    """

    k: Array
    pose: Array
    mirrored: bool
    to_standard: Array
    resampled: bool

    def image(self, pixels: Pixels) -> Pixels:
        """The film (H, W) as this camera sees it, of the same size and type."""
        if self.resampled:
            size = pixels.shape[::-1]
            return cast(
                Pixels,
                cv2.warpPerspective(
                    pixels, self.to_standard, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
                ),
            )
        return cast(Pixels, np.ascontiguousarray(pixels[:, ::-1])) if self.mirrored else pixels


def standard_camera(projection: Projection) -> StandardCamera:
    """The plain camera of a projection of any scale and sign (RQ decomposition, Hartley and Zisserman 6.2.4)."""
    camera, rotation, translation = projection.decompose()
    mirrored = bool(camera[0, 0] < 0.0)
    flip = np.eye(3)
    if mirrored:
        flip[0] = [-1.0, 0.0, projection.width - 1.0]
    upright = flip @ camera
    k = upright.copy()
    k[0, 1] = 0.0
    resampled = bool(abs(upright[0, 1] / upright[1, 1]) * projection.height > NEGLIGIBLE_SKEW_PX)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, translation
    to_standard = k @ np.linalg.inv(upright) @ flip if resampled else flip
    return StandardCamera(k, pose, mirrored, np.asarray(to_standard), resampled)
