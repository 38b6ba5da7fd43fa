"""Search for the loop: a correlation per plane, then peaks of both planes joined along their rays.

The planes are correlated with the template, which is as fine as the wire; or, where that shows nothing plain, what is
as wide as an electrode with where the electrodes are: it stands out of more noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.curves import SMALLEST_SPACING
from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.ring.correlation import correlation
from lasso_motion_ros.ring.strip import render, shared_out, strip_along
from lasso_motion_ros.ring.working_image import CELL_PX, PIXEL_MM, Image, WorkingImage, in_cells

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How many places are looked at, and how two planes' are joined."""

    peaks: int = 24  # per plane
    peak_radius_cells: int = 3  # the highest within this
    score_ceiling: float = 25.0  # so that neither plane can drown the other
    ray_tolerance_m: float = 0.002  # rays that pass each other by less meet
    same_m: float = 2e-4  # closer than an alignment needs to start
    largest_disagreement_m: float = 0.03
    disagreement_penalty: float = 6.0  # in units of score,
    disagreement_scale_m: float = 0.005  # and one more for each of these


TUNING = _Tuning()
_PEAK_WINDOW = np.ones((2 * TUNING.peak_radius_cells + 1, 2 * TUNING.peak_radius_cells + 1), np.uint8)


@dataclass(frozen=True, eq=False)
class Peaks:
    """Places where the loop may be in one plane, best first.

    Attributes:
        scores: (K,) correlation with what is looked for, in units of the map's root mean square.
        pixels: (K, 2) where the loop's centre would be, working pixels, to a fraction of one.
        image: the working image.
    """

    scores: Array
    pixels: Array
    image: WorkingImage


@dataclass(frozen=True, eq=False)
class SearchCandidate:
    """A place where the loop may be.

    Attributes:
        score: sum of both planes' scores, less what speaks against it.
        centres: per plane, (3,) the loop's centre as that plane sees it, world metres.
    """

    score: float
    centres: dict[Plane, Array]

    def is_like(self, other: SearchCandidate) -> bool:
        """Whether an alignment that starts here ends where one from there does, in the same image and the same pair."""
        return self.centres.keys() == other.centres.keys() and all(
            float(np.abs(c - other.centres[plane]).max()) < TUNING.same_m for plane, c in self.centres.items()
        )


def find_peaks(
    image: WorkingImage,
    template: Image,
    centre: Array,
    arms: Array,
    reach_mm: float | None = None,
) -> Peaks:
    """Correlate a plane's working image with the ring's template and take the highest local maxima.

    Args:
        image: the plane.
        template: (L, 2·HALF_WIDTH + 1) strip values.
        centre: (3,) about where the loop's centre is expected, world metres.
        arms: (L, 3) the loop about its centre, metres.
        reach_mm: how far from there, at the loop, its centre may be along each of the image's axes; None: anywhere.
    """
    kernel, first = _laid_out(template, image.projection, centre, arms)
    reach = None if reach_mm is None else _reach_cells(image, centre, reach_mm)
    scores, away = _best_shifts(image.cells, kernel, first, reach)
    return Peaks(scores, image.projection.project(centre) + CELL_PX * away, image)


def find_electrodes(image: WorkingImage, weights: Image, centre: Array, ring: Array, reach_mm: float) -> Peaks:
    """Correlate a plane's evidence with where the ring's electrodes are, and take the highest local maxima.

    Args:
        image: the plane.
        weights: (L,) of the ring's points: where its electrodes are.
        centre: (3,) about where the loop's centre is expected, world metres.
        ring: (L, 3) the loop about its centre, turned and stretched as it is expected, metres.
        reach_mm: how far from there, at the loop, its centre may be along each of the image's axes.
    """
    pixels = image.projection.project(centre + ring)
    reach = _reach_cells(image, centre, reach_mm)
    margin = CELL_PX * (reach + 1)
    evidence, corner = image.evidence_about(np.array([pixels.min(axis=0) - margin, pixels.max(axis=0) + margin]))
    if min(evidence.shape) < CELL_PX:
        return Peaks(np.zeros(0), np.zeros((0, 2)), image)
    index, share, first, (width, height) = shared_out((pixels - corner).T, weights, CELL_PX)
    kernel = np.bincount(index.reshape(-1), share.reshape(-1), width * height).reshape(height, width)
    scores, away = _best_shifts(in_cells(evidence), kernel.astype(np.float32), tuple(first.tolist()), reach)
    return Peaks(scores, image.projection.project(centre) + CELL_PX * away, image)


