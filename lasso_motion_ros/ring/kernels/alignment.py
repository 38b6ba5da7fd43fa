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
        for i in range(counts.size):
            counts[i] = 0
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


@compiled("float32(Array(float32, 2, 'C', readonly=True), float32, float32)")
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
    "UniTuple(float64, 4)(Array(float32, 2, 'C', readonly=True), Array(float64, 2, 'A', readonly=True),"
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
        pattern: (C, L) the template's values.
        column_px_m: a strip's column at a depth of one metre, working pixels.
        smallest_spacing: pixels; points nearer to each other have no direction.
        largest_spacing: pixels; samples further apart do not count for more.
        outlier_sigmas: where Tukey's weight is zero.
        pixels: (L, 2) written: the projected loop.
        tangents: (L, 2) written: its unit tangents.
        spacing: (L,) written: of its points, pixels.
        depth: (L,) written: metres.
        samples: (C, L) written.
        weights: (C, L) written: what each counts.

    Returns:
        Distance between neighbouring columns, pixels; gain; noise; correlation with the pattern.
    """
    columns, length = pattern.shape
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
    flat, wide = values.reshape(-1), np.int32(width)
    last_column, last_row = np.int32(width - 2), np.int32(height - 2)
    density = np.empty(length, np.float32)
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
                column, row = min(np.int32(x), last_column), min(np.int32(y), last_row)
                right, down = x - np.float32(column), y - np.float32(row)
                here = np.uint32(row * wide + column)
                under = here + np.uint32(wide)
                above = flat[here] + (flat[here + np.uint32(1)] - flat[here]) * right
                below = flat[under] + (flat[under + np.uint32(1)] - flat[under]) * right
                samples[j, i] = above + (below - above) * down
        else:
            for j in range(columns):
                samples[j, i] = _beyond(
                    values, at_x + across_x * np.float32(j - half), at_y + across_y * np.float32(j - half)
                )
        density[i] = min(spacing[i], largest_spacing)
    cross, energy = 0.0, 0.0
    for j in range(columns):
        for i in range(length):
            weights[j, i] = density[i]
            cross += density[i] * pattern[j, i] * samples[j, i]
            energy += density[i] * pattern[j, i] * pattern[j, i]
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
        moves: (P, 2, 6, L) written: along and sideways, by the plane's own two shifts, the turn and the stretch.
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
                    moves[p, k, d, i] = across[p, d, 0] * a + across[p, d, 1] * b + across[p, d, 2] * c
                moves[p, k, 2, i] = y * c - z * b
                moves[p, k, 3, i] = z * a - x * c
                moves[p, k, 4, i] = x * b - y * a
                moves[p, k, 5, i] = x * a + y * b + z * c


@compiled(
    "void(Array(float32, 2, 'C', readonly=True), Array(float32, 2, 'C', readonly=True),"
    " Array(float32, 2, 'C', readonly=True), float32[:, :, ::1], float32[:, :, ::1], float64[::1], float64[::1],"
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
        pattern: (C, L) the template's values.
        along: (C, L) their slope along the arc.
        sideways: (C, L) and across it.
        samples: (P, C, L) from the last look.
        weights: (P, C, L) what each counts.
        gains: (P,) of the pattern.
        noise: (P,) of a sample.
        moves: (P, 2, 6, L) from `derivative`.
        noise_correlation: samples that count as one.
        normal: (N, N) written; N = 2 P + 4.
        scores: (N, P, L) written.
    """
    planes, columns, length = samples.shape
    size = 2 * planes + 4
    for r in range(size):
        for q in range(size):
            normal[r, q] = 0.0
        for p in range(planes):
            for i in range(length):
                scores[r, p, i] = 0.0
    aa, ab, bb = np.empty(length, np.float32), np.empty(length, np.float32), np.empty(length, np.float32)
    ra, rb = np.empty(length, np.float32), np.empty(length, np.float32)
    for p in range(planes):
        gain = max(gains[p], 0.3)
        known = 1.0 / (noise[p] * noise[p] * noise_correlation)
        factor = np.float32(gains[p])
        # Sums over the columns, of all points at once. Of loops with few arrays in them the compiler makes vectors.
        for i in range(length):
            aa[i], ab[i], bb[i], ra[i], rb[i] = 0.0, 0.0, 0.0, 0.0, 0.0
        for j in range(columns):
            for i in range(length):
                aa[i] += weights[p, j, i] * along[j, i] * along[j, i]
            for i in range(length):
                ab[i] += weights[p, j, i] * along[j, i] * sideways[j, i]
            for i in range(length):
                bb[i] += weights[p, j, i] * sideways[j, i] * sideways[j, i]
            for i in range(length):
                ra[i] += weights[p, j, i] * along[j, i] * (factor * pattern[j, i] - samples[p, j, i])
            for i in range(length):
                rb[i] += weights[p, j, i] * sideways[j, i] * (factor * pattern[j, i] - samples[p, j, i])
        for r in range(6):
            row = 2 * p + r if r < 2 else size - 6 + r
            for i in range(length):
                scores[row, p, i] = gain * known * (moves[p, 0, r, i] * ra[i] + moves[p, 1, r, i] * rb[i])
            for q in range(r + 1):
                column, total = 2 * p + q if q < 2 else size - 6 + q, 0.0
                for i in range(length):
                    total += moves[p, 0, q, i] * (moves[p, 0, r, i] * aa[i] + moves[p, 1, r, i] * ab[i])
                    total += moves[p, 1, q, i] * (moves[p, 0, r, i] * ab[i] + moves[p, 1, r, i] * bb[i])
                normal[row, column] += gain * gain * known * total
    for r in range(size):
        for q in range(r):
            normal[q, r] = normal[r, q]


