"""Sub-pixel alignment of the loop's appearance in all planes at once (Gauss–Newton, after Lucas and Kanade).

Each plane has its own two-dimensional shift of the loop's centre, because the planes need not be exposed at
the same time nor calibrated to each other; what the planes share is the ring's own tilt, spin and size, held
by priors, since a small circle shows them only weakly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.appearance import Image, Strip, strip_along
from lasso_motion_ros.frames import Plane
from lasso_motion_ros.geometry import Projection
from lasso_motion_ros.transforms import rotation_from_vector
from lasso_motion_ros.working_image import WorkingImage

Array = npt.NDArray[np.float64]

ITERATIONS = 8
CONVERGED_MM = 0.004
LARGEST_STEP_MM = 0.4
LARGEST_TURN_RAD = 0.03
# Working pixels share noise with their neighbours (detector, band-pass); this many count as one.
NOISE_CORRELATION = 8.0
OUTLIER_SIGMAS = 4.0  # Tukey's weight is zero beyond
SEGMENTS = 12


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
        strip: (L, 2·HALF_WIDTH + 1) the samples there, to learn the appearance from.
    """

    centre: Array
    across: Array
    covariance: Array
    gain: float
    correlation: float
    visible: float
    strip: Image


@dataclass(frozen=True, eq=False)
class Alignment:
    """The loop in one pair.

    Attributes:
        planes: fit of each plane that took part.
        turn: (3,) rotation vector of the ring about its centre since the reference, rad.
        turn_covariance: (3, 3) rad², prior included.
        stretch: natural logarithm of the ring's size relative to the reference.
    """

    planes: dict[Plane, PlaneFit]
    turn: Array
    turn_covariance: Array
    stretch: float


@dataclass(frozen=True, eq=False)
class _Pattern:
    """A plane's appearance with its derivatives along the curve (per curve point) and across (per column)."""

    values: Image
    along: Image
    across: Image


def align(
    images: dict[Plane, WorkingImage],
    appearances: dict[Plane, Image],
    loop: Array,
    starts: dict[Plane, Array],
    prior: RingPrior,
    turn: Array | None = None,
    stretch: float = 0.0,
) -> Alignment:
    """Align the loop's appearance with the images.

    Args:
        images: the planes that take part, one or two.
        appearances: their strips (L, 2·HALF_WIDTH + 1).
        loop: (L, 3) the loop's curve about its centre at the reference, metres.
        starts: per plane, (3,) the centre to start from, within about half a millimetre in that plane's image.
        prior: of the ring's own motion.
        turn: (3,) rotation vector to start from.
        stretch: logarithm of size to start from.
    """
    planes = list(images)
    count = 2 * len(planes) + 4
    patterns = {
        p: _Pattern(a, np.gradient(a, axis=0), np.gradient(a, axis=1)) for p, a in appearances.items() if p in images
    }
    across = {p: _directions_across(images[p].projection, starts[p]) for p in planes}
    centres = {p: np.array(starts[p]) for p in planes}
    ring = np.append(np.zeros(3) if turn is None else turn, stretch)
    precision = np.append(np.full(3, 1.0 / prior.turn_rad**2), 1.0 / prior.stretch**2)
    limits = np.append(np.full(2 * len(planes), LARGEST_STEP_MM * 1e-3), [LARGEST_TURN_RAD] * 3 + [0.02])
    fits: dict[Plane, tuple[float, float, float, Image]] = {}
    normal = np.eye(count)
    for _ in range(ITERATIONS):
        normal, gradient = np.zeros((count, count)), np.zeros(count)
        moved = loop @ rotation_from_vector(ring[:3]).T * np.exp(ring[3])
        for index, plane in enumerate(planes):
            own = slice(2 * index, 2 * index + 2)
            strip = strip_along(centres[plane] + moved, images[plane].projection)
            samples = strip.sample(images[plane])
            weights, gain, correlation, visible = _compare(samples, patterns[plane].values, strip)
            fits[plane] = gain, correlation, visible, samples
            jacobian = _strip_jacobian(patterns[plane], strip, images[plane].projection, centres[plane] + moved, moved, across[plane])
            jacobian *= max(gain, 0.3)
            residual = (gain * patterns[plane].values - samples).reshape(-1)
            weighted = jacobian * weights.reshape(-1, 1)
            block, right = weighted.T @ jacobian, weighted.T @ residual
            where = np.r_[own, 2 * len(planes) : count]
            normal[np.ix_(where, where)] += block
            gradient[where] += right
        normal[-4:, -4:] += np.diag(precision)
        gradient[-4:] -= precision * ring
        step = np.clip(np.linalg.solve(normal + 1e-12 * np.trace(normal) * np.eye(count), gradient), -limits, limits)
        for index, plane in enumerate(planes):
            centres[plane] = centres[plane] + step[2 * index : 2 * index + 2] @ across[plane]
        ring = ring + step[-4:]
        if np.all(np.abs(step[: 2 * len(planes)]) < CONVERGED_MM * 1e-3):
            break
    covariance = np.linalg.inv(normal + 1e-12 * np.trace(normal) * np.eye(count))
    return Alignment(
        planes={
            p: PlaneFit(centres[p], across[p], covariance[2 * i : 2 * i + 2, 2 * i : 2 * i + 2], *fits[p])
            for i, p in enumerate(planes)
        },
        turn=ring[:3],
        turn_covariance=covariance[-4:-1, -4:-1],
        stretch=float(ring[3]),
    )


