"""What the search does besides its correlations, compiled: see `core/compiled.py`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.float32]
Marks = npt.NDArray[np.uint8]


@compiled(
    "Tuple((float32[:, ::1], int64, int64))(Array(float32, 2, 'A', readonly=True),"
    " Array(float32, 3, 'A', readonly=True), Array(float64, 1, 'A', readonly=True), float64)"
)
def rendered(values: Image, coordinates: Image, spacing: Array, cell_px: float) -> tuple[Image, int, int]:
    """A strip's values laid back into the image plane: `strip.render`.

    Args:
        values: (L, C) the template's.
        coordinates: (2, L, C) where they lie, x and y, working pixels.
        spacing: (L,) of the curve's points, working pixels.
        cell_px: size of a search cell, working pixels.

    Returns:
        (h, w) kernel of zero mean and unit norm; the cell, x and y, of its first element.
    """
    length, columns = values.shape
    scale, offset = np.float32(cell_px), np.float32(0.5 / cell_px - 0.5)
    left, top = np.inf, np.inf
    right, bottom = -np.inf, -np.inf
    for i in range(length):
        for j in range(columns):
            x, y = coordinates[0, i, j] / scale + offset, coordinates[1, i, j] / scale + offset
            left, right, top, bottom = min(left, x), max(right, x), min(top, y), max(bottom, y)
    first_column, first_row = math.floor(left) - 1, math.floor(top) - 1
    width, height = math.floor(right) + 3 - first_column, math.floor(bottom) + 3 - first_row
    weight, weighted = np.zeros((height, width)), np.zeros((height, width))
    for i in range(length):
        density = min(spacing[i], 2.0 * cell_px)
        for j in range(columns):
            x, y = coordinates[0, i, j] / scale + offset, coordinates[1, i, j] / scale + offset
            column, row = math.floor(x), math.floor(y)
            # Each sample is shared out among the four cells about it.
            beside, down = density * (x - column), y - row
            here, up = density - beside, 1.0 - down
            at_column, at_row, value = int(column) - first_column, int(row) - first_row, values[i, j]
            weight[at_row, at_column] += here * up
            weight[at_row, at_column + 1] += beside * up
            weight[at_row + 1, at_column] += here * down
            weight[at_row + 1, at_column + 1] += beside * down
            weighted[at_row, at_column] += here * up * value
            weighted[at_row, at_column + 1] += beside * up * value
            weighted[at_row + 1, at_column] += here * down * value
            weighted[at_row + 1, at_column + 1] += beside * down * value
    largest = 0.0
    for i in range(height):
        for j in range(width):
            largest = max(largest, weight[i, j])
    total, area = 0.0, 0.0
    for i in range(height):
        for j in range(width):
            # Where both sides of an edge-on loop overlap, their strips are averaged rather than added.
            full = max(weight[i, j], 0.25 * largest)
            weighted[i, j] /= full
            weight[i, j] /= full
            total += weighted[i, j]
            area += weight[i, j]
    mean, power = total / area, 0.0
    for i in range(height):
        for j in range(width):
            weighted[i, j] -= mean * weight[i, j]
            power += weighted[i, j] * weighted[i, j]
    norm = max(math.sqrt(power), 1e-12)
    made = np.empty((height, width), np.float32)
    for i in range(height):
        for j in range(width):
            made[i, j] = weighted[i, j] / norm
    return made, first_column, first_row


@compiled(
    "Tuple((float32[:, ::1], int64, int64))(Array(float32, 2, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True), Array(float64, 1, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True), float64, float64, float64)"
)
def laid_out(
    values: Image,
    projection: Array,
    centre: Array,
    arms: Array,
    column_px_m: float,
    smallest_spacing: float,
    cell_px: float,
) -> tuple[Image, int, int]:
    """A template laid into the image plane along a curve: `strip.strip_along` and `strip.render`.

    Args:
        values: (L, C) the template's.
        projection: (3, 4) to working pixels.
        centre: (3,) of the loop, world metres.
        arms: (L, 3) the loop about it.
        column_px_m: a strip's column at a depth of one metre, working pixels.
        smallest_spacing: pixels; points nearer to each other have no direction.
        cell_px: size of a search cell, working pixels.

    Returns:
        As `rendered`.
    """
    length, columns = values.shape
    pixels, spacing, mean_depth = np.empty((length, 2)), np.empty(length), 0.0
    for i in range(length):
        x, y, z = centre[0] + arms[i, 0], centre[1] + arms[i, 1], centre[2] + arms[i, 2]
        depth = projection[2, 0] * x + projection[2, 1] * y + projection[2, 2] * z + projection[2, 3]
        for k in range(2):
            along = projection[k, 0] * x + projection[k, 1] * y + projection[k, 2] * z + projection[k, 3]
            pixels[i, k] = along / depth
        mean_depth += depth / length
    step = column_px_m / mean_depth
    coordinates = np.empty((2, length, columns), np.float32)
    for i in range(length):
        # Central differences, one-sided at the ends.
        first, last = max(i - 1, 0), min(i + 1, length - 1)
        share = 1.0 / (last - first)
        along_x, along_y = share * (pixels[last, 0] - pixels[first, 0]), share * (pixels[last, 1] - pixels[first, 1])
        spacing[i] = math.sqrt(along_x * along_x + along_y * along_y)
        scale = step / max(spacing[i], smallest_spacing)
        across_x, across_y = np.float32(-scale * along_y), np.float32(scale * along_x)
        at_x, at_y = np.float32(pixels[i, 0]), np.float32(pixels[i, 1])
        for j in range(columns):
            coordinates[0, i, j] = at_x + across_x * np.float32(j - columns // 2)
            coordinates[1, i, j] = at_y + across_y * np.float32(j - columns // 2)
    made, column, row = rendered(values, coordinates, spacing, cell_px)
    return made, column, row


@compiled(
    "float64(Array(float64, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True),"
    " Array(float64, 1, 'A', readonly=True), Array(float64, 1, 'A', readonly=True),"
    " Array(float32, 1, 'A', readonly=True), int64, int64)"
)
def covered(
    projection: Array, arms: Array, centre: Array, shift: Array, weights: Image, width: int, height: int
) -> float:
    """Share of the ring's electrodes that lie inside an image: `RingDetector._covers`.

    Args:
        projection: (3, 4) to the image's pixels.
        arms: (L, 3) the ring about its centre, metres.
        centre: (3,) world metres.
        shift: (2,) pixels by which the image lies off its calibration.
        weights: (L,) of the ring's points: where its electrodes are.
        width: of the image, pixels.
        height: likewise.
    """
    share = 0.0
    for n in range(arms.shape[0]):
        x, y, z = centre[0] + arms[n, 0], centre[1] + arms[n, 1], centre[2] + arms[n, 2]
        depth = projection[2, 0] * x + projection[2, 1] * y + projection[2, 2] * z + projection[2, 3]
        u = (projection[0, 0] * x + projection[0, 1] * y + projection[0, 2] * z + projection[0, 3]) / depth + shift[0]
        v = (projection[1, 0] * x + projection[1, 1] * y + projection[1, 2] * z + projection[1, 3]) / depth + shift[1]
        if 0.0 <= u <= width - 1 and 0.0 <= v <= height - 1:
            share += weights[n]
    return share


@compiled(
    "boolean(Array(float64, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True),"
    " Array(float64, 1, 'A', readonly=True), float64, int64, int64)"
)
def is_inside(projection: Array, arms: Array, centre: Array, edge: float, width: int, height: int) -> bool:
    """Whether a ring lies inside an image, and so far from its edge: `RingDetector._is_shown`.

    Args:
        projection: (3, 4) to the image's pixels.
        arms: (L, 3) the ring about its centre, metres.
        centre: (3,) world metres.
        edge: pixels.
        width: of the image, pixels.
        height: likewise.
    """
    for n in range(arms.shape[0]):
        x, y, z = centre[0] + arms[n, 0], centre[1] + arms[n, 1], centre[2] + arms[n, 2]
        depth = projection[2, 0] * x + projection[2, 1] * y + projection[2, 2] * z + projection[2, 3]
        u = (projection[0, 0] * x + projection[0, 1] * y + projection[0, 2] * z + projection[0, 3]) / depth
        v = (projection[1, 0] * x + projection[1, 1] * y + projection[1, 2] * z + projection[1, 3]) / depth
        if not (edge <= u <= width - 1 - edge and edge <= v <= height - 1 - edge):
            return False
    return True


@compiled("float64(float32, float32, float32)")
def vertex(before: float, at: float, after: float) -> float:
    """`search.vertex` of one value and its neighbours."""
    curvature = min(before - np.float32(2.0) * at + after, np.float32(-1e-30))
    fraction = np.float32(0.5) * (before - after) / curvature
    return float(min(max(fraction, np.float32(-0.5)), np.float32(0.5)))


@compiled("float64(float32[::1])")
def _power(row: Image) -> float:
    """Sum of a row's squares."""
    total = 0.0
    for j in range(row.size):
        total += row[j] * row[j]
    return total


