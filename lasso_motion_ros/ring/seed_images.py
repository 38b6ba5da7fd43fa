"""The clicked pair as the curves that are tried on it need it: each plane filtered once, for all of them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import FramePair, Plane
from lasso_motion_ros.ring.working_image import WholeImages, WorkingImage
from lasso_motion_ros.seeding.outlines import require_both_planes

Array = npt.NDArray[np.float64]

_SIMULTANEOUS_NS = 4_000_000  # exposures closer than this show the same phase


class SeedImages:
    """Both planes of a clicked pair, for one polarity of the catheter.

    Args:
        pair: the clicked images.
        bright: whether the catheter is brighter than its background.
        whole: the pair's working images, where others ask for them, too.

    Attributes:
        frames: per plane, as clicked.
        projections: theirs.
        bright: as given.
        share_of_a: what plane A's images take of a shift between the planes: half, or none where plane B is exposed
            later.

    Raises:
        SeedError: a plane is missing.
    """

    def __init__(self, pair: FramePair, *, bright: bool, whole: WholeImages | None = None) -> None:
        self.projections, self.frames, self.bright = require_both_planes(pair), pair.frames, bright
        apart_ns = abs(self.frames["b"].stamp_ns - self.frames["a"].stamp_ns)
        self.share_of_a = 0.5 if apart_ns < _SIMULTANEOUS_NS else 0.0
        self._whole = whole or WholeImages(self.frames)

    def working(self, centre: Array, shifts: dict[Plane, Array]) -> dict[Plane, WorkingImage]:
        """Per plane, the working image for a loop about a centre (3,) m and shifts (2,) px of the planes."""
        return {plane: self._whole.at(plane, centre, shifts[plane], bright=self.bright) for plane in self.frames}
