"""What goes into the tracker: one plane's image with its geometry, a biplane pair, a user's clicks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.projection import Projection

Plane = Literal["a", "b"]
PLANES: tuple[Plane, Plane] = ("a", "b")


@dataclass(frozen=True, eq=False)
class Frame:
    """One X-ray image of one plane.

    Attributes:
        stamp_ns: time of exposure, nanoseconds.
        pixels: (H, W) uint8 or uint16 in native byte order, as published.
        projection: world metres to *this image's* pixels (binning and ROI already applied).
    """

    stamp_ns: int
    pixels: npt.NDArray[np.uint8] | npt.NDArray[np.uint16]
    projection: Projection


@dataclass(frozen=True, eq=False)
class UncalibratedFrame:
    """An image of which it is not known where it looks: to be shown only.

    Attributes:
        stamp_ns: time of exposure, nanoseconds.
        pixels: (H, W) uint8 or uint16 in native byte order, as published.
    """

    stamp_ns: int
    pixels: npt.NDArray[np.uint8] | npt.NDArray[np.uint16]


@dataclass(frozen=True, eq=False)
class FramePair:
    """Plane A's frame and the plane B frame that belongs to it; either may be missing.

    Attributes:
        stamp_ns: the pair's time: plane A's exposure (or what it would have been, if A is missing).
        a: plane A's frame, or None.
        b: plane B's frame, or None.
    """

    stamp_ns: int
    a: Frame | None
    b: Frame | None

    def frame(self, plane: Plane) -> Frame | None:
        """The frame of one plane, or None where it is missing."""
        return self.a if plane == "a" else self.b


@dataclass(frozen=True, eq=False)
class Seed:
    """A user's clicks, in order along the loop, in both planes of one pair.

    Attributes:
        points_a: (N, 2) float64 pixel coordinates (x right, y down) in plane A's image.
        points_b: (M, 2) float64 likewise in plane B's image.
    """

    points_a: npt.NDArray[np.float64]
    points_b: npt.NDArray[np.float64]

    def points(self, plane: Plane) -> npt.NDArray[np.float64]:
        """The clicks of one plane, (N, 2) pixels."""
        return self.points_a if plane == "a" else self.points_b
