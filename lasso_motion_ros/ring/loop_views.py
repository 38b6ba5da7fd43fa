"""What the planes show along a ring: sampled there, compared with its template, and how that changes as it moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.directions import reflected_axes
from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.ring.strip import HALF_WIDTH, sample_at, strip_about, upper_median
from lasso_motion_ros.ring.template import RingTemplate
from lasso_motion_ros.ring.working_image import PIXEL_MM, Image, WorkingImage

Array = npt.NDArray[np.float64]

_ONES = np.ones(2 * HALF_WIDTH + 1, dtype=np.float32)


@dataclass(frozen=True)
class _Tuning:
    """What counts as noise, as an outlier and as seen."""

    # Working pixels share noise with their neighbours (detector, band-pass); so many count as one (docs/constants.md).
    noise_correlation: float = 8.0
    # That holds the ring's own turn and size as they should be held; of a place it says too little. Of 3,700 simulated
    # places, squared errors are this share of what it foretells (docs/constants.md).
    place_share: float = 0.6
    outlier_sigmas: float = 4.0  # Tukey's weight is zero beyond
    segments: int = 12  # of the loop, each judged by itself
    segment_gain: float = 0.4  # a segment weaker than this, relative to what it was, is not seen
    largest_spacing_px: float = 1.5  # samples further apart than this do not each count for more
    # The segments' own scatter tells what the noise of single pixels does not: other devices that overlap the ring, a
    # curve that is not quite the ring's. It counts as much as so many segments that the noise alone would tell of.
    nominal_segments: int = 12
    # A plane's own likeness, below which there is no loop, unless it has just risen by so much (docs/constants.md).
    nothing_likeness: float = 0.4
    hopeful_rise: float = 0.1


TUNING = _Tuning()


@dataclass(frozen=True, eq=False)
class PlaneFit:
    """Where one plane saw the loop, and how well.

    Attributes:
        centre: (3,) a world point on the ray on which the loop's centre was seen.
        ray: (3,) that ray's unit direction.
        across: (2, 3) two unit vectors perpendicular to that ray: the directions in which the plane measures.
        covariance: (2, 2) of the centre along them, m².
        contrast: of the ring, as a share of the grey behind it, whatever the noise.
        correlation: normalised correlation of strip and template, outliers left out.
        evidence: mean of the evidence image along the curve, weighted by the template's electrodes; -1 to 2.
        wire: mean of the evidence between the electrodes, but no more than the ring's own wire shows.
        coverage: share of those weights that lie inside the image.
        visible: share of the loop's segments that look as expected.
        residual_mm: mean distance, at the loop, by which those segments lie beside the curve.
        strip: (L, 2·HALF_WIDTH + 1) the samples there, to learn the template from.
        shown: (L,) the evidence along the curve, likewise.
    """

    centre: Array
    ray: Array
    across: Array
    covariance: Array
    contrast: float
    correlation: float
    evidence: float
    wire: float
    coverage: float
    visible: float
    residual_mm: float
    strip: Image
    shown: Image


class LoopViews:
    """The planes while a ring is being aligned with them, P of them at once: the first axis of the arrays.

    Args:
        planes: their images.
        template: what is to be found in each.
        centres: (P, 3) where to start from.

    Attributes:
        centres: (P, 3) where it is taken to be by now.
        usual: (P,) correlation of strip and template where the loop is seen.
        correlation: (P,) the same, from the last look.
    """

    def __init__(self, planes: dict[Plane, WorkingImage], template: RingTemplate, centres: Array) -> None:
        self._images = images = list(planes.values())
        projections = [image.projection for image in images]
        self._left = np.array([p.matrix[:, :3] for p in projections])
        self._column = np.array([p.matrix[:, 3] for p in projections])
        self._focal_px = np.array([p.focal_length_px for p in projections])
        # (L, columns) each, columns being 2·HALF_WIDTH + 1: the same in all planes.
        self._pattern = template.values
        self._slopes = np.array(template.slopes)[:, None]  # (2, 1, L, columns), along and sideways
        self._arc_weights, self._between = template.weights.astype(np.float64), template.between
        self._wire = [template.wire[plane] for plane in planes]
        self.usual = np.array([template.usual[plane] for plane in planes])
        self.centres = centres
        rays = centres - np.array([p.source for p in projections])
        self._rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
        self._across = reflected_axes(self._rays)  # (P, 2, 3)
        self.correlation = np.zeros(len(images))

    @property
    def likeness(self) -> Array:
        """(P,) correlation at the last look, relative to what is usual."""
        return np.asarray(self.correlation / self.usual, dtype=np.float64)

    @property
    def is_hopeful(self) -> npt.NDArray[np.bool_]:
        """(P,) whether there may be a loop in the plane, by the last two looks."""
        likeness, before = self.likeness, self._correlation_before / self.usual
        return np.asarray((likeness >= TUNING.nothing_likeness) | (likeness >= before + TUNING.hopeful_rise))

    def shift(self, step: Array) -> None:
        """Move each plane's centre across its ray: (P, 2) metres."""
        self.centres = self.centres + np.einsum("pi,pij->pj", step, self._across)

    def look(self, arms: Array) -> None:
        """Sample the images along the loop where it is taken to be, and tell how well that looks as expected.

        Args:
            arms: (L, 3) the loop about its centre, turned and stretched.
        """
        self._arms, self._correlation_before = arms, self.correlation
        homogeneous = (self.centres[:, None] + arms) @ self._left.swapaxes(1, 2) + self._column[:, None]
        self._depth = homogeneous[..., 2]
        step_px = PIXEL_MM * self._focal_px / (1e3 * self._depth.sum(axis=1) / len(arms))
        self._strip = strip = strip_about(homogeneous[..., :2] / self._depth[..., None], step_px)
        self._pixels = strip.pixels
        planes = zip(strip.coordinates(), self._images, strict=True)
        self._samples = samples = np.array([sample_at(at, image) for at, image in planes])
        density = np.minimum(strip.spacing, TUNING.largest_spacing_px).astype(np.float32)[..., None]
        pattern = self._pattern
        residual = _gain(density, samples, pattern)[:, None, None] * pattern - samples
        self._noise = noise = np.float32(1.4826) * upper_median(np.abs(residual.reshape(len(residual), -1)))
        noise += np.float32(1e-6)
        # Tukey's weights.
        residual /= (np.float32(TUNING.outlier_sigmas) * noise)[:, None, None]
        share = np.square(residual, out=residual)
        np.subtract(1.0, share, out=share)
        np.maximum(share, 0.0, out=share)
        share *= share
        share *= density
        self._weights = share
        weighted = share * pattern
        cross, energy = _dot(weighted, samples), _total(weighted, pattern)
        self._gains = cross / np.maximum(energy, 1e-9)
        self.correlation = cross / np.sqrt(np.maximum(_dot(share * samples, samples) * energy, 1e-12))

    def equations(self, *, renew: bool) -> tuple[Array, Array]:
        """Normal matrix (N, N) and right side (N,) from the last look; N = 2 P + 4 for shifts, turn and stretch.

        A sample's derivative is its pattern's slope along the curve times how a parameter moves the curve's point
        along, plus the same sideways. The latter does not depend on the column, so that sums over the columns come
        first and the whole Jacobian is never made.
        """
        if renew:
            self._moves = self._derivative()
        gain = self._gains
        residual = gain[:, None, None] * self._pattern - self._samples
        scale = np.maximum(gain, 0.3)
        known = 1.0 / (self._noise**2 * TUNING.noise_correlation)
        weighted = self._weights * self._slopes  # (2, P, L, columns), along and sideways
        square, right = (scale**2 * known)[:, None], (scale * known)[:, None]
        along_along, along_sideways = (square * _over_columns(weighted[0] * self._slopes)).reshape(2, -1)
        sideways_sideways = (square * _over_columns(weighted[1] * self._slopes[1])).reshape(-1)
        residual_along, residual_sideways = (right * _over_columns(weighted * residual)).reshape(2, -1)
        along, sideways = self._moves
        self._scores = along * residual_along + sideways * residual_sideways
        normal = (along * along_along + sideways * along_sideways) @ along.T
        normal += (along * along_sideways + sideways * sideways_sideways) @ sideways.T
        return normal, self._scores.sum(axis=1)

    def covariance(self, normal: Array) -> Array:
        """(N, N) of the parameters: by the noise, and by how far the ring's segments pull in different directions.

        The latter is the cluster-robust sandwich (Liang and Zeger, Biometrika 73, 1986), shrunk towards the former.

        Args:
            normal: (N, N) the last normal matrix, priors included.
        """
        nominal = np.linalg.inv(normal)
        size, (count, length) = len(normal), self._depth.shape
        starts = np.arange(TUNING.segments) * length // TUNING.segments
        scores = np.add.reduceat(self._scores.reshape(size, count, length), starts, axis=-1).reshape(size, -1)
        scores = scores - scores.mean(axis=1, keepdims=True)
        clusters = scores.shape[1]
        sandwich = nominal @ (scores @ scores.T) @ nominal * (clusters / (clusters - size))
        known = TUNING.nominal_segments
        variances = nominal.diagonal()
        blended = (known * variances + clusters * sandwich.diagonal()) / (known + clusters)
        # Never less than the noise alone leaves unknown.
        wider = np.sqrt(np.maximum(blended / variances, 1.0))
        return np.asarray(nominal * wider[:, None] * wider)

    def fits(self, covariance: Array) -> list[PlaneFit]:
        """The results, with the share of the loop that looks as expected where it was last sampled.

        Args:
            covariance: (N, N) of the parameters.
        """
        visible, beside = self._seen()
        shown, evidence, wire, coverage = self._evidence()
        return [
            PlaneFit(
                self.centres[i],
                self._rays[i],
                self._across[i],
                TUNING.place_share * covariance[2 * i : 2 * i + 2, 2 * i : 2 * i + 2],
                float(self._gains[i]) * self._images[i].contrast_unit(self.centres[i]),
                float(self.correlation[i]),
                evidence[i],
                wire[i],
                coverage[i],
                float(visible[i]),
                PIXEL_MM * float(beside[i]),
                self._samples[i],
                shown[i],
            )
            for i in range(len(self._images))
        ]

    def _seen(self) -> tuple[Array, Array]:
        """(P,) share of the loop's segments that look as expected, and their mean distance from the curve, columns."""
        sideways = self._slopes[1]
        weighted, steepness = self._weights * self._pattern, self._weights * sideways
        gain = np.maximum(self._gains, TUNING.segment_gain)[:, None]
        residual = self._samples - gain[..., None] * self._pattern
        cross, energy, beside, steep = _by_segment(
            np.stack(
                [
                    weighted * self._samples,
                    weighted * self._pattern,
                    steepness * residual,
                    steepness * sideways,
                ]
            )
        )
        there = cross > TUNING.segment_gain * energy
        visible = np.where(there, energy, 0.0).sum(axis=1) / np.maximum(energy.sum(axis=1), 1e-9)
        # One step across the curve, segment by segment: what moves the pattern there onto the samples.
        step = beside / (gain * np.maximum(steep, 1e-9))
        distance = np.where(there, np.abs(np.clip(step, -HALF_WIDTH, HALF_WIDTH)), 0.0)
        return visible, distance.sum(axis=1) / np.maximum(there.sum(axis=1), 1)

    def _evidence(self) -> tuple[list[Image], list[float], list[float], list[float]]:
        """Each plane's evidence along the curve where it was last sampled, at the electrodes, between; and coverage."""
        shown, evidence, wire, coverage = [], [], [], []
        for pixels, image, own in zip(self._pixels, self._images, self._wire, strict=True):
            values = image.evidence_at(pixels)
            at_electrodes, between, share = self._summed(values, pixels, image)
            shown.append(values)
            evidence.append(at_electrodes)
            # What is darker than its wire is a line of something else: it is not the more the ring for that.
            wire.append(min(between, own))
            coverage.append(share)
        return shown, evidence, wire, coverage

    def _summed(self, values: Image, pixels: Array, image: WorkingImage) -> tuple[float, float, float]:
        """Evidence (L,) at pixels (L, 2) of an image: its mean at the electrodes and between them; and the coverage."""
        inside = np.asarray(((pixels >= 0.0) & (pixels <= np.array(image.values.shape[::-1]) - 1.0)).all(axis=1))
        share = float(self._arc_weights @ inside)
        at_electrodes = float(self._arc_weights @ values) / max(share, 1e-6) if share > 0.0 else 0.0
        between = values[self._between].sum(dtype=np.float64) / max(int(inside[self._between].sum()), 1)
        return at_electrodes, float(between), share

    def _derivative(self) -> Array:
        """(2, N, P·L) by how much each parameter moves each point of the curves, along them and sideways.

        Where the loop moves by a pixel displacement d, what a sample should see is the pattern a distance d
        further on: its slope along and across the curve, times d's parts in those directions. In units of the
        pattern's own spacing.
        """
        strip = self._strip
        directions = np.array([strip.tangents, strip.normals])
        spacing = np.empty((2, *strip.spacing.shape))
        spacing[0], spacing[1] = np.maximum(strip.spacing, 0.05), strip.step[:, None]
        # By the points' position (2, P, L, 3): of a projection's derivative, only what lies in those directions.
        offset = (directions * strip.pixels).sum(axis=-1, keepdims=True)
        slopes = np.concatenate([directions, -offset], axis=-1) @ self._left
        slopes /= (self._depth * spacing)[..., None]
        # And on to the planes' own shifts, turn and stretch.
        count, length = self._depth.shape
        moves = np.zeros((2, 2 * count + 4, count, length))
        for plane, across in enumerate(self._across):
            moves[:, 2 * plane : 2 * plane + 2, plane] = across @ slopes[:, plane].swapaxes(1, 2)
        (x, y, z), (a, b, c) = self._arms.T, (slopes[..., axis] for axis in range(3))
        # slope · (ω × arm) = ω · (arm × slope)
        moves[:, -4], moves[:, -3], moves[:, -2] = y * c - z * b, z * a - x * c, x * b - y * a
        moves[:, -1] = x * a + y * b + z * c
        return moves.reshape(2, 2 * count + 4, count * length)


def _over_columns(values: Image) -> Image:
    """(..., L) sums of strips' values over their columns."""
    return np.asarray(values @ _ONES)


def _by_segment(values: Image) -> Image:
    """(..., segments) sums of strips' values over the segments of the loop."""
    along = _over_columns(values)
    starts = np.arange(TUNING.segments) * along.shape[-1] // TUNING.segments
    return np.asarray(np.add.reduceat(along, starts, axis=-1))


def _dot(one: Image, other: Image) -> Image:
    """(P,) scalar products of the planes' strips (P, L, columns)."""
    return np.asarray(np.einsum("pn,pn->p", one.reshape(len(one), -1), other.reshape(len(other), -1)))


def _total(strips: Image, pattern: Image) -> Image:
    """(P,) scalar products of the planes' strips (P, L, columns) with one pattern (L, columns)."""
    return np.asarray(np.einsum("pn,n->p", strips.reshape(len(strips), -1), pattern.reshape(-1)))


def _gain(weights: Image, samples: Image, pattern: Image) -> Image:
    """(P,) factors by which the pattern is the samples, in the least squares."""
    weighted = weights * pattern
    return np.asarray(_dot(weighted, samples) / np.maximum(_total(weighted, pattern), 1e-9))