def _laid_out(template: Image, projection: Projection, centre: Array, arms: Array) -> tuple[Image, tuple[int, int]]:
    """The template's values (L, C) on search cells where the loop is expected, as `render` gives them."""
    if has_kernels():
        from lasso_motion_ros.ring.kernels.search import laid_out

        column_px_m = 1e-3 * PIXEL_MM * projection.focal_length_px
        kernel, left, top = laid_out(template, projection.matrix, centre, arms, column_px_m, SMALLEST_SPACING, CELL_PX)
        return kernel, (left, top)
    kernel, first = render(template, strip_along(centre + arms, projection), CELL_PX)
    left, top = first.tolist()
    return kernel, (left, top)


def _reach_cells(image: WorkingImage, centre: Array, reach_mm: float) -> int:
    return math.ceil(reach_mm / (CELL_PX * image.projection.millimetres_per_pixel(centre)))


def _best_shifts(cells: Image, kernel: Image, first: tuple[int, int], reach: int | None) -> tuple[Array, Array]:
    """Where a kernel fits best.

    Args:
        cells: (h, w) of the image.
        kernel: (a, b) on such cells.
        first: the cell x, y on which its first one lies where it is expected.
        reach: by how many cells it may be off that along each axis; None: any.

    Returns:
        (K,) scores in units of their root mean square, highest first; (K, 2) by how many cells it is off there.
    """
    # The cells x, y on which the kernel's first may lie: up to half of the loop may be outside the image.
    (rows, columns), (height, width) = kernel.shape, cells.shape
    left, top, right, bottom = -(columns // 2), -(rows // 2), width + columns // 2 - columns, height + rows // 2 - rows
    if reach is not None:
        left, top = max(left, first[0] - reach), max(top, first[1] - reach)
        right, bottom = min(right, first[0] + reach), min(bottom, first[1] + reach)
    if right < left or bottom < top:
        return np.zeros(0), np.zeros((0, 2))
    scores = correlation(cells, kernel, (left, top), (right, bottom))
    found, places = _highest(scores, right - left + 1, bottom - top + 1)
    return found, places + np.array([left - first[0], top - first[1]])


def _highest(scores: Image, width: int, height: int) -> tuple[Array, Array]:
    """The highest local maxima of a map that is the upper left corner of a larger one.

    Args:
        scores: (m, n) the larger one.
        width: of the map.
        height: likewise.

    Returns:
        (K,) in units of the map's root mean square, highest first; (K, 2) their places x and y, to a fraction.
    """
    if has_kernels():
        from lasso_motion_ros.ring.kernels.search import highest

        highest_peaks: tuple[Array, Array] = highest(scores, width, height, TUNING.peaks, TUNING.peak_radius_cells)
        return highest_peaks
    part = np.ascontiguousarray(scores[:height, :width])
    part *= np.float32(1.0 / max(cv2.norm(part) / float(np.sqrt(part.size)), 1e-6))
    is_peak = part >= cv2.dilate(part, _PEAK_WINDOW)
    is_peak[0] = is_peak[-1] = is_peak[:, 0] = is_peak[:, -1] = False
    flat = part.reshape(-1)
    places = np.flatnonzero(is_peak)
    places = places[np.argsort(flat[places], kind="stable")[::-1][: TUNING.peaks]]
    at, beside = flat[places], np.array([[1], [width]])
    fraction = vertex(flat[places - beside], at, flat[places + beside])  # (2, K) in x and in y
    return at.astype(np.float64), np.array([places % width, places // width]).T + fraction.T


def join_peaks(
    peaks: dict[Plane, Peaks], expected: dict[Plane, Array], covariance: Array, slack_m: float, count: int
) -> list[SearchCandidate]:
    """Candidates from the peaks of one or two planes, best first; none without a plane.

    Args:
        peaks: the planes that take part.
        expected: per plane, (3,) where its loop centre is expected, world metres.
        covariance: (3, 3) of that expectation, m²: a mild preference among equals, never a gate.
        slack_m: how far the loop may have moved, unforeseen, between the two exposures.
        count: how many to return at most.
    """
    found: list[SearchCandidate] = []
    if not peaks:
        return found
    if len(peaks) == 1:
        (plane, only), *_ = peaks.items()
        for score, pixel in zip(only.scores, only.pixels, strict=True):
            centre = _on_ray(only, pixel, expected[plane])
            found.append(SearchCandidate(min(float(score), TUNING.score_ceiling), {plane: centre}))
    else:
        a, b = peaks["a"], peaks["b"]
        apart = expected["b"] - expected["a"]
        # Once B's are moved back by the expected motion.
        source_a, source_b = a.image.projection.source, b.image.projection.source - apart
        tolerance_m = TUNING.ray_tolerance_m + slack_m
        best = _joined(a, b, source_a, source_b, expected["a"], covariance, tolerance_m, count)
        for score, on_a, on_b in zip(*best, strict=True):
            found.append(SearchCandidate(float(score), {"a": on_a, "b": on_b + apart}))
    return sorted(found, key=lambda c: -c.score)[:count]


def _joined(
    a: Peaks,
    b: Peaks,
    source_a: Array,
    source_b: Array,
    expected: Array,
    covariance: Array,
    tolerance_m: float,
    count: int,
) -> tuple[Array, Array, Array]:
    """The best pairs of both planes' peaks.

    Args:
        a: K of plane A's.
        b: M of plane B's.
        source_a: (3,) world metres.
        source_b: (3,) likewise, moved back by the expected motion.
        expected: (3,) where the centre is expected.
        covariance: (3, 3) of that, m².
        tolerance_m: rays that pass each other by less meet.
        count: how many pairs at most.

    Returns:
        (N,) scores, highest first; (N, 3) the nearest points on A's rays; (N, 3) on B's.
    """
    if has_kernels():
        from lasso_motion_ros.ring.kernels.search import joined

        best_pairs: tuple[Array, Array, Array] = joined(
            a.scores,
            b.scores,
            a.pixels,
            b.pixels,
            a.image.projection.matrix,
            b.image.projection.matrix,
            source_a,
            source_b,
            expected,
            covariance,
            count,
            TUNING.score_ceiling,
            tolerance_m,
            TUNING.largest_disagreement_m,
            TUNING.disagreement_penalty,
            TUNING.disagreement_scale_m,
        )
        return best_pairs
    rays_a, rays_b = a.image.projection.rays(a.pixels), b.image.projection.rays(b.pixels)
    # Nearest points of every ray of A to every ray of B.
    cosine = rays_a @ rays_b.T
    across = source_b - source_a
    from_a, from_b = rays_a @ across, rays_b @ across
    determinant = np.maximum(1.0 - cosine**2, 1e-6)
    along_a = (from_a[:, None] - cosine * from_b[None]) / determinant
    along_b = (cosine * from_a[:, None] - from_b[None]) / determinant
    # x, y and z first, (3, K, M): sums over them are sums of whole arrays.
    on_a = source_a[:, None, None] + along_a * rays_a.T[:, :, None]
    on_b = source_b[:, None, None] + along_b * rays_b.T[:, None, :]
    apart_there, middle = on_a - on_b, 0.5 * (on_a + on_b) - expected[:, None, None]
    gap = np.sqrt((apart_there * apart_there).sum(axis=0))
    precision = np.linalg.inv(covariance)
    distance = ((precision @ middle.reshape(3, -1)).reshape(middle.shape) * middle).sum(axis=0)
    score = np.minimum(a.scores, TUNING.score_ceiling)[:, None] + np.minimum(b.scores, TUNING.score_ceiling)[None]
    score = score - np.minimum(0.1 * distance, 2.0)
    # Planes that disagree are joined only where nothing better is: they tell of a C-arm that has moved.
    excess = np.maximum(gap - tolerance_m, 0.0)
    penalised = score - TUNING.disagreement_penalty - excess / TUNING.disagreement_scale_m
    score = np.where(excess == 0.0, score, penalised)
    score = np.where(excess < TUNING.largest_disagreement_m, score, -np.inf)
    best = np.argsort(score, axis=None, kind="stable")[::-1][:count]
    best = best[np.isfinite(score.reshape(-1)[best])]
    return score.reshape(-1)[best], on_a.reshape(3, -1)[:, best].T, on_b.reshape(3, -1)[:, best].T


def vertex(before: Image, at: Image, after: Image) -> Array:
    """How far from each value (..., N) the vertex of a parabola through it and its neighbours lies, -0.5 to 0.5."""
    # A peak is not less than its neighbours; where all three are alike, it is as good as any other.
    curvature = np.minimum(before - 2.0 * at + after, np.float32(-1e-30))
    fraction = np.float32(0.5) * (before - after) / curvature
    return np.minimum(np.maximum(fraction, np.float32(-0.5)), np.float32(0.5)).astype(np.float64)


def _on_ray(peaks: Peaks, pixel: Array, near: Array) -> Array:
    """The point on a pixel's ray at another point's depth."""
    projection = peaks.image.projection
    ray = projection.rays(pixel)
    scale = float(projection.depth(near)) / float(ray @ projection.viewing_direction)
    return np.asarray(projection.source + scale * ray)
