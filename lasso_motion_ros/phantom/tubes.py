"""Thin things: the optical depth of many flat-ended cylinders, each computed only on the pixels it can reach.

A catheter is a chain of short cylinders along its curve, an electrode one cylinder; ribs and lung vessels are chains
too. Each pixel is the mean over sub-pixel rays of the exact chord, so that a line thinner than a pixel keeps its mass.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.projection import Projection

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

BATCH_PIXELS = 24_000


@dataclass(frozen=True, eq=False)
class Segments:
    """Flat-ended circular cylinders.

    Attributes:
        start: (S, 3) centre of one end, world metres.
        end: (S, 3) centre of the other.
        radius: (S,) metres.
        attenuation: (S,) linear attenuation added along the chord, 1/m (may be negative: air in tissue).
    """

    start: Array
    end: Array
    radius: Array
    attenuation: Array

    def __len__(self) -> int:
        return len(self.radius)

    def moved_by(self, start_shift: Array, end_shift: Array) -> Segments:
        """The segments with their ends displaced by (S, 3) metres each."""
        return Segments(self.start + start_shift, self.end + end_shift, self.radius, self.attenuation)


def chain(points: Array, radius: float, attenuation: float) -> Segments:
    """Segments joining the points (N, 3) of a curve, N − 1 of them."""
    count = len(points) - 1
    return Segments(points[:-1], points[1:], np.full(count, radius), np.full(count, attenuation))


def joined(parts: list[Segments]) -> Segments:
    """All segments of several lists in one."""
    if not parts:
        return Segments(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    return Segments(
        np.concatenate([part.start for part in parts]),
        np.concatenate([part.end for part in parts]),
        np.concatenate([part.radius for part in parts]),
        np.concatenate([part.attenuation for part in parts]),
    )


def optical_depth(projection: Projection, segments: Segments, supersampling: int = 2) -> Array:
    """Line integral of the segments' attenuation through every pixel, (H, W), dimensionless.

    Args:
        projection: world to the image's pixels.
        segments: what the rays pass through; where segments overlap they add.
        supersampling: rays per pixel and direction.
    """
    height, width = projection.height, projection.width
    image = np.zeros(height * width)
    if len(segments) == 0:
        return image.reshape(height, width)
    ends = np.stack([projection.project(segments.start), projection.project(segments.end)])
    nearest = np.minimum(projection.depth(segments.start), projection.depth(segments.end)) - segments.radius
    reach = segments.radius * projection.focal_length_px / np.maximum(nearest, 1e-3) + 1.0
    low: Indices = np.floor(ends.min(axis=0) - reach[:, None]).astype(np.int64)
    high = np.ceil(ends.max(axis=0) + reach[:, None]).astype(np.int64)
    visible = (nearest > 0.01) & np.all(high >= 0, axis=1) & (low[:, 0] < width) & (low[:, 1] < height)
    side = (high - low + 1).max(axis=1)
    # Equal patches are computed together; sizes in steps of √2 keep the waste small and the batches few.
    group = np.ceil(2.0 * np.log2(side)).astype(np.int64)
    inverse: Array = np.asarray(np.linalg.inv(projection.matrix[:, :3]), dtype=np.float64)
    for size_class in np.unique(group[visible]):
        members: Indices = np.flatnonzero(visible & (group == size_class)).astype(np.int64)
        patch = int(side[members].max())
        step = max(1, BATCH_PIXELS // patch**2)
        for first in range(0, len(members), step):
            batch = members[first : first + step]
            owner, columns, rows = _reached(ends[:, batch], reach[batch], low[batch], patch)
            inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
            owner, columns, rows = owner[inside], columns[inside], rows[inside]
            depth = _chords(projection.source, inverse, segments, batch[owner], columns, rows, supersampling)
            image += np.bincount(rows * width + columns, weights=depth, minlength=height * width)
    return image.reshape(height, width)


def _reached(ends: Array, reach: Array, low: Indices, patch: int) -> tuple[Indices, Indices, Indices]:
    """Pixels that rays through these segments can lie in: number of the segment, column and row, (K,) each.

    Args:
        ends: (2, B, 2) the segments' projected ends, pixels.
        reach: (B,) how far from the line between them a segment is seen, pixels.
        low: (B, 2) first column and row of each segment's patch.
        patch: side of the patches, pixels.
    """
    along = ends[1] - ends[0]
    squared = np.maximum(np.einsum("si,si->s", along, along), 1e-12)
    side = np.arange(patch)
    x = (low[:, 0, None] + side - ends[0, :, 0, None])[:, None, :]
    y = (low[:, 1, None] + side - ends[0, :, 1, None])[:, :, None]
    share = np.clip((x * along[:, 0, None, None] + y * along[:, 1, None, None]) / squared[:, None, None], 0.0, 1.0)
    x = x - share * along[:, 0, None, None]
    y = y - share * along[:, 1, None, None]
    # `reach` has a pixel to spare: sub-pixel rays lie up to √½ px from their pixel's centre.
    limit = reach**2
    owner, row, column = np.nonzero(x * x + y * y <= limit[:, None, None])
    return owner, low[owner, 0] + column, low[owner, 1] + row


def _chords(
    source: Array,
    inverse: Array,
    segments: Segments,
    owner: Indices,
    columns: Indices,
    rows: Indices,
    supersampling: int,
) -> Array:
    """(K,) optical depth of one segment in one pixel each: segment `owner`, pixel (column, row)."""
    axis = segments.end - segments.start
    length = np.linalg.norm(axis, axis=1)
    axis = axis / np.maximum(length, 1e-12)[:, None]
    to_source = source - 0.5 * (segments.start + segments.end)
    along_source = np.einsum("si,si->s", to_source, axis)
    perpendicular = np.einsum("si,si->s", to_source, to_source) - along_source**2
    offset = (np.arange(supersampling) + 0.5) / supersampling - 0.5
    u = columns + offset[None, :, None]
    v = rows + offset[:, None, None]
    # A pixel's ray is inverse·(u, v, 1): its products with fixed vectors are linear in u and v.
    norm_form = inverse.T @ inverse
    norm = np.sqrt(
        norm_form[0, 0] * u * u + norm_form[1, 1] * v * v + norm_form[2, 2]
        + 2.0 * (norm_form[0, 1] * u * v + norm_form[0, 2] * u + norm_form[1, 2] * v)
    )  # fmt: skip
    along = _linear((axis @ inverse)[owner], u, v) / norm
    towards = _linear((to_source @ inverse)[owner], u, v) / norm
    across = np.maximum(1.0 - along * along, 1e-12)
    along_source = along_source[owner]
    product = towards - along_source * along
    squared_distance = perpendicular[owner] - product * product / across
    radius = segments.radius[owner]
    half = np.sqrt(np.maximum(radius * radius - squared_distance, 0.0) / across)
    middle = -product / across
    safe = np.where(np.abs(along) > 1e-12, along, 1e-12)
    slab_middle = -along_source / safe
    slab_half = 0.5 * length[owner] / np.abs(safe)
    chord = np.minimum(middle + half, slab_middle + slab_half) - np.maximum(middle - half, slab_middle - slab_half)
    chord = np.where(half > 0.0, np.maximum(chord, 0.0), 0.0)
    return np.asarray(chord.mean(axis=(0, 1)) * segments.attenuation[owner])


def _linear(coefficients: Array, u: Array, v: Array) -> Array:
    return np.asarray(coefficients[:, 0] * u + coefficients[:, 1] * v + coefficients[:, 2])
