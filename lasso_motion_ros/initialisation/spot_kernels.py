"""Circles through electrodes and the spots along them, compiled: see `core/compiled.py`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.float32]


@compiled("int64(float64[::1], float64[::1], float64, float64, float64, float64, float64[::1])")
def _circumcircle(
    u: Array, v: Array, thinnest_m2: float, smallest_m: float, largest_m: float, lifted: float, circle: Array
) -> int:
    """Whether the circle through the origin and two points (3,) is one; then (8,) what `through_triples` says of it."""
    uu, vv, uv = 0.0, 0.0, 0.0
    for i in range(3):
        uu += u[i] * u[i]
        vv += v[i] * v[i]
        uv += u[i] * v[i]
    squared = uu * vv - uv * uv
    if not squared > thinnest_m2**2:
        return 0
    share_u, share_v, radius = vv * (uu - uv), uu * (vv - uv), 0.0
    for i in range(3):
        circle[i] = (share_u * u[i] + share_v * v[i]) / (2.0 * squared)
        radius += circle[i] * circle[i]
        j, k = (i + 1) % 3, (i + 2) % 3
        circle[3 + i] = (u[j] * v[k] - u[k] * v[j]) / math.sqrt(squared)
    circle[6], circle[7] = math.sqrt(radius), lifted
    return 1 if smallest_m < circle[6] < largest_m else 0


@compiled(
    "float64[:, ::1](float64[:, ::1], float64[::1], int64, int64, float64, float64, float64, float64, float64, float64)"
)
def through_triples(
    places: Array,
    lifts: Array,
    begun: int,
    neighbours: int,
    nearest_m2: float,
    farthest_m2: float,
    lift_m: float,
    thinnest_m2: float,
    smallest_m: float,
    largest_m: float,
) -> Array:
    """(T, 8) centres, normals, radii and lifts of the circles through points: `spot_circles._through_triples`.

    Args:
        places: (N, 3) m of the points, strongest first,
        lifts: (N,) m.
        begun: with how many of them triples begin,
        neighbours: and how many each has.
        nearest_m2: squared, of two points,
        farthest_m2: likewise,
        lift_m: and by which they differ.
        thinnest_m2: of the parallelogram that three points span.
        smallest_m: of a circle's radius,
        largest_m: likewise.
    """
    found = np.empty((begun * (neighbours * (neighbours - 1) // 2), 8))
    near, total = np.empty(neighbours, np.int64), 0
    u, v = np.empty(3), np.empty(3)
    for k in range(begun):
        count = 0
        for n in range(len(lifts)):
            squared = 0.0
            for i in range(3):
                squared += (places[n, i] - places[k, i]) ** 2
            if nearest_m2 < squared < farthest_m2 and abs(lifts[n] - lifts[k]) < lift_m:
                near[count] = n
                count += 1
                if count == neighbours:
                    break
        for a in range(count):
            one = near[a]
            for b in range(a + 1, count):
                other, squared = near[b], 0.0
                for i in range(3):
                    squared += (places[other, i] - places[one, i]) ** 2
                    u[i], v[i] = places[one, i] - places[k, i], places[other, i] - places[k, i]
                if squared > nearest_m2 and abs(lifts[one] - lifts[other]) < lift_m:
                    lifted = (lifts[k] + lifts[one] + lifts[other]) / 3.0
                    if _circumcircle(u, v, thinnest_m2, smallest_m, largest_m, lifted, found[total]):
                        for i in range(3):
                            found[total, i] += places[k, i]
                        total += 1
    return found[:total].copy()


@compiled(
    "void(float64[:, :, ::1], float64[::1], float64[:, ::1], float64[:, ::1], float64, float64, float32[:, ::1],"
    " float64, float64, float64, float32[:, ::1])"
)
def spots_along(
    axes: Array,
    lifts: Array,
    seen: Array,
    shares: Array,
    distance: float,
    lever: float,
    spots: Image,
    left: float,
    top: float,
    cell_m: float,
    shown: Image,
) -> None:
    """The spots along circles, where both planes show them: `spot_circles._shown_along`.

    Args:
        axes: (N, 3, 3) each circle's middle and two radii, m.
        lifts: (N,) m by which the plane sees each higher.
        seen: (4, 4) what the grid asks of a place (`EpipolarGrid.asked`).
        shares: (3, P) how much of the middle and of each radius is in the points.
        distance: of the grid's centre from the source, m.
        lever: from the baseline, m.
        spots: (H, W) of the plane.
        left: of the first column, m.
        top: of the first row, m.
        cell_m: from column to column.
        shown: (N, P) is made what the plane shows, where that is less.
    """
    height, width = spots.shape
    points = shares.shape[1]
    part, columns, rows = np.empty((3, 4)), np.empty(points), np.empty(points)
    for n in range(len(lifts)):
        for k in range(3):
            for i in range(4):
                part[k, i] = 0.0 if k else seen[i, 3]
                for j in range(3):
                    part[k, i] += seen[i, j] * axes[n, k, j]
        for p in range(points):
            u, v = shares[1, p], shares[2, p]
            ahead, out = part[0, 1] + u * part[1, 1] + v * part[2, 1], part[0, 3] + u * part[1, 3] + v * part[2, 3]
            columns[p] = (distance * (part[0, 0] + u * part[1, 0] + v * part[2, 0]) / ahead - left) / cell_m
            rows[p] = (lever * (part[0, 2] + u * part[1, 2] + v * part[2, 2]) / out + lifts[n] - top) / cell_m
        for p in range(points):
            x, y = int(np.rint(columns[p])), int(np.rint(rows[p]))
            value = spots[y, x] if 0 <= x < width and 0 <= y < height else np.float32(0.0)
            shown[n, p] = min(shown[n, p], value)


@compiled(
    "void(float64[::1], float64[::1], float64[::1], float64[:, ::1], float64[::1], float64[:, ::1], float64[::1],"
    " float64[::1], float64, float64[:, ::1])"
)
def places(
    columns_a: Array,
    columns_b: Array,
    rows: Array,
    sources: Array,
    centre: Array,
    sideways: Array,
    upward: Array,
    outward: Array,
    lever: float,
    found: Array,
) -> None:
    """The world points that both planes show: `epipolar_grid.EpipolarGrid.places`.

    Args:
        columns_a: (N,) m in plane A's grid.
        columns_b: (N,) likewise.
        rows: (N,) m, common.
        sources: (2, 3) m of the planes.
        centre: (3,) m of the grid,
        sideways: (2, 3) unit vectors along the planes' columns,
        upward: (3,) and along their rows,
        outward: (3,) unit vector across the baseline.
        lever: of the centre from the baseline, m.
        found: (N, 3) filled, m.
    """
    rays, across, normal = np.empty((2, 3)), np.empty(3), np.empty(3)
    for i in range(3):
        across[i] = sources[1, i] - sources[0, i]
    for n in range(len(rows)):
        for plane in range(2):
            column = columns_b[n] if plane else columns_a[n]
            out = 0.0
            for i in range(3):
                rays[plane, i] = centre[i] + column * sideways[plane, i] - sources[plane, i]
                out += rays[plane, i] * outward[i]
            for i in range(3):
                rays[plane, i] += rows[n] * (out / lever) * upward[i]
        along, squared = 0.0, 0.0
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            normal[i] = rays[0, j] * rays[1, k] - rays[0, k] * rays[1, j]
            along += (across[j] * rays[1, k] - across[k] * rays[1, j]) * normal[i]
            squared += normal[i] * normal[i]
        # The rays lie in one epipolar plane: where they meet in it.
        for i in range(3):
            found[n, i] = sources[0, i] + along / squared * rays[0, i]
