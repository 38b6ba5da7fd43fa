"""What points say of rings, compiled: see `core/compiled.py`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


@compiled("int64(float64, float64, float64, int64)")
def _cell(at: float, low: float, side_m: float, count: int) -> int:
    """Which of some cells a coordinate is in; what lies beyond them is in the outermost."""
    return min(max(math.floor((at - low) / side_m), 0), count - 1)


@compiled("void(float64[:, ::1], float64[::1], float64, int64, int64[::1], int64[::1])")
def sorted_into_cells(places: Array, low: Array, side_m: float, count: int, starts: Numbers, order: Numbers) -> None:
    """Where the points of each cell are among all, cell by cell: `nearby_points.PointCloud`.

    Args:
        places: (M, 3) m.
        low: (3,) m, of the first cell.
        side_m: of a cell.
        count: of cells along each axis.
        starts: (count³ + 1,) where each cell begins in `order`, filled.
        order: (M,) the points' numbers, rising within a cell, filled.
    """
    of_cell = np.empty(len(places), np.int64)
    starts[:] = 0
    for n in range(len(places)):
        cell = 0
        for i in range(3):
            cell = cell * count + _cell(places[n, i], low[i], side_m, count)
        of_cell[n] = cell
        starts[cell + 1] += 1
    for cell in range(count**3):
        starts[cell + 1] += starts[cell]
    filled = starts.copy()
    for n in range(len(places)):
        order[filled[of_cell[n]]] = n
        filled[of_cell[n]] += 1


@compiled("void(int64[::1], int64)")
def _sort(numbers: Numbers, count: int) -> None:
    """Put the first of some numbers in order (Shell's sort)."""
    gap = 1
    while gap < count // 3:
        gap = 3 * gap + 1
    while gap > 0:
        for n in range(gap, count):
            number, k = numbers[n], n
            while k >= gap and numbers[k - gap] > number:
                numbers[k] = numbers[k - gap]
                k -= gap
            numbers[k] = number
        gap //= 3


@compiled(
    "void(float64[:, ::1], float64[::1], float64[::1], int64[:, ::1], float64[::1], float64, int64, int64[::1],"
    " int64[::1], float64[:, ::1], float64[::1], float64[::1], float64[:, ::1], float64, float64,"
    " float64[:, :, ::1], float64[:, ::1], float64[:, ::1], int64[:, :, ::1])"
)
def about(
    places: Array,
    lifts: Array,
    strengths: Array,
    spots: Numbers,
    low: Array,
    side_m: float,
    count: int,
    starts: Numbers,
    order: Numbers,
    centres: Array,
    radii: Array,
    ring_lifts: Array,
    moved: Array,
    reach_m: float,
    lift_m: float,
    near_places: Array,
    near_lifts: Array,
    near_strengths: Array,
    near_spots: Numbers,
) -> None:
    """The points about rings, moved back with them: `nearby_points.PointCloud.about`.

    Args:
        places: (M, 3) m of the points, strongest first,
        lifts: (M,) m,
        strengths: (M,)
        spots: (M, 2) and their spots.
        low: this and the next four as of `sorted_into_cells`.
        side_m: likewise.
        count: likewise.
        starts: likewise.
        order: likewise.
        centres: (N, 3) m of the rings,
        radii: (N,) m,
        ring_lifts: (N,) m,
        moved: (N, 4) m by which they have moved and been lifted.
        reach_m: from a ring's circle,
        lift_m: and of a point's lift from the ring's.
        near_places: (N, most, 3) of zeros, filled,
        near_lifts: (N, most) likewise,
        near_strengths: (N, most) likewise,
        near_spots: (N, most, 2) likewise.
    """
    most = near_lifts.shape[1]
    found = np.empty(len(places), np.int64)
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for ring in range(len(radii)):
        x, y, z = (
            centres[ring, 0] + moved[ring, 0],
            centres[ring, 1] + moved[ring, 1],
            centres[ring, 2] + moved[ring, 2],
        )
        lifted, far = ring_lifts[ring] + moved[ring, 3], radii[ring] + reach_m
        least, largest = (radii[ring] - reach_m) ** 2, far**2
        for i, at in enumerate((x, y, z)):
            first[i], last[i] = _cell(at - far, low[i], side_m, count), _cell(at + far, low[i], side_m, count)
        total = 0
        for i in range(first[0], last[0] + 1):
            for j in range(first[1], last[1] + 1):
                row = (i * count + j) * count
                for k in range(starts[row + first[2]], starts[row + last[2] + 1]):
                    n = order[k]
                    squared = (places[n, 0] - x) ** 2 + (places[n, 1] - y) ** 2 + (places[n, 2] - z) ** 2
                    if least < squared <= largest and abs(lifts[n] - lifted) < lift_m:
                        found[total] = n
                        total += 1
        _sort(found, total)
        for k in range(min(total, most)):
            n = found[k]
            for i in range(3):
                near_places[ring, k, i] = places[n, i]
            near_lifts[ring, k], near_strengths[ring, k] = lifts[n], strengths[n]
            near_spots[ring, k, 0], near_spots[ring, k, 1] = spots[n, 0], spots[n, 1]
        for k in range(most):
            for i in range(3):
                near_places[ring, k, i] -= moved[ring, i]
            near_lifts[ring, k] -= moved[ring, 3]


@compiled(
    "void(float64[:, ::1], int64[::1], float64[::1], float64, int64, int64[::1], int64[::1], float64[:, ::1],"
    " float64[::1], int64[:, ::1])"
)
def counted(
    places: Array,
    ends: Numbers,
    low: Array,
    side_m: float,
    count: int,
    starts: Numbers,
    order: Numbers,
    centres: Array,
    radii: Array,
    counts: Numbers,
) -> None:
    """How many points of each level lie in spheres: `nearby_points.PointCloud.density`.

    Args:
        places: (M, 3) m, the strongest first.
        ends: (LEVELS,) how many are as strong as each level: fewer for a higher one.
        low: this and the next four as of `sorted_into_cells`.
        side_m: likewise.
        count: likewise.
        starts: likewise.
        order: likewise.
        centres: (N, 3) m of the spheres,
        radii: (N,) m.
        counts: (N, LEVELS) of zeros, filled.
    """
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for sphere in range(len(radii)):
        for i in range(3):
            at, far = centres[sphere, i], radii[sphere]
            first[i], last[i] = _cell(at - far, low[i], side_m, count), _cell(at + far, low[i], side_m, count)
        x, y, z, largest = centres[sphere, 0], centres[sphere, 1], centres[sphere, 2], radii[sphere] ** 2
        for i in range(first[0], last[0] + 1):
            for j in range(first[1], last[1] + 1):
                row = (i * count + j) * count
                for k in range(starts[row + first[2]], starts[row + last[2] + 1]):
                    n = order[k]
                    if (places[n, 0] - x) ** 2 + (places[n, 1] - y) ** 2 + (places[n, 2] - z) ** 2 <= largest:
                        for level in range(len(ends)):
                            counts[sphere, level] += n < ends[level]


@compiled("void(int64[:, :, ::1], int64[:, :, ::1], bool_[:, ::1], float64[:, ::1])")
def without(spots: Numbers, own_spots: Numbers, is_own: Flags, strengths: Array) -> None:
    """Take their strength (N, M) from points that two of a ring's own spots make: `nearby_points.Nearby.without`.

    Args:
        spots: (N, M, 2) of the points.
        own_spots: (N, O, 2) of others about the same rings.
        is_own: (N, O) which of those are the rings' own.
        strengths: (N, M), changed.
    """
    for ring in range(len(spots)):
        own, total = np.empty((2, is_own.shape[1]), np.int64), 0
        for k in range(is_own.shape[1]):
            if is_own[ring, k]:
                own[0, total], own[1, total] = own_spots[ring, k, 0], own_spots[ring, k, 1]
                total += 1
        for n in range(spots.shape[1]):
            if strengths[ring, n] > 0.0:
                is_of_a, is_of_b = False, False
                for k in range(total):
                    is_of_a |= spots[ring, n, 0] == own[0, k]
                    is_of_b |= spots[ring, n, 1] == own[1, k]
                if is_of_a and is_of_b:
                    strengths[ring, n] = 0.0


@compiled("void(float64[:, ::1], float64[::1], float64)")
def _solve(normal: Array, right: Array, most: float) -> None:
    """Make of a right side (5,) the step that a normal matrix (5, 5) takes to it, by Cholesky, `most` at most.

    Args:
        normal: positive definite; its lower half is changed.
        right: changed.
        most: of each part of the step, either way.
    """
    size = len(right)
    for k in range(size):
        for j in range(k):
            for i in range(j):
                normal[k, j] -= normal[k, i] * normal[j, i]
            normal[k, j] /= normal[j, j]
            normal[k, k] -= normal[k, j] ** 2
            right[k] -= normal[k, j] * right[j]
        normal[k, k] = math.sqrt(normal[k, k])
        right[k] /= normal[k, k]
    for k in range(size - 1, -1, -1):
        for i in range(k + 1, size):
            right[k] -= normal[i, k] * right[i]
        right[k] /= normal[k, k]
    for k in range(size):
        right[k] = min(max(right[k], -most), most)


@compiled("void(float64[::1])")
def _normalise(vector: Array) -> None:
    """Make a vector (3,) as long as 1."""
    length = math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    for i in range(3):
        vector[i] /= length


@compiled(
    "void(float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[::1], float64[::1],"
    " float64[:, ::1], float64[:, ::1], float64[:, :, ::1], float64[:, ::1], float64[:, ::1], float64[::1],"
    " float64, float64, float64, float64, float64, float64, float64, float64, float64, float64, float64)"
)
def fitted(
    centres: Array,
    normals: Array,
    firsts: Array,
    seconds: Array,
    radii: Array,
    lifts: Array,
    ellipses: Array,
    saddles: Array,
    places: Array,
    place_lifts: Array,
    strengths: Array,
    sigmas_m: Array,
    strongest: float,
    lift_sigma_m: float,
    point_m: float,
    ellipse_share: float,
    saddle_m: float,
    inertia: float,
    largest_step_m: float,
    largest_ellipse_m: float,
    largest_saddle_m: float,
    smallest_m: float,
    largest_m: float,
) -> None:
    """Rings come to lie on the points about them: `shaped_rings.ShapedRings.fitted`.

    Args:
        centres: this and the next seven the rings, as of `ShapedRings`, changed.
        normals: likewise.
        firsts: likewise.
        seconds: likewise.
        radii: likewise.
        lifts: likewise.
        ellipses: likewise.
        saddles: likewise.
        places: (N, M, 3) m of the points,
        place_lifts: (N, M) m,
        strengths: (N, M).
        sigmas_m: (R,) round by round, the distance to which points count.
        strongest: this and the rest as of the tuning of `shaped_rings`.
        lift_sigma_m: likewise.
        point_m: likewise.
        ellipse_share: likewise.
        saddle_m: likewise.
        inertia: likewise.
        largest_step_m: likewise.
        largest_ellipse_m: likewise.
        largest_saddle_m: likewise.
        smallest_m: of a ring's radius,
        largest_m: likewise.
    """
    flat, across = np.empty((5, 5)), np.empty((5, 5))
    step, rise = np.empty(5), np.empty(5)
    in_plane, out_of_it = np.empty(5), np.empty(5)
    for sigma_m in sigmas_m:
        unit = 0.0
        for ring in range(len(radii)):
            unit += radii[ring]
        unit /= max(len(radii), 1)
        for ring in range(len(radii)):
            normal, first, second = normals[ring], firsts[ring], seconds[ring]
            for matrix in (flat, across):
                matrix[:] = 0.0
            held_flat, held_across = (point_m / (ellipse_share * radii[ring])) ** 2, (point_m / saddle_m) ** 2
            for k in range(5):
                flat[k, k], across[k, k] = inertia if k < 3 else held_flat, inertia if k < 3 else held_across
                step[k] = 0.0 if k < 3 else -held_flat * ellipses[ring, k - 3]
                rise[k] = 0.0 if k < 3 else -held_across * saddles[ring, k - 3]
            total, lifted = 0.5, 0.0
            for n in range(strengths.shape[1]):
                if not strengths[ring, n] > 0.0:
                    continue
                x, y, z = 0.0, 0.0, 0.0
                for i in range(3):
                    away = places[ring, n, i] - centres[ring, i]
                    x += away * first[i]
                    y += away * second[i]
                    z += away * normal[i]
                out = math.hypot(x, y)
                cosine, sine = (x / out, y / out) if out > 0.0 else (1.0, 0.0)
                twice_cosine, twice_sine = cosine * cosine - sine * sine, 2.0 * cosine * sine
                outward = out - radii[ring] - twice_cosine * ellipses[ring, 0] - twice_sine * ellipses[ring, 1]
                along = z - twice_cosine * saddles[ring, 0] - twice_sine * saddles[ring, 1]
                higher = place_lifts[ring, n] - lifts[ring]
                far = (outward * outward + along * along) / sigma_m**2 + (higher / lift_sigma_m) ** 2
                weight = min(strengths[ring, n], strongest) * math.exp(-0.5 * far)
                reach = out / unit
                in_plane[0], in_plane[1], in_plane[2] = cosine, sine, 1.0
                out_of_it[0], out_of_it[1], out_of_it[2] = 1.0, reach * cosine, reach * sine
                in_plane[3] = out_of_it[3] = twice_cosine
                in_plane[4] = out_of_it[4] = twice_sine
                for k in range(5):
                    step[k] += weight * in_plane[k] * outward
                    rise[k] += weight * out_of_it[k] * along
                    for j in range(k + 1):
                        flat[k, j] += weight * in_plane[k] * in_plane[j]
                        across[k, j] += weight * out_of_it[k] * out_of_it[j]
                total += weight
                lifted += weight * higher
            _solve(flat, step, largest_step_m)
            _solve(across, rise, largest_step_m)
            for i in range(3):
                centres[ring, i] += step[0] * first[i] + step[1] * second[i] + rise[0] * normal[i]
                normal[i] -= (rise[1] * first[i] + rise[2] * second[i]) / unit
            _normalise(normal)
            tilted = first[0] * normal[0] + first[1] * normal[1] + first[2] * normal[2]
            for i in range(3):
                first[i] -= tilted * normal[i]
            _normalise(first)
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                second[i] = normal[j] * first[k] - normal[k] * first[j]
            radii[ring] = min(max(radii[ring] + step[2], smallest_m), largest_m)
            lifts[ring] += lifted / total
            for k in range(2):
                wider, bent = ellipses[ring, k] + step[3 + k], saddles[ring, k] + rise[3 + k]
                ellipses[ring, k] = min(max(wider, -largest_ellipse_m), largest_ellipse_m)
                saddles[ring, k] = min(max(bent, -largest_saddle_m), largest_saddle_m)


@compiled(
    "void(float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[::1], float64[::1],"
    " float64[:, ::1], float64[:, ::1], float64[:, :, ::1], float64[:, ::1], float64[:, ::1], int64[:, :, ::1],"
    " float64[::1], float64, float64, int64[:, ::1], float64[::1], bool_[:, ::1])"
)
def support(
    centres: Array,
    normals: Array,
    firsts: Array,
    seconds: Array,
    radii: Array,
    lifts: Array,
    ellipses: Array,
    saddles: Array,
    places: Array,
    place_lifts: Array,
    strengths: Array,
    spots: Numbers,
    levels: Array,
    on_m: float,
    on_lift_m: float,
    counts: Numbers,
    gaps: Array,
    is_on: Flags,
) -> None:
    """Which of the points about rings lie on each, and what they say: `shaped_rings.ShapedRings.support`.

    Args:
        centres: this and all until `strengths` as of `fitted`.
        normals: likewise.
        firsts: likewise.
        seconds: likewise.
        radii: likewise.
        lifts: likewise.
        ellipses: likewise.
        saddles: likewise.
        places: likewise.
        place_lifts: likewise.
        strengths: likewise.
        spots: (N, M, 2) of the points.
        levels: (LEVELS,) of strength.
        on_m: from the curve, on a ring,
        on_lift_m: and of the lift.
        counts: (N, LEVELS) filled,
        gaps: (N,) likewise,
        is_on: (N, M) likewise.
    """
    whole = 2.0 * math.pi
    turns, numbers = np.empty(strengths.shape[1]), np.empty(strengths.shape[1], np.int64)
    for ring in range(len(radii)):
        total = 0
        for n in range(strengths.shape[1]):
            is_on[ring, n] = False
            if not strengths[ring, n] > 0.0:
                continue
            x, y, z = 0.0, 0.0, 0.0
            for i in range(3):
                away = places[ring, n, i] - centres[ring, i]
                x += away * firsts[ring, i]
                y += away * seconds[ring, i]
                z += away * normals[ring, i]
            turn, out = math.atan2(y, x), math.hypot(x, y)
            cosine, sine = math.cos(2.0 * turn), math.sin(2.0 * turn)
            outward = out - radii[ring] - cosine * ellipses[ring, 0] - sine * ellipses[ring, 1]
            along = z - cosine * saddles[ring, 0] - sine * saddles[ring, 1]
            if outward * outward + along * along < on_m**2 and abs(place_lifts[ring, n] - lifts[ring]) < on_lift_m:
                is_on[ring, n] = True
                k = total
                while k > 0 and turns[k - 1] > turn:
                    turns[k] = turns[k - 1]
                    k -= 1
                turns[k], numbers[total] = turn, n
                total += 1
        gaps[ring] = 1.0
        if total:
            largest = turns[0] + whole - turns[total - 1]
            for k in range(1, total):
                largest = max(largest, turns[k] - turns[k - 1])
            gaps[ring] = largest / whole
        for level in range(len(levels)):
            fewest = total
            for plane in range(2):
                different = 0
                for k in range(total):
                    n = numbers[k]
                    is_new = strengths[ring, n] >= levels[level]
                    for j in range(k):
                        m = numbers[j]
                        if strengths[ring, m] >= levels[level] and spots[ring, m, plane] == spots[ring, n, plane]:
                            is_new = False
                    different += is_new
                fewest = min(fewest, different)
            counts[ring, level] = fewest


@compiled(
    "void(float64[:, :, ::1], float64[:, ::1], float64[:, ::1], bool_[:, ::1], float64[:, ::1], float64[:, ::1],"
    " float64[::1], float64[::1], float64, int64, float64, float64[::1], float64[::1], int64[::1], int64, float64[::1],"
    " int64, float64[:, ::1])"
)
def ways(
    near_places: Array,
    near_lifts: Array,
    near_strengths: Array,
    is_on: Flags,
    expected: Array,
    places: Array,
    lifts: Array,
    strengths: Array,
    faintest: float,
    voted_for: int,
    strongest: float,
    bounds: Array,
    cells_m: Array,
    size: Numbers,
    dense: int,
    near_m: Array,
    rounds: int,
    found: Array,
) -> None:
    """By how much rings have moved until another pair, as their electrodes vote: `carried_rings._ways`.

    Args:
        near_places: (N, M, 3) m of the points about them in the first pair,
        near_lifts: (N, M) m,
        near_strengths: (N, M),
        is_on: (N, M) which of them are on the rings.
        expected: (N, 4) m, about which is looked.
        places: (K, 3) m of the other pair's points, strongest first,
        lifts: (K,) m,
        strengths: (K,).
        faintest: that is voted for,
        voted_for: and how many at most.
        strongest: that a vote counts.
        bounds: (4,) m of what is looked for.
        cells_m: (4,) m of a cell of ways,
        size: (4,) how many there are.
        dense: cells that are looked at more closely, of either grid.
        near_m: (4,) m within which votes agree.
        rounds: of refinement.
        found: (N, 4) filled.
    """
    total_cells = size[0] * size[1] * size[2] * size[3]
    votes_in, is_used = np.zeros(total_cells), np.zeros(total_cells, np.bool_)
    best, begun, agreed = np.empty(dense, np.int64), np.empty((2 * dense, 4)), np.empty(2 * dense)
    here = np.empty((near_lifts.shape[1], 5))
    far = np.empty(near_lifts.shape[1])
    for ring in range(len(expected)):
        own, middle = 0, np.zeros(3)
        for k in range(near_lifts.shape[1]):
            if is_on[ring, k]:
                for i in range(3):
                    here[own, i] = near_places[ring, k, i]
                    middle[i] += here[own, i]
                here[own, 3], here[own, 4] = near_lifts[ring, k], min(near_strengths[ring, k], strongest)
                own += 1
        found[ring] = expected[ring]
        if not own:
            continue
        reach = 0.0
        for i in range(3):
            middle[i] /= own
        for k in range(own):
            far[k] = 0.0
            for i in range(3):
                far[k] += (here[k, i] - middle[i]) ** 2
            reach = max(reach, far[k])
        reach = bounds[0] + math.sqrt(reach)
        way, vote, electrode = (
            np.empty((voted_for * own, 4)),
            np.empty(voted_for * own),
            np.empty(voted_for * own, np.int64),
        )
        total, asked = 0, 0
        for n in range(len(lifts)):
            if strengths[n] < faintest or asked == voted_for:
                break
            squared = 0.0
            for i in range(3):
                squared += (places[n, i] - middle[i] - expected[ring, i]) ** 2
            if squared > reach * reach:
                continue
            asked += 1
            for k in range(own):
                is_possible = True
                for i in range(4):
                    there = lifts[n] if i == 3 else places[n, i]
                    way[total, i] = there - here[k, i] - expected[ring, i]
                    is_possible &= abs(way[total, i]) < bounds[i]
                if is_possible:
                    vote[total], electrode[total] = min(strengths[n], here[k, 4]), k
                    total += 1
        if not total:
            continue
        used = np.empty(total, np.int64)
        candidates = 0
        for grid in range(2):
            shift, count = 0.5 * grid, 0
            for n in range(total):
                cell = 0
                for i in range(4):
                    cell = cell * size[i] + int((way[n, i] + bounds[i]) / cells_m[i] + shift)
                if not is_used[cell]:
                    is_used[cell] = True
                    used[count] = cell
                    count += 1
                votes_in[cell] += vote[n]
            ranked = 0
            for k in range(count):
                cell, rank = used[k], ranked
                while rank > 0 and (
                    votes_in[cell] > votes_in[best[rank - 1]]
                    or (votes_in[cell] == votes_in[best[rank - 1]] and cell < best[rank - 1])
                ):
                    if rank < dense:
                        best[rank] = best[rank - 1]
                    rank -= 1
                if rank < dense:
                    best[rank], ranked = cell, min(ranked + 1, dense)
            for k in range(ranked):
                rest = best[k]
                for i in range(3, -1, -1):
                    place = rest % size[i]
                    rest //= size[i]
                    begun[candidates, i] = ((place + 0.5 - shift) * cells_m[i] - bounds[i]) / near_m[i]
                candidates += 1
            for k in range(count):
                votes_in[used[k]], is_used[used[k]] = 0.0, False
        for n in range(total):
            for i in range(4):
                way[n, i] /= near_m[i]
        most = np.empty(own)
        for which in range(candidates):
            one, close = begun[which], 0
            # No round takes it farther than 1, and no vote counts that is farther away than that.
            farthest = (rounds + 1.0) ** 2
            for n in range(total):
                away = (way[n, 0] - one[0]) ** 2
                if away < farthest:
                    for i in range(1, 4):
                        away += (way[n, i] - one[i]) ** 2
                    if away < farthest:
                        used[close] = n
                        close += 1
            for turn in range(rounds + 1):
                weights, sums = 0.0, np.zeros(4)
                most[:] = 0.0
                for k in range(close):
                    n, away = used[k], 0.0
                    for i in range(4):
                        away += (way[n, i] - one[i]) ** 2
                    if away < 1.0:
                        weights += vote[n]
                        most[electrode[n]] = max(most[electrode[n]], vote[n])
                        for i in range(4):
                            sums[i] += vote[n] * way[n, i]
                if turn < rounds and weights > 0.0:
                    for i in range(4):
                        one[i] = sums[i] / weights
            agreed[which] = most.sum()
        surest = 0
        for which in range(1, candidates):
            if agreed[which] > agreed[surest]:
                surest = which
        for i in range(4):
            found[ring, i] += begun[surest, i] * near_m[i]