@compiled(
    "UniTuple(float64, 2)(float32[:, ::1], float32[:, ::1], Array(float32, 2, 'C', readonly=True),"
    " Array(float32, 2, 'C', readonly=True), float64, int64, float64)"
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


@compiled(
    "UniTuple(float64, 3)(float32[::1], float64[:, ::1], int64, int64, Array(float64, 1, 'C', readonly=True),"
    " Array(boolean, 1, 'C', readonly=True))"
)
def summed(
    values: Image, pixels: Array, width: int, height: int, weights: Array, between: npt.NDArray[np.bool_]
) -> tuple[float, float, float]:
    """What one plane's evidence along the curve comes to: `LoopViews._summed`.

    Args:
        values: (L,) the evidence.
        pixels: (L, 2) where.
        width: of the image, pixels.
        height: likewise.
        weights: (L,) of the electrodes, of sum 1.
        between: (L,) where there is none.

    Returns:
        Its mean at the electrodes, and between them; the share of the weights that lies inside the image.
    """
    shown, share, wire, count = 0.0, 0.0, 0.0, 0
    for n in range(values.size):
        x, y = pixels[n, 0], pixels[n, 1]
        is_inside = 0.0 <= x <= width - 1.0 and 0.0 <= y <= height - 1.0
        shown += weights[n] * values[n]
        if is_inside:
            share += weights[n]
        if between[n]:
            wire += values[n]
            count += 1 if is_inside else 0
    return shown / max(share, 1e-6) if share > 0.0 else 0.0, wire / max(count, 1), share


@compiled("void(float64[:, ::1], float64[:, ::1])")
def _factorise(matrix: Array, factor: Array) -> None:
    """Cholesky's factor (N, N) of a matrix that is positive, written below the diagonal and on it."""
    size = matrix.shape[0]
    for i in range(size):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            factor[i, j] = math.sqrt(total) if i == j else total / factor[j, j]


@compiled("void(float64[:, ::1], float64[::1])")
def _solve(factor: Array, values: Array) -> None:
    """Put the solution of a factorised matrix's equations in the place of their right side (N,)."""
    size = values.size
    for i in range(size):
        for k in range(i):
            values[i] -= factor[i, k] * values[k]
        values[i] /= factor[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            values[i] -= factor[k, i] * values[k]
        values[i] /= factor[i, i]


@compiled("float64[:, ::1](float64[:, ::1])")
def _inverse(matrix: Array) -> Array:
    """(N, N) of a matrix that is positive."""
    size = matrix.shape[0]
    factor, inverse = np.empty((size, size)), np.zeros((size, size))
    _factorise(matrix, factor)
    for i in range(size):
        inverse[i, i] = 1.0
        _solve(factor, inverse[i])
    return inverse


@compiled("float64[:, ::1](float64[:, ::1], float64[:, :, ::1], int64, float64)")
def covariance(normal: Array, scores: Array, segments: int, known: float) -> Array:
    """(N, N) of the parameters, by the noise and by the segments' scatter: `LoopViews.covariance`.

    Args:
        normal: (N, N) the last normal matrix, priors included.
        scores: (N, P, L) the points' shares in the right side.
        segments: of the loop.
        known: segments that the noise alone would tell of.
    """
    size, planes, length = scores.shape
    clusters = planes * segments
    sums = np.zeros((size, clusters))
    for i in range(size):
        for p in range(planes):
            for segment in range(segments):
                for at in range(segment * length // segments, (segment + 1) * length // segments):
                    sums[i, p * segments + segment] += scores[i, p, at]
        mean = 0.0
        for c in range(clusters):
            mean += sums[i, c] / clusters
        for c in range(clusters):
            sums[i, c] -= mean
    nominal = _inverse(normal)
    wider, pulled = np.empty(size), np.zeros(clusters)
    for i in range(size):
        # The sandwich's diagonal: squares of what each segment pulls the parameter by.
        for c in range(clusters):
            pulled[c] = 0.0
        for k in range(size):
            for c in range(clusters):
                pulled[c] += nominal[i, k] * sums[k, c]
        scatter = 0.0
        for c in range(clusters):
            scatter += pulled[c] * pulled[c]
        scatter *= clusters / (clusters - size)
        wider[i] = math.sqrt(
            max((known * nominal[i, i] + clusters * scatter) / ((known + clusters) * nominal[i, i]), 1.0)
        )
    for i in range(size):
        for k in range(size):
            nominal[i, k] *= wider[i] * wider[k]
    return nominal


@compiled("void(Array(float64, 2, 'A', readonly=True), float64[::1], float64[:, ::1])")
def _turned(arms: Array, ring: Array, result: Array) -> None:
    """(L, 3) arms, turned and stretched: `rotation_from_vector`."""
    x, y, z = ring[0], ring[1], ring[2]
    angle = math.sqrt(x * x + y * y + z * z)
    first, second = 1.0 - angle * angle / 6.0, 0.5 - angle * angle / 24.0
    if angle >= 1e-4:
        first, second = math.sin(angle) / angle, (1.0 - math.cos(angle)) / (angle * angle)
    size = math.exp(ring[3])
    for i in range(arms.shape[0]):
        a, b, c = arms[i, 0], arms[i, 1], arms[i, 2]
        # a + first · ω × a + second · ω × (ω × a)
        u, v, w = y * c - z * b, z * a - x * c, x * b - y * a
        result[i, 0] = size * (a + first * u + second * (y * w - z * v))
        result[i, 1] = size * (b + first * v + second * (z * u - x * w))
        result[i, 2] = size * (c + first * w + second * (x * v - y * u))


@compiled(
    "Tuple((int64, boolean, float64[:, ::1]))(UniTuple(Array(float32, 2, 'C', readonly=True), 2), float64[:, :, ::1],"
    " float64[:, ::1], Array(float64, 3, 'A', readonly=True), Array(float64, 2, 'A', readonly=True),"
    " Array(float32, 2, 'C', readonly=True), Array(float32, 2, 'C', readonly=True),"
    " Array(float32, 2, 'C', readonly=True), float64[::1], float64[::1], float64[::1], float64[::1],"
    " UniTuple(float64, 3), UniTuple(float64, 3), UniTuple(float64, 2), int64, float64, float64, int64, float64,"
    " float64, float64, float64, float64, int64, float64, float64[:, :, ::1], float64[:, :, ::1], float64[:, ::1],"
    " float64[:, ::1], float64[::1], float32[:, :, ::1], float32[:, :, ::1], float64[::1], float64[::1],"
    " float64[:, ::1], float64[::1])"
)
def descend(
    images: tuple[Image, Image],
    projections: Array,
    centres: Array,
    across: Array,
    arms: Array,
    pattern: Image,
    along: Image,
    sideways: Image,
    columns_px_m: Array,
    usual: Array,
    ring: Array,
    precision: Array,
    limits: tuple[float, float, float],
    hopeless: tuple[float, float, float],
    hope: tuple[float, float],
    renewals: int,
    converged: float,
    ridge: float,
    first_sure_look: int,
    nothing_seen: float,
    smallest_spacing: float,
    largest_spacing: float,
    outlier_sigmas: float,
    noise_correlation: float,
    segments: int,
    nominal_segments: float,
    pixels: Array,
    tangents: Array,
    spacing: Array,
    depth: Array,
    steps: Array,
    samples: Image,
    weights: Image,
    gains: Array,
    noise: Array,
    correlation: Array,
    means: Array,
) -> tuple[int, bool, Array]:
    """Go to where the planes show the loop: `gauss_newton.descend`.

    Args:
        images: the planes' working images; the second is not looked at where there is one plane.
        projections: (P, 3, 4) to their pixels.
        centres: (P, 3) where the loop is taken to be; moved.
        across: (P, 2, 3) unit vectors along which each moves.
        arms: (L, 3) the loop about its centre at the seed pair.
        pattern: (L, C) the template's values.
        along: (L, C) their slope along the arc.
        sideways: (L, C) and across it.
        columns_px_m: (P,) a strip's column at a depth of one metre, working pixels.
        usual: (P,) correlation where the loop is seen.
        ring: (4,) turn and stretch; moved.
        precision: (4,) of their prior.
        limits: of one step: shift, m, turn, rad, and stretch.
        hopeless: likeness, look by look, below which no loop is there.
        hope: a plane's likeness, and rise of it, from which on there may be a loop.
        renewals: of the derivative, at the first looks.
        converged: shift of a step, m, below which no other is needed.
        ridge: damping, relative to the normal matrix.
        first_sure_look: from which on a plane without hope is not waited for.
        nothing_seen: precision of a place that was given up at once, 1/m².
        smallest_spacing: as `look`, like the next two.
        largest_spacing: pixels.
        outlier_sigmas: where Tukey's weight is zero.
        noise_correlation: samples that count as one.
        segments: of the loop, for its covariance.
        nominal_segments: as which the noise counts there.
        pixels: (P, L, 2) written by each look, like all but the last two that follow: see there.
        tangents: (P, L, 2).
        spacing: (P, L).
        depth: (P, L).
        steps: (P,).
        samples: (P, L, C), by the last look alone, like the next.
        weights: (P, L, C).
        gains: (P,).
        noise: (P,).
        correlation: (2, P) written: at the last look but one, and at the last.
        means: (looks,) written: mean of the planes' correlations, look by look.

    Returns:
        Number of looks; whether it was given up; covariance of the parameters (N, N).
    """
    planes, length = depth.shape
    size, shared = 2 * planes + 4, 2 * planes
    normal, factor, step = np.zeros((size, size)), np.empty((size, size)), np.empty(size)
    moves, scores, turned = np.empty((planes, 2, 6, length)), np.empty((size, planes, length)), np.empty((length, 3))
    # Column by column: what is done with all points of one is done at once.
    columns = pattern.shape[1]
    wanted, slopes = np.empty((columns, length), np.float32), np.empty((2, columns, length), np.float32)
    shown, counted = np.empty((planes, columns, length), np.float32), np.empty((planes, columns, length), np.float32)
    for i in range(length):
        for j in range(columns):
            wanted[j, i], slopes[0, j, i], slopes[1, j, i] = pattern[i, j], along[i, j], sideways[i, j]
    for i in range(size):
        normal[i, i] = nothing_seen if i < shared else precision[i - shared]
    usually = 0.0
    for p in range(planes):
        correlation[0, p], correlation[1, p] = 0.0, 0.0
        usually += usual[p] / planes
    looks, is_given_up = 0, False
    while looks < means.size:
        _turned(arms, ring, turned)
        means[looks] = 0.0
        for p in range(planes):
            correlation[0, p] = correlation[1, p]
            steps[p], gains[p], noise[p], correlation[1, p] = look(
                images[p],
                projections[p],
                centres[p],
                turned,
                wanted,
                columns_px_m[p],
                smallest_spacing,
                largest_spacing,
                outlier_sigmas,
                pixels[p],
                tangents[p],
                spacing[p],
                depth[p],
                shown[p],
                counted[p],
            )
            means[looks] += correlation[1, p] / planes
        looks += 1
        if looks <= len(hopeless) and means[looks - 1] < hopeless[looks - 1] * usually:
            is_given_up = True
            break
        # The derivative changes little on the way; the residual is what has to be exact.
        if looks <= renewals:
            derivative(pixels, tangents, spacing, depth, steps, projections, across, turned, moves)
        equations(wanted, slopes[0], slopes[1], shown, counted, gains, noise, moves, noise_correlation, normal, scores)
        trace = 0.0
        for i in range(size):
            step[i] = 0.0
            for p in range(planes):
                for k in range(length):
                    step[i] += scores[i, p, k]
            if i >= shared:
                normal[i, i] += precision[i - shared]
                step[i] -= precision[i - shared] * ring[i - shared]
            trace += normal[i, i]
        for i in range(size):
            normal[i, i] += ridge * trace
        _factorise(normal, factor)
        _solve(factor, step)
        is_done = True
        for i in range(size):
            limit = limits[0] if i < shared else (limits[1] if i < size - 1 else limits[2])
            step[i] = min(max(step[i], -limit), limit)
            p = i // 2
            if i >= shared:
                ring[i - shared] += step[i]
            else:
                for k in range(3):
                    centres[p, k] += step[i] * across[p, i % 2, k]
                likeness = correlation[1, p] / usual[p]
                is_hopeful = likeness >= hope[0] or likeness >= correlation[0, p] / usual[p] + hope[1]
                if looks > first_sure_look and not is_hopeful:
                    continue
            # A turn or stretch that was cut to its limit is not done, though the shifts may be.
            is_small = abs(step[i]) < (converged if i < shared else limit)
            is_done = is_done and is_small and abs(step[i]) < limit
        if is_done:
            break
    for p in range(planes):
        for i in range(length):
            for j in range(columns):
                samples[p, i, j], weights[p, i, j] = shown[p, j, i], counted[p, j, i]
    if is_given_up:
        return looks, True, _inverse(normal)
    return looks, False, covariance(normal, scores, segments, nominal_segments)
