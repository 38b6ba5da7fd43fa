"""One plane's image, and where the ring may be in it: by its template, also in other sizes, and by its electrodes."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import Frame
from lasso_motion_ros.geometry.transforms import rotation_from_vector
from lasso_motion_ros.ring.search import Peaks, find_electrodes, find_peaks
from lasso_motion_ros.ring.template import RingTemplate
from lasso_motion_ros.ring.working_image import WorkingImage

Array = npt.NDArray[np.float64]


class PlaneSearch:
    """Looks for the ring in one image; what has been found is kept, so that it may be asked for ahead.

    Args:
        frame: of which the image is.
        image: all of it, or the surroundings of where the ring is expected.
        arms: (L, 3) the ring about its centre at the seed pair, metres.
        template: what it looks like, at present.
        centre: (3,) where its centre is expected, world metres.
        reach_mm: how far from there it may be.
        is_near: whether by its template it is looked for no further away, or everywhere.
    """

    def __init__(
        self,
        frame: Frame,
        image: WorkingImage,
        arms: Array,
        template: RingTemplate,
        centre: Array,
        reach_mm: float,
        *,
        is_near: bool,
    ) -> None:
        self.image = image
        self._arms, self._values, self._weights = arms, template.values, template.weights
        self._frame, self._centre, self._reach_mm, self._is_near = frame, centre, reach_mm, is_near
        self._sized: dict[float, Peaks] = {}
        self._turn, self._stretch = np.full(3, np.nan), np.nan  # with which electrodes were looked for
        self._electrodes: Peaks | None = None

    def is_of(self, frame: Frame, template: RingTemplate, centre: Array, reach_mm: float, *, is_near: bool) -> bool:
        """Whether the very same would be worked out of these."""
        is_same = frame is self._frame and template.values is self._values and template.weights is self._weights
        is_there = reach_mm == self._reach_mm and np.array_equal(centre, self._centre)
        return is_same and is_there and is_near is self._is_near

    @cached_property
    def by_template(self) -> Peaks:
        """Where the template fits."""
        reach_mm = self._reach_mm if self._is_near else None
        return find_peaks(self.image, self._values, self._centre, self._arms, reach_mm)

    def by_size(self, stretch: float) -> Peaks:
        """Where it fits within reach on a ring of another size, given as its logarithm."""
        if stretch not in self._sized:
            arms = self._arms * np.exp(stretch)
            self._sized[stretch] = find_peaks(self.image, self._values, self._centre, arms, self._reach_mm)
        return self._sized[stretch]

    def by_electrodes(self, turn: Array, stretch: float) -> Peaks:
        """Where electrodes like the ring's are within reach; it is turned (3,) rad and stretched so far."""
        is_known = stretch == self._stretch and np.array_equal(turn, self._turn)
        if self._electrodes is None or not is_known:
            ring = self._arms @ rotation_from_vector(turn).T * np.exp(stretch)
            self._turn, self._stretch = turn, stretch
            self._electrodes = find_electrodes(self.image, self._weights, self._centre, ring, self._reach_mm)
        return self._electrodes