@compiled("void(float32[::1], float32[::1], float32[::1], float32, uint8[::1])")
def _mark_crests(above: Image, row: Image, below: Image, least: np.float32, marks: Marks) -> None:
    """Mark what is neither less than its four neighbours in a map nor than some value.

    Args:
        above: (w,) a row of the map.
        row: (w,) the next.
        below: (w,) and the next.
        least: the value.
        marks: (w,) written but for its ends.
    """
    for j in range(1, row.size - 1):
        value = row[j]
        marks[j] = (
            (value >= least) & (value >= row[j + 1]) & (value >= below[j]) & (value >= row[j - 1]) & (value >= above[j])
        )


@compiled("Tuple((float64[::1], float64[:, ::1]))(float32[:, ::1], int64, int64, int64, int64)")
def highest(scores: Image, width: int, height: int, count: int, radius: int) -> tuple[Array, Array]:
    """The highest local maxima of a map that is the upper left corner of a larger one: `search._highest`.

    Args:
        scores: (m, n) the larger one.
        width: of the map.
        height: likewise.
        count: how many at most.
        radius: each is the highest within it, along both axes.

    Returns:
        (K,) in units of the map's root mean square, highest first; (K, 2) their places x and y, to a fraction.
    """
    power = 0.0
    for i in range(height):
        power += _power(scores[i, :width])
    scale = np.float32(1.0 / max(math.sqrt(power / (width * height)), 1e-6))
    values, rows, columns = np.empty(count, np.float32), np.empty(count, np.int64), np.empty(count, np.int64)
    kept = 0
    # Most of a map is no crest: eight of its cells are passed over at once.
    eights = np.zeros((width + 7) // 8, np.uint64)
    marks = eights.view(np.uint8)
    for i in range(1, height - 1):
        row = scores[i, :width]
        above, below = scores[i - 1, :width], scores[i + 1, :width]
        _mark_crests(above, row, below, values[count - 1] if kept == count else np.float32(-np.inf), marks)
        for eight in range(eights.size):
            if eights[eight] == 0:
                continue
            for j in range(8 * eight, 8 * eight + 8):
                if not marks[j] or (kept == count and row[j] < values[count - 1]):
                    continue
                value, is_peak = row[j], True
                for k in range(max(i - radius, 0), min(i + radius + 1, height)):
                    other = scores[k, :width]
                    for m in range(max(j - radius, 0), min(j + radius + 1, width)):
                        is_peak = is_peak and other[m] <= value
                    if not is_peak:
                        break
                if not is_peak:
                    continue
                # Sorted in, before those that are alike.
                place = min(kept, count - 1)
                kept = min(kept + 1, count)
                while place > 0 and values[place - 1] <= value:
                    values[place], rows[place], columns[place] = values[place - 1], rows[place - 1], columns[place - 1]
                    place -= 1
                values[place], rows[place], columns[place] = value, i, j
    found, places = np.empty(kept), np.empty((kept, 2))
    for n in range(kept):
        i, j = rows[n], columns[n]
        found[n] = scale * values[n]
        places[n, 0] = j + vertex(scale * scores[i, j - 1], scale * scores[i, j], scale * scores[i, j + 1])
        places[n, 1] = i + vertex(scale * scores[i - 1, j], scale * scores[i, j], scale * scores[i + 1, j])
    return found, places


@compiled("float64[:, ::1](Array(float64, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True))")
def _rays(projection: Array, pixels: Array) -> Array:
    """(N, 3) unit directions from the source through pixels (N, 2): `Projection.rays`."""
    m, rays = projection, np.empty((pixels.shape[0], 3))
    for n in range(pixels.shape[0]):
        x, y = pixels[n, 0], pixels[n, 1]
        # Where both planes meet that the pixel's column and its row span with the source.
        a, b, c = m[0, 0] - x * m[2, 0], m[0, 1] - x * m[2, 1], m[0, 2] - x * m[2, 2]
        d, e, f = m[1, 0] - y * m[2, 0], m[1, 1] - y * m[2, 1], m[1, 2] - y * m[2, 2]
        u, v, w = b * f - c * e, c * d - a * f, a * e - b * d
        depth = m[2, 0] * u + m[2, 1] * v + m[2, 2] * w
        norm = math.copysign(math.sqrt(u * u + v * v + w * w), depth)  # in front of the source
        rays[n, 0], rays[n, 1], rays[n, 2] = u / norm, v / norm, w / norm
    return rays


@compiled("float64[:, ::1](Array(float64, 2, 'A', readonly=True))")
def _inverse(matrix: Array) -> Array:
    """Of a symmetric (3, 3) one, by its cofactors."""
    made = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            a, b, c, d = (j + 1) % 3, (j + 2) % 3, (i + 1) % 3, (i + 2) % 3
            made[i, j] = matrix[a, c] * matrix[b, d] - matrix[a, d] * matrix[b, c]
    determinant = matrix[0, 0] * made[0, 0] + matrix[0, 1] * made[1, 0] + matrix[0, 2] * made[2, 0]
    for i in range(3):
        for j in range(3):
            made[i, j] /= determinant
    return made


@compiled(
    "Tuple((float64[::1], float64[:, ::1], float64[:, ::1]))(float64[::1], float64[::1],"
    " Array(float64, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True),"
    " Array(float64, 2, 'A', readonly=True), Array(float64, 2, 'A', readonly=True),"
    " Array(float64, 1, 'A', readonly=True), Array(float64, 1, 'A', readonly=True),"
    " Array(float64, 1, 'A', readonly=True), Array(float64, 2, 'A', readonly=True), int64, float64, float64, float64,"
    " float64, float64)"
)
def joined(
    scores_a: Array,
    scores_b: Array,
    pixels_a: Array,
    pixels_b: Array,
    projection_a: Array,
    projection_b: Array,
    source_a: Array,
    source_b: Array,
    expected: Array,
    covariance: Array,
    count: int,
    score_ceiling: float,
    tolerance_m: float,
    largest_disagreement_m: float,
    disagreement_penalty: float,
    disagreement_scale_m: float,
) -> tuple[Array, Array, Array]:
    """The best pairs of both planes' peaks: `search._joined`.

    Args:
        scores_a: (K,) of plane A's peaks.
        scores_b: (M,) of plane B's.
        pixels_a: (K, 2) of plane A's, working pixels.
        pixels_b: (M, 2) of plane B's.
        projection_a: (3, 4) to plane A's working pixels.
        projection_b: (3, 4) to plane B's.
        source_a: (3,) world metres.
        source_b: (3,) likewise, moved back by the expected motion.
        expected: (3,) where the centre is expected.
        covariance: (3, 3) of that, m².
        count: how many pairs at most.
        score_ceiling: of a plane.
        tolerance_m: rays that pass each other by less meet.
        largest_disagreement_m: beyond the tolerance; what passes further off is no pair.
        disagreement_penalty: of what does not meet,
        disagreement_scale_m: and one more for each of these.

    Returns:
        (N,) scores, highest first; (N, 3) the nearest points on A's rays; (N, 3) on B's.
    """
    rays_a, rays_b = _rays(projection_a, pixels_a), _rays(projection_b, pixels_b)
    precision = _inverse(covariance)
    best, found_a, found_b = np.empty(count), np.empty((count, 3)), np.empty((count, 3))
    kept = 0
    on_a, on_b, off = np.empty(3), np.empty(3), np.empty(3)
    for i in range(scores_a.size):
        for j in range(scores_b.size):
            cosine, from_a, from_b = 0.0, 0.0, 0.0
            for k in range(3):
                across = source_b[k] - source_a[k]
                cosine += rays_a[i, k] * rays_b[j, k]
                from_a += rays_a[i, k] * across
                from_b += rays_b[j, k] * across
            determinant = max(1.0 - cosine * cosine, 1e-6)
            along_a, along_b = (from_a - cosine * from_b) / determinant, (cosine * from_a - from_b) / determinant
            gap, distance = 0.0, 0.0
            for k in range(3):
                on_a[k], on_b[k] = source_a[k] + along_a * rays_a[i, k], source_b[k] + along_b * rays_b[j, k]
                gap += (on_a[k] - on_b[k]) ** 2
                off[k] = 0.5 * (on_a[k] + on_b[k]) - expected[k]
            excess = max(math.sqrt(gap) - tolerance_m, 0.0)
            if not excess < largest_disagreement_m:
                continue
            for k in range(3):
                distance += off[k] * (precision[k, 0] * off[0] + precision[k, 1] * off[1] + precision[k, 2] * off[2])
            score = min(scores_a[i], score_ceiling) + min(scores_b[j], score_ceiling) - min(0.1 * distance, 2.0)
            if excess > 0.0:
                score -= disagreement_penalty + excess / disagreement_scale_m
            if kept == count and score < best[count - 1]:
                continue
            # Sorted in, before those that are alike.
            place = min(kept, count - 1)
            kept = min(kept + 1, count)
            while place > 0 and best[place - 1] <= score:
                best[place] = best[place - 1]
                for k in range(3):
                    found_a[place, k], found_b[place, k] = found_a[place - 1, k], found_b[place - 1, k]
                place -= 1
            best[place] = score
            for k in range(3):
                found_a[place, k], found_b[place, k] = on_a[k], on_b[k]
    return best[:kept], found_a[:kept], found_b[:kept]


@compiled("void(float32[:, ::1], float32[:, ::1])")
def multiply(one: Image, other: Image) -> None:
    """A real image's transform (h, w), times the complex conjugate of another one's, in place: `correlation._product`.

    As `cv2.dft` packs them: real and imaginary parts stand side by side in rows, but for the first column, and the last
    one where there is an even number. These are real for the first frequency, and the last one of an even number;
    between them the parts stand one below the other. Rounded once, as there.
    """
    rows, columns = one.shape
    for i in range(rows):
        for k in range((columns - 1) // 2):
            j = 2 * k + 1
            a, b = np.float64(one[i, j]), np.float64(one[i, j + 1])
            c, d = np.float64(other[i, j]), np.float64(other[i, j + 1])
            one[i, j], one[i, j + 1] = a * c + b * d, b * c - a * d
    for side in range(1 + (columns + 1) % 2):
        j = side * (columns - 1)
        one[0, j] *= other[0, j]
        for i in range(1, rows - 1, 2):
            a, b = np.float64(one[i, j]), np.float64(one[i + 1, j])
            c, d = np.float64(other[i, j]), np.float64(other[i + 1, j])
            one[i, j], one[i + 1, j] = a * c + b * d, b * c - a * d
        if rows % 2 == 0:
            one[rows - 1, j] *= other[rows - 1, j]
