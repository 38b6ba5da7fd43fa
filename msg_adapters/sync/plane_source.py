"""What is known of the source of a plane's pictures: where in them the X-ray field is, how late their stamps are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.stream import PlaneConfig
from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.geometry.projection import Projection
from msg_adapters.crop import Crop

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class PlaneSource:
    """Between what is published and what is tracked: the crop's pixels, and the exposure's time.

    Attributes:
        crop: the X-ray field in the published picture; None: all of it.
        stamp_offset_ns: by how much the stamps are later than the exposures, nanoseconds.
    """

    crop: Crop | None = None
    stamp_offset_ns: int = 0

    def exposure_ns(self, stamp_ns: int) -> int:
        """The exposure's time, by a published stamp; 0, which is none, stays 0."""
        return stamp_ns - self.stamp_offset_ns if stamp_ns else 0

    def published_ns(self, exposure_ns: int) -> int:
        """The inverse of `exposure_ns`."""
        return exposure_ns + self.stamp_offset_ns if exposure_ns else 0

    def in_crop(self, points: Array) -> Array:
        """Pixels (N, 2) of the published picture, as pixels of its crop."""
        return points if self.crop is None else points - self.crop.origin

    def in_picture(self, points: Array) -> Array:
        """The inverse of `in_crop`."""
        return points if self.crop is None else points + self.crop.origin

    def projection(self, published: Projection, picture: tuple[int, int]) -> Projection:
        """The projection to the crop's pixels.

        A calibration may be of the whole picture or of the X-ray field alone; its size says of which.

        Args:
            published: as the CameraInfo has it.
            picture: (height, width) of the published picture.
        """
        if self.crop is None or (published.height, published.width) != picture:
            return published
        return published.cropped(self.crop.x, self.crop.y, self.crop.width, self.crop.height)

    def picture_projection(self, published: Projection, picture: tuple[int, int]) -> Projection:
        """The projection to the published picture's pixels, in which clicks are; the arguments as for `projection`."""
        if self.crop is None or (published.height, published.width) == picture:
            return published
        return published.cropped(-self.crop.x, -self.crop.y, picture[1], picture[0])


def plane_sources(config: Any) -> Mapping[Plane, PlaneSource]:
    """The sources of both planes, by the parameters `plane_a.…` and `plane_b.…`.

    Args:
        config: a configuration with the groups `plane_a` and `plane_b`.

    Raises:
        ConfigurationError: a crop that is none.
    """
    groups: dict[Plane, PlaneConfig] = {"a": config.plane_a, "b": config.plane_b}
    return {
        plane: PlaneSource(Crop.parse(group.crop, f"plane_{plane}.crop"), round(group.stamp_offset_s * 1e9))
        for plane, group in groups.items()
    }
