"""Sub-pixel alignment of the loop's appearance in all planes at once (Gauss–Newton, after Lucas and Kanade).

Each plane has its own two-dimensional shift of the loop's centre, because the planes need not be exposed at
the same time nor calibrated to each other; what the planes share is the ring's own tilt, spin and size, held
by priors, since a small circle shows them only weakly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.appearance import HALF_WIDTH, Strip, strip_along
from lasso_motion_ros.frames import Plane
from lasso_motion_ros.transforms import rotation_from_vector
from lasso_motion_ros.working_image import PIXEL_MM, Image, WorkingImage

Array = npt.NDArray[np.float64]

ITERATIONS = 8
CONVERGED_MM = 0.015
LARGEST_STEP_MM = 0.4
LARGEST_TURN_RAD = 0.03
# Working pixels share noise with their neighbours (detector, band-pass); this many count as one.
NOISE_CORRELATION = 8.0
OUTLIER_SIGMAS = 4.0  # Tukey's weight is zero beyond
SEGMENTS = 12
SEGMENT_GAIN = 0.4  # a segment weaker than this, relative to what it was, is not seen
LARGEST_SPACING_PX = 1.5  # samples further apart than this do not each count for more
# Mean of the planes' correlations, iteration by iteration, below which no loop is there: of 759 true places in the
# phantom suite the worst had 0.27, 0.37 and 0.42; half of the false ones have less than 0.26 at once.
HOPELESS_CORRELATION = (0.2, 0.32, 0.4)
BEHIND = (0.3, 0.18, 0.08)  # another alignment's correlation by then, and it will not be overtaken
NOTHING_SEEN_M = 5e-3  # standard deviation of a place that was given up at once


@dataclass(frozen=True)
class RingPrior:
    """How far the ring may tilt, spin and stretch by itself (standard deviations).

    Attributes:
        turn_rad: tilt about any axis, and spin.
        stretch: relative change of size.
    """

    turn_rad: float
    stretch: float


@dataclass(frozen=True, eq=False)
class PlaneFit:
    """Where one plane saw the loop, and how well.

    Attributes:
        centre: (3,) a world point on the ray on which the loop's centre was seen.
        across: (2, 3) two unit vectors perpendicular to that ray: the directions in which the plane measures.
        covariance: (2, 2) of the centre along them, m², image noise only.
        gain: strength of the loop against its appearance: 1 as expected, 0 not there.
        correlation: normalised correlation of strip and appearance.
        visible: share of the loop's segments that look as expected.
        residual_mm: mean distance, at the loop, by which those segments lie beside the curve.
        strip: (L, 2·HALF_WIDTH + 1) the samples there, to learn the appearance from.
    """

    centre: Array
    across: Array
    covariance: Array
    gain: float
    correlation: float
    visible: float
    residual_mm: float
    strip: Image


@dataclass(frozen=True, eq=False)
class Alignment:
    """The loop in one pair.

    Attributes:
        planes: fit of each plane that took part.
        turn: (3,) rotation vector of the ring about its centre since the seed pair, rad.
        turn_covariance: (3, 3) rad², prior included.
        stretch: natural logarithm of the ring's size relative to the reference.
    """

    planes: dict[Plane, PlaneFit]
    turn: Array
    turn_covariance: Array
    stretch: float


def align(
    images: dict[Plane, WorkingImage],
    appearances: dict[Plane, Image],
    arms: Array,
    starts: dict[Plane, Array],
    prior: RingPrior,
    turn: Array | None = None,
    stretch: float = 0.0,
    distinctive: dict[Plane, Image] | None = None,
    at_least: float = 0.0,
) -> Alignment:
    """Align the loop's appearance with the images.

    Args:
        images: the planes that take part, one or two.
        appearances: their strips (L, 2·HALF_WIDTH + 1).
        arms: (L, 3) the loop's curve about its centre at the reference, metres.
        starts: per plane, (3,) the centre to start from, within about half a millimetre in that plane's image.
        prior: of the ring's own motion.
        turn: (3,) rotation vector to start from.
        stretch: logarithm of size to start from.
        distinctive: strips by which gain, correlation and visible share are told; the appearances unless given.
        at_least: mean correlation of the planes that a better alignment has, so that a worse one need not be finished.
    """
    told_by = appearances if distinctive is None else distinctive
    views = {plane: _View(images[plane], appearances[plane], told_by[plane], starts[plane]) for plane in images}
    shared = 2 * len(views)  # the parameters: two shifts a plane, then turn (3) and stretch
    places = [np.r_[2 * i, 2 * i + 1, shared : shared + 4] for i in range(len(views))]
    ring = np.append(np.zeros(3) if turn is None else turn, stretch)
    precision = np.append(np.full(3, 1.0 / prior.turn_rad**2), 1.0 / prior.stretch**2)
    limits = np.append(np.full(shared, LARGEST_STEP_MM * 1e-3), [LARGEST_TURN_RAD] * 3 + [0.02])
    normal = np.diag(np.append(np.full(shared, 1.0 / NOTHING_SEEN_M**2), precision))
    for iteration in range(ITERATIONS):
        moved = arms @ rotation_from_vector(ring[:3]).T * np.exp(ring[3])
        for view in views.values():
            view.look(moved)
        if iteration < len(HOPELESS_CORRELATION):
            correlation = sum(view.correlation for view in views.values()) / len(views)
            if correlation < max(HOPELESS_CORRELATION[iteration], at_least - BEHIND[iteration]):
                break
        normal[:] = 0.0
        gradient = np.zeros(shared + 4)
        for view, place in zip(views.values(), places, strict=True):
            # The derivative changes little on the way; the residual is what has to be exact.
            block, right = view.equations(renew=iteration < 2)
            normal[np.ix_(place, place)] += block
            gradient[place] += right
        normal[range(shared, shared + 4), range(shared, shared + 4)] += precision
        gradient[shared:] -= precision * ring
        step = np.clip(np.linalg.solve(normal + _ridge(normal), gradient), -limits, limits)
        for view, place in zip(views.values(), places, strict=True):
            view.centre = view.centre + step[place[:2]] @ view.across
        ring = ring + step[shared:]
        # A turn or stretch that was cut to its limit is not done, though the shifts may be.
        if np.all(np.abs(step[:shared]) < CONVERGED_MM * 1e-3) and np.all(np.abs(step) < limits):
            break
    covariance: Array = np.linalg.inv(normal + _ridge(normal)).astype(np.float64)
    return Alignment(
        planes={
            p: view.fit(covariance[np.ix_(q[:2], q[:2])]) for (p, view), q in zip(views.items(), places, strict=True)
        },
        turn=ring[:3],
        turn_covariance=covariance[shared : shared + 3, shared : shared + 3],
        stretch=float(ring[3]),
    )


def _ridge(normal: Array) -> Array:
    """A trace of damping, for a plane that shows nothing."""
    return np.asarray(1e-12 * np.trace(normal) * np.eye(len(normal)))


class _View:
    """One plane while it is being aligned."""

    def __init__(self, image: WorkingImage, pattern: Image, distinctive: Image, centre: Array) -> None:
        self._image = image
        self._pattern = pattern
        self._distinctive = distinctive
        self._along = np.gradient(pattern, axis=0)
        self._sideways = np.gradient(pattern, axis=1)
        self._jacobian = np.zeros((pattern.size, 6), dtype=np.float32)
        self.centre = np.array(centre)
        ray = self.centre - image.projection.source
        self.across = np.linalg.svd(ray[None])[2][1:]
        self.gain = self.correlation = 0.0

    def look(self, arms: Array) -> None:
        """Sample the image along the loop where it is taken to be, and tell how well that looks as expected."""
        self._arms = arms
        self._strip = strip = strip_along(self.centre + arms, self._image.projection)
        self._samples = samples = strip.sample(self._image)
        density = np.minimum(strip.spacing, LARGEST_SPACING_PX).astype(np.float32)[:, None]
        residual = _gain(density, samples, self._pattern) * self._pattern - samples
        self._noise = noise = 1.4826 * _median(np.abs(residual)) + 1e-6
        # Tukey's weights.
        share = np.square(residual * np.float32(1.0 / (OUTLIER_SIGMAS * noise)))
        np.subtract(1.0, share, out=share)
        np.maximum(share, 0.0, out=share)
        share *= share
        share *= density
        self._weights = share
        weighted = share * self._distinctive
        cross, energy = float(np.vdot(weighted, samples)), float(np.vdot(weighted, self._distinctive))
        self.gain = cross / max(energy, 1e-9)
        self.correlation = cross / float(np.sqrt(max(float(np.vdot(share * samples, samples)) * energy, 1e-12)))

    def equations(self, *, renew: bool) -> tuple[Array, Array]:
        """Normal matrix (6, 6) and right side (6,) for own shift (2), turn (3) and stretch (1), from the last look."""
        if renew:
            self._jacobian = self._derivative(self._strip, self.centre + self._arms, self._arms)
        gain = _gain(self._weights, self._samples, self._pattern)
        scale = max(gain, 0.3)
        residual = (gain * self._pattern - self._samples).reshape(-1)
        weighted = self._jacobian * (
            self._weights.reshape(-1, 1) * np.float32(1.0 / (self._noise**2 * NOISE_CORRELATION))
        )
        block = scale**2 * (weighted.T @ self._jacobian).astype(np.float64)
        return block, scale * (weighted.T @ residual).astype(np.float64)

    def fit(self, covariance: Array) -> PlaneFit:
        """The result, with the share of the loop that looks as expected where it was last sampled."""
        cross = _by_segment(self._weights * self._samples * self._distinctive)
        energy = _by_segment(self._weights * self._distinctive * self._distinctive)
        there = cross > SEGMENT_GAIN * energy
        visible = float(energy[there].sum() / max(float(energy.sum()), 1e-9))
        # One step across the curve, segment by segment: what moves the pattern there onto the samples.
        slope = self._weights * self._sideways
        gain = max(self.gain, SEGMENT_GAIN)
        step = _by_segment(slope * (self._samples - gain * self._pattern))
        step /= gain * np.maximum(_by_segment(slope * self._sideways), 1e-9)
        residual = float(np.abs(np.clip(step[there], -HALF_WIDTH, HALF_WIDTH)).mean()) if there.any() else 0.0
        return PlaneFit(
            self.centre,
            self.across,
            covariance,
            self.gain,
            self.correlation,
            visible,
            PIXEL_MM * residual,
            self._samples,
        )

    def _derivative(self, strip: Strip, points: Array, arms: Array) -> npt.NDArray[np.float32]:
        """(L·columns, 6) derivative of the strip by own shift (2), turn (3) and stretch (1).

        Where the loop moves by a pixel displacement d, what a sample should see is the pattern a distance d
        further on: its slope along and across the curve, times d's parts in those directions.
        """
        by_point = self._image.projection.jacobian(points)  # (L, 2, 3)
        along = np.einsum("lij,li->lj", by_point, strip.tangents) / np.maximum(strip.spacing, 0.05)[:, None]
        sideways = np.einsum("lij,li->lj", by_point, strip.normals) / strip.step
        derivative = np.empty((*self._pattern.shape, 6), dtype=np.float32)
        for index, (slope_along, slope_sideways) in enumerate(
            zip(_by_parameter(along, arms, self.across), _by_parameter(sideways, arms, self.across), strict=True)
        ):
            derivative[..., index] = self._along * slope_along[:, None] + self._sideways * slope_sideways[:, None]
        return derivative.reshape(-1, 6)


def _by_parameter(slope: Array, arms: Array, across: Array) -> npt.NDArray[np.float32]:
    """(6, L) a slope by the points' position (L, 3), carried on to own shift (2), turn (3) and stretch (1)."""
    x, y, z = arms.T
    a, b, c = slope.T
    # slope · (ω × arm) = ω · (arm × slope)
    turn = (y * c - z * b, z * a - x * c, x * b - y * a)
    return np.stack([*(slope @ across.T).T, *turn, x * a + y * b + z * c]).astype(np.float32)


def _by_segment(values: Image) -> Image:
    """(SEGMENTS,) sums of a strip's values over the segments of the loop."""
    along = values.sum(axis=1)
    starts = np.linspace(0, len(along), SEGMENTS, endpoint=False).astype(int)
    return np.asarray(np.add.reduceat(along, starts))


def _median(values: Image) -> float:
    """The upper median, in half the time of numpy's."""
    middle = values.size // 2
    return float(np.partition(values, middle, axis=None)[middle])


def _gain(weights: Image, samples: Image, pattern: Image) -> float:
    weighted = weights * pattern
    return float(np.vdot(weighted, samples) / max(float(np.vdot(weighted, pattern)), 1e-9))
