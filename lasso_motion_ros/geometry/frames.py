"""What goes into the tracker: one plane's image with its geometry, a biplane pair, a user's clicks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, Literal, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.projection import Projection

Plane = Literal["a", "b"]
PLANES: tuple[Plane, Plane] = ("a", "b")

Item = TypeVar("Item")


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
    """An image without a projection: good for display only.

    Attributes:
        stamp_ns: time of exposure, nanoseconds.
        pixels: (H, W) uint8 or uint16 in native byte order, as published.
    """

    stamp_ns: int
    pixels: npt.NDArray[np.uint8] | npt.NDArray[np.uint16]


@dataclass(frozen=True, eq=False)
class Pair(Generic[Item]):
    """What plane A and plane B have of one instant; either may be missing.

    Pairing is decided by stamps alone, so the item may be less than a `Frame`: a stamp, or an image whose calibration
    has not come yet.

    Attributes:
        stamp_ns: the pair's time: plane A's exposure (or what it would have been, if A is missing).
        a: plane A's item, or None.
        b: plane B's item, or None.
        new_run: the first pair after both planes' stamps went back.
        r_peaks_ns: stamps of the ECG's R peaks that were known when the pair was complete, ascending, as many as are
            remembered; empty where there is no ECG.
    """

    stamp_ns: int
    a: Item | None
    b: Item | None
    new_run: bool = False
    r_peaks_ns: tuple[int, ...] = ()

    def frame(self, plane: Plane) -> Item | None:
        """One plane's item, or None where it is missing."""
        return self.a if plane == "a" else self.b

    @property
    def frames(self) -> dict[Plane, Item]:
        """The items that are there, plane A's first."""
        return {plane: frame for plane in PLANES if (frame := self.frame(plane)) is not None}

    @property
    def missing(self) -> tuple[Plane, ...]:
        """The planes whose item is not there."""
        return tuple(plane for plane in PLANES if self.frame(plane) is None)

    @property
    def is_whole(self) -> bool:
        """Whether both planes are there."""
        return self.a is not None and self.b is not None


FramePair: TypeAlias = Pair[Frame]
"""A pair of X-ray images: what the tracker takes."""


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