def _directions_across(projection: Projection, centre: Array) -> Array:
    """(2, 3) unit vectors perpendicular to the ray through a world point."""
    ray = centre - projection.source
    return np.linalg.svd(ray[None])[2][1:]


def _compare(samples: Image, pattern: Image, strip: Strip) -> tuple[Image, float, float, float]:
    """Robust weights per sample (information, 1 / noise variance), gain, correlation, visible share."""
    density = np.repeat(np.minimum(strip.spacing, 1.5)[:, None], samples.shape[1], axis=1).astype(np.float32)
    gain = _gain(density, samples, pattern)
    residual = samples - gain * pattern
    noise = 1.4826 * float(np.median(np.abs(residual))) + 1e-6
    weights = density * np.clip(1.0 - (residual / (OUTLIER_SIGMAS * noise)) ** 2, 0.0, 1.0) ** 2
    gain = _gain(weights, samples, pattern)
    cross = weights * samples * pattern
    energy, power = weights * pattern * pattern, weights * samples * samples
    correlation = float(cross.sum() / np.sqrt(max(float(energy.sum() * power.sum()), 1e-12)))
    chunks = np.array_split(np.arange(len(samples)), SEGMENTS)
    cross, energy = cross.sum(axis=1), energy.sum(axis=1)
    gains = np.array([cross[c].sum() / max(float(energy[c].sum()), 1e-9) for c in chunks])
    shares = np.array([energy[c].sum() for c in chunks])
    visible = float(shares[gains > 0.4].sum() / max(float(shares.sum()), 1e-9))
    return weights / (noise**2 * NOISE_CORRELATION), gain, correlation, visible


def _gain(weights: Image, samples: Image, pattern: Image) -> float:
    return float((weights * samples * pattern).sum() / max(float((weights * pattern * pattern).sum()), 1e-9))


def _strip_jacobian(
    pattern: _Pattern, strip: Strip, projection: Projection, points: Array, arms: Array, across: Array
) -> Array:
    """(L·columns, 6 + …) derivative of the strip's expected values by own shift (2), turn (3) and stretch (1).

    Moving the loop by a pixel displacement d moves the samples with it: they then see the pattern's value at
    −d from where it really lies, so that the expected strip changes by its slope along d.
    """
    by_point = projection.jacobian(points)  # (L, 2, 3)
    by_parameter = np.empty((len(points), 2, 6))
    by_parameter[:, :, :2] = by_point @ across.T
    # d(ω × arm)/dω = −[arm]×, row by row of the projection's derivative: a · (ω × r) = ω · (r × a).
    by_parameter[:, :, 2:5] = np.cross(arms[:, None, :], by_point)
    by_parameter[:, :, 5] = np.einsum("lij,lj->li", by_point, arms)
    along = np.einsum("lij,li->lj", by_parameter, strip.tangents) / np.maximum(strip.spacing, 0.05)[:, None]
    sideways = np.einsum("lij,li->lj", by_parameter, strip.normals) / strip.step
    jacobian = pattern.along[:, :, None] * along[:, None, :] + pattern.across[:, :, None] * sideways[:, None, :]
    return np.asarray(jacobian.reshape(-1, 6), dtype=np.float64)


