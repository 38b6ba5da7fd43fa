"""What `loop_views` asks of the planes' samples, compiled: see `core/compiled.py`.

Here a sample is dealt with once from the image to the sums, while it is at hand.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.float32]


@compiled("float32(float32[:, ::1])")
def _upper_median(values: Image) -> np.float32:
    """The middle one of values that are not negative, or the upper one of two.

    Such numbers are in the order of their bits: they are counted by ten bits, and those of the middle's ten by the next
    eleven, and so on. That needs no branch, and takes a third of the time of a partition.
    """
    bits = values.reshape(-1).view(np.int32)
    counts = np.empty(2048, np.int32)
    rank = bits.size // 2
    for shift, kept in ((21, 2047), (10, 2047), (0, 1023)):
        counts[:] = 0
        for i in range(bits.size):
            counts[(bits[i] >> shift) & kept] += 1
        place = 0
        while rank >= counts[place]:
            rank -= counts[place]
            place += 1
        among = np.empty(counts[place], np.int32)
        count = 0
        for i in range(bits.size):
            if (bits[i] >> shift) & kept == place:
                among[count] = bits[i]
                count += 1
        bits = among
    middle: np.float32 = bits.view(np.float32)[0]
    return middle


@compiled("float32(Array(float32, 2, 'A', readonly=True), float32, float32)")
def _beyond(values: Image, x: np.float32, y: np.float32) -> np.float32:
    """Value between the pixels at the border or beyond it; those outside the image are zero."""
    height, width = values.shape
    total = np.float32(0.0)
    if not (x > -1.0 and y > -1.0 and x < width and y < height):
        return total
    column, row = math.floor(x), math.floor(y)
    right, down = x - np.float32(column), y - np.float32(row)
    for below in range(2):
        for after in range(2):
            if 0 <= row + below < height and 0 <= column + after < width:
                share = (down if below else np.float32(1.0) - down) * (right if after else np.float32(1.0) - right)
                total += share * values[row + below, column + after]
    return total


@compiled(
    "UniTuple(float64, 4)(Array(float32, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True),"
    " Array(float64, 1, 'A', readonly=True), Array(float64, 2, 'A', readonly=True),"
    " Array(float32, 2, 'C', readonly=True), float64, float64, float64, float64, float64[:, ::1], float64[:, ::1],"
    " float64[::1], float64[::1], float32[:, ::1], float32[:, ::1])"
)
def look(
    values: Image,
    projection: Array,
    centre: Array,
    arms: Array,
    pattern: Image,
    column_px_m: float,
    smallest_spacing: float,
    largest_spacing: float,
    outlier_sigmas: float,
    pixels: Array,
    tangents: Array,
    spacing: Array,
    depth: Array,
    samples: Image,
    weights: Image,
) -> tuple[float, float, float, float]:
    """Sample one plane along the loop, and compare that with the pattern: `LoopViews.look`.

    Args:
        values: (h, w) the working image.
        projection: (3, 4) to its pixels.
        centre: (3,) of the loop, world metres.
        arms: (L, 3) the loop about it.
        pattern: (L, C) the template's values.
        column_px_m: a strip's column at a depth of one metre, working pixels.
        smallest_spacing: pixels; points nearer to each other have no direction.
        largest_spacing: pixels; samples further apart do not count for more.
        outlier_sigmas: where Tukey's weight is zero.
        pixels: (L, 2) written: the projected loop.
        tangents: (L, 2) written: its unit tangents.
        spacing: (L,) written: of its points, pixels.
        depth: (L,) written: metres.
        samples: (L, C) written.
        weights: (L, C) written: what each counts.

    Returns:
        Distance between neighbouring columns, pixels; gain; noise; correlation with the pattern.
    """
    length, columns = pattern.shape
    half = columns // 2
    mean_depth = 0.0
    for i in range(length):
        x, y, z = centre[0] + arms[i, 0], centre[1] + arms[i, 1], centre[2] + arms[i, 2]
        depth[i] = projection[2, 0] * x + projection[2, 1] * y + projection[2, 2] * z + projection[2, 3]
        for k in range(2):
            along = projection[k, 0] * x + projection[k, 1] * y + projection[k, 2] * z + projection[k, 3]
            pixels[i, k] = along / depth[i]
        mean_depth += depth[i] / length
    step = column_px_m / mean_depth
    height, width = values.shape
    cross, energy = 0.0, 0.0
    for i in range(length):
        # Central differences, one-sided at the ends.
        first, last = max(i - 1, 0), min(i + 1, length - 1)
        share = 1.0 / (last - first)
        along_x, along_y = share * (pixels[last, 0] - pixels[first, 0]), share * (pixels[last, 1] - pixels[first, 1])
        spacing[i] = math.sqrt(along_x * along_x + along_y * along_y)
        tangents[i, 0] = along_x / max(spacing[i], smallest_spacing)
        tangents[i, 1] = along_y / max(spacing[i], smallest_spacing)
        at_x, at_y = np.float32(pixels[i, 0]), np.float32(pixels[i, 1])
        across_x, across_y = np.float32(-step * tangents[i, 1]), np.float32(step * tangents[i, 0])
        reach_x, reach_y = half * abs(across_x), half * abs(across_y)
        if at_x > reach_x and at_x + reach_x < width - 1 and at_y > reach_y and at_y + reach_y < height - 1:
            for j in range(columns):
                x, y = at_x + across_x * np.float32(j - half), at_y + across_y * np.float32(j - half)
                # Whole pixels, and no further than the last but one, whatever the rounding.
                column, row = min(np.int32(x), width - 2), min(np.int32(y), height - 2)
                right, down = x - np.float32(column), y - np.float32(row)
                above = values[row, column] + (values[row, column + 1] - values[row, column]) * right
                below = values[row + 1, column] + (values[row + 1, column + 1] - values[row + 1, column]) * right
                samples[i, j] = above + (below - above) * down
        else:
            for j in range(columns):
                samples[i, j] = _beyond(
                    values, at_x + across_x * np.float32(j - half), at_y + across_y * np.float32(j - half)
                )
        density = np.float32(min(spacing[i], largest_spacing))
        for j in range(columns):
            weights[i, j] = density
            cross += density * pattern[i, j] * samples[i, j]
            energy += density * pattern[i, j] * pattern[i, j]
    gain = np.float32(cross / max(energy, 1e-9))
    off = np.empty_like(samples)
    shown, wanted, counted, apart = samples.reshape(-1), pattern.reshape(-1), weights.reshape(-1), off.reshape(-1)
    for i in range(apart.size):
        apart[i] = abs(gain * wanted[i] - shown[i])
    noise = np.float32(1.4826) * _upper_median(off) + np.float32(1e-6)
    limit = np.float32(1.0) / (np.float32(outlier_sigmas) * noise)
    cross, energy, power = 0.0, 0.0, 0.0
    for i in range(apart.size):
        share = max(np.float32(1.0) - (apart[i] * limit) * (apart[i] * limit), np.float32(0.0))
        weight = share * share * counted[i]
        counted[i] = weight
        cross += weight * wanted[i] * shown[i]
        energy += weight * wanted[i] * wanted[i]
        power += weight * shown[i] * shown[i]
    return step, cross / max(energy, 1e-9), float(noise), cross / math.sqrt(max(power * energy, 1e-12))


@compiled(
    "void(float64[:, :, ::1], float64[:, :, ::1], float64[:, ::1], float64[:, ::1], float64[::1],"
    " Array(float64, 3, 'A', readonly=True), Array(float64, 3, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True), float64[:, :, :, ::1])"
)
def derivative(
    pixels: Array,
    tangents: Array,
    spacing: Array,
    depth: Array,
    steps: Array,
    projections: Array,
    across: Array,
    arms: Array,
    moves: Array,
) -> None:
    """By how much each parameter moves each point of the curves, along them and sideways: `LoopViews._derivative`.

    Args:
        pixels: (P, L, 2) the projected loop.
        tangents: (P, L, 2) its unit tangents.
        spacing: (P, L) of its points, pixels.
        depth: (P, L) metres.
        steps: (P,) between the strip's columns, pixels.
        projections: (P, 3, 4) to the pixels.
        across: (P, 2, 3) unit vectors in which each plane's centre moves.
        arms: (L, 3) the loop about its centre.
        moves: (P, L, 2, 6) written: along and sideways, by the plane's own two shifts, the turn and the stretch.
    """
    planes, length = depth.shape
    for p in range(planes):
        m = projections[p]
        for i in range(length):
            for k in range(2):
                if k == 0:
                    u, v, unit = tangents[p, i, 0], tangents[p, i, 1], max(spacing[p, i], 0.05)
                else:
                    u, v, unit = -tangents[p, i, 1], tangents[p, i, 0], steps[p]
                offset = u * pixels[p, i, 0] + v * pixels[p, i, 1]
                scale = 1.0 / (depth[p, i] * unit)
                a = (u * m[0, 0] + v * m[1, 0] - offset * m[2, 0]) * scale
                b = (u * m[0, 1] + v * m[1, 1] - offset * m[2, 1]) * scale
                c = (u * m[0, 2] + v * m[1, 2] - offset * m[2, 2]) * scale
                x, y, z = arms[i, 0], arms[i, 1], arms[i, 2]
                for d in range(2):
                    moves[p, i, k, d] = across[p, d, 0] * a + across[p, d, 1] * b + across[p, d, 2] * c
                moves[p, i, k, 2] = y * c - z * b
                moves[p, i, k, 3] = z * a - x * c
                moves[p, i, k, 4] = x * b - y * a
                moves[p, i, k, 5] = x * a + y * b + z * c


@compiled(
    "void(Array(float32, 2, 'A', readonly=True), Array(float32, 2, 'A', readonly=True),"
    " Array(float32, 2, 'A', readonly=True), float32[:, :, ::1], float32[:, :, ::1], float64[::1], float64[::1],"
    " float64[:, :, :, ::1], float64, float64[:, ::1], float64[:, :, ::1])"
)
def equations(
    pattern: Image,
    along: Image,
    sideways: Image,
    samples: Image,
    weights: Image,
    gains: Array,
    noise: Array,
    moves: Array,
    noise_correlation: float,
    normal: Array,
    scores: Array,
) -> None:
    """Normal matrix and the points' shares in the right side: `LoopViews.equations`.

    Args:
        pattern: (L, C) the template's values.
        along: (L, C) their slope along the arc.
        sideways: (L, C) and across it.
        samples: (P, L, C) from the last look.
        weights: (P, L, C) what each counts.
        gains: (P,) of the pattern.
        noise: (P,) of a sample.
        moves: (P, L, 2, 6) from `derivative`.
        noise_correlation: samples that count as one.
        normal: (N, N) written; N = 2 P + 4.
        scores: (N, P, L) written.
    """
    planes, length, columns = samples.shape
    size = 2 * planes + 4
    normal[:] = 0.0
    scores[:] = 0.0
    for p in range(planes):
        gain = max(gains[p], 0.3)
        known = 1.0 / (noise[p] * noise[p] * noise_correlation)
        factor = np.float32(gains[p])
        for i in range(length):
            aa, ab, bb, ra, rb = 0.0, 0.0, 0.0, 0.0, 0.0
            for j in range(columns):
                weight, a, b = weights[p, i, j], along[i, j], sideways[i, j]
                residual = factor * pattern[i, j] - samples[p, i, j]
                aa += weight * a * a
                ab += weight * a * b
                bb += weight * b * b
                ra += weight * a * residual
                rb += weight * b * residual
            square, right = gain * gain * known, gain * known
            aa, ab, bb, ra, rb = square * aa, square * ab, square * bb, right * ra, right * rb
            for r in range(6):
                row = 2 * p + r if r < 2 else size - 6 + r
                u, v = moves[p, i, 0, r], moves[p, i, 1, r]
                scores[row, p, i] = u * ra + v * rb
                for q in range(r + 1):
                    column = 2 * p + q if q < 2 else size - 6 + q
                    s, t = moves[p, i, 0, q], moves[p, i, 1, q]
                    normal[row, column] += (u * aa + v * ab) * s + (u * ab + v * bb) * t
    for r in range(size):
        for q in range(r):
            normal[q, r] = normal[r, q]


@compiled(
    "UniTuple(float64, 2)(float32[:, ::1], float32[:, ::1], Array(float32, 2, 'A', readonly=True),"
    " Array(float32, 2, 'A', readonly=True), float64, int64, float64)"
)
def seen(
    samples: Image,
    weights: Image,
    pattern: Image,
    sideways: Image,
    gain: float,
    segments: int,
    segment_gain: float,
) -> tuple[float, float]:
    """How much of one plane's loop looks as expected, and how far it lies beside the curve: `LoopViews.fits`.

    Args:
        samples: (L, C) from the last look.
        weights: (L, C) what each counts.
        pattern: (L, C) the template's values.
        sideways: (L, C) their slope across the arc.
        gain: of the pattern.
        segments: of the loop.
        segment_gain: a weaker segment is not seen.

    Returns:
        Share of the loop's segments that look as expected; their mean distance, columns.
    """
    length, columns = samples.shape
    share = np.float32(max(gain, segment_gain))
    visible, total, distance, count = 0.0, 0.0, 0.0, 0
    for segment in range(segments):
        cross, energy, beside, steep = 0.0, 0.0, 0.0, 0.0
        for i in range(segment * length // segments, (segment + 1) * length // segments):
            for j in range(columns):
                weight, value, slope = weights[i, j], pattern[i, j], sideways[i, j]
                cross += weight * value * samples[i, j]
                energy += weight * value * value
                beside += weight * slope * (samples[i, j] - share * value)
                steep += weight * slope * slope
        total += energy
        if cross > segment_gain * energy:
            visible += energy
            step = beside / (share * max(steep, 1e-9))
            distance += min(abs(step), columns // 2)
            count += 1
    return visible / max(total, 1e-9), distance / max(count, 1)
