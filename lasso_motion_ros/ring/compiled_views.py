"""`LoopViews` by the compiled kernels: the same attributes and results, in a fifth of the time."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.curves import SMALLEST_SPACING
from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.ring.kernels import alignment as kernels
from lasso_motion_ros.ring.loop_views import TUNING, LoopViews
from lasso_motion_ros.ring.template import RingTemplate
from lasso_motion_ros.ring.working_image import PIXEL_MM, WorkingImage

Array = npt.NDArray[np.float64]


class CompiledLoopViews(LoopViews):
    """See `LoopViews`."""

    def __init__(self, planes: dict[Plane, WorkingImage], template: RingTemplate, centres: Array) -> None:
        super().__init__(planes, template, centres)
        count, shape = len(planes), template.values.shape
        self._steps, self._gains = np.empty(count), np.empty(count)
        self._noise: Array = np.empty(count)
        self._pixels, self._tangents = np.empty((2, count, shape[0], 2))
        self._spacing, self._depth = np.empty((2, count, shape[0]))
        self._samples, self._weights = np.empty((2, count, *shape), dtype=np.float32)
        self._moves = np.empty((count, shape[0], 2, 6))
        size = 2 * count + 4
        self._normal, self._scores = np.empty((size, size)), np.empty((size, count, shape[0]))
        self._projections = np.array([image.projection.matrix for image in planes.values()])

    def look(self, arms: Array) -> None:
        """See `LoopViews.look`."""
        self._arms, self._correlation_before = arms, self.correlation
        self.correlation = np.empty(len(self._images))
        for p, image in enumerate(self._images):
            self._steps[p], self._gains[p], self._noise[p], self.correlation[p] = kernels.look(
                image.values,
                self._projections[p],
                self.centres[p],
                arms,
                self._pattern,
                1e-3 * PIXEL_MM * self._focal_px[p],
                SMALLEST_SPACING,
                TUNING.largest_spacing_px,
                TUNING.outlier_sigmas,
                self._pixels[p],
                self._tangents[p],
                self._spacing[p],
                self._depth[p],
                self._samples[p],
                self._weights[p],
            )

    def equations(self, *, renew: bool) -> tuple[Array, Array]:
        """See `LoopViews.equations`; the matrix is overwritten by the next call."""
        if renew:
            kernels.derivative(
                self._pixels,
                self._tangents,
                self._spacing,
                self._depth,
                self._steps,
                self._projections,
                self._across,
                self._arms,
                self._moves,
            )
        along, sideways = self._slopes[:, 0]
        kernels.equations(
            self._pattern,
            along,
            sideways,
            self._samples,
            self._weights,
            self._gains,
            self._noise,
            self._moves,
            TUNING.noise_correlation,
            self._normal,
            self._scores,
        )
        return self._normal, self._scores.sum(axis=(1, 2))

    def _seen(self) -> tuple[Array, Array]:
        planes = zip(self._samples, self._weights, self._gains, strict=True)
        seen = [
            kernels.seen(
                samples,
                weights,
                self._pattern,
                self._slopes[1, 0],
                gain,
                TUNING.segments,
                TUNING.segment_gain,
            )
            for samples, weights, gain in planes
        ]
        visible, beside = np.array(seen).T
        return visible, beside
