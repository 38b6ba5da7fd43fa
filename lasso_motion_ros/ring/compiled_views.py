"""`LoopViews` by the compiled kernels: the same attributes and results, in a fifth of the time."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.curves import SMALLEST_SPACING
from lasso_motion_ros.ring.gauss_newton import TUNING, Descent
from lasso_motion_ros.ring.kernels import alignment as kernels
from lasso_motion_ros.ring.loop_views import TUNING as SAMPLING
from lasso_motion_ros.ring.loop_views import LoopViews
from lasso_motion_ros.ring.working_image import PIXEL_MM, Image, WorkingImage

Array = npt.NDArray[np.float64]


class CompiledLoopViews(LoopViews):
    """See `LoopViews`; it goes its way at once."""

    def descend(self, arms: Array, ring: Array, precision: Array) -> Descent:
        """What `gauss_newton.descend` does with plain views."""
        count, shape = len(self._images), self._pattern.shape
        self.centres, ring = self.centres.copy(), ring.copy()
        self._pixels, tangents = np.empty((2, count, shape[0], 2))
        self._samples, self._weights = np.empty((2, count, *shape), dtype=np.float32)
        spacing, depth = np.empty((2, count, shape[0]))
        steps, self._gains, noise = np.empty((3, count))
        correlation, means = np.zeros((2, count)), np.empty(TUNING.iterations)
        along, sideways = self._slopes[:, 0]
        looks, is_given_up, covariance = kernels.descend(
            (np.ascontiguousarray(self._images[0].values), np.ascontiguousarray(self._images[-1].values)),
            np.array([image.projection.matrix for image in self._images]),
            self.centres,
            self._across,
            arms,
            self._pattern,
            along,
            sideways,
            1e-3 * PIXEL_MM * self._focal_px,
            self.usual,
            ring,
            precision,
            (1e-3 * TUNING.largest_step_mm, TUNING.largest_turn_rad, TUNING.largest_stretch),
            TUNING.hopeless_likeness,
            (SAMPLING.nothing_likeness, SAMPLING.hopeful_rise),
            TUNING.renewals,
            1e-3 * TUNING.converged_mm,
            TUNING.ridge,
            TUNING.first_sure_look,
            TUNING.nothing_seen_m**-2,
            SMALLEST_SPACING,
            SAMPLING.largest_spacing_px,
            SAMPLING.outlier_sigmas,
            SAMPLING.noise_correlation,
            SAMPLING.segments,
            SAMPLING.nominal_segments,
            self._pixels,
            tangents,
            spacing,
            depth,
            steps,
            self._samples,
            self._weights,
            self._gains,
            noise,
            correlation,
            means,
        )
        self.correlation = correlation[1]
        return Descent(ring, tuple(means[:looks].tolist()), is_given_up, covariance)

    def _seen(self) -> tuple[Array, Array]:
        planes = zip(self._samples, self._weights, self._gains, strict=True)
        seen = [
            kernels.seen(
                samples,
                weights,
                self._pattern,
                self._slopes[1, 0],
                gain,
                SAMPLING.segments,
                SAMPLING.segment_gain,
            )
            for samples, weights, gain in planes
        ]
        visible, beside = np.array(seen).T
        return visible, beside

    def _summed(self, values: Image, pixels: Array, image: WorkingImage) -> tuple[float, float, float]:
        height, width = image.values.shape
        sums: tuple[float, float, float] = kernels.summed(
            values, pixels, width, height, self._arc_weights, self._between
        )
        return sums
