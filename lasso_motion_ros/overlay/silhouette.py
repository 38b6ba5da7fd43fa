"""The silhouette of a surface in one projection: its region, exactly, and the edges where it folds.

Turn every projected triangle counter-clockwise. The number of triangles that cover a pixel is then the winding
number, about it, of all their boundaries together; and along an edge shared by two triangles that lie side by side
the two boundaries cancel. What remains are the few edges where the surface folds over (coefficient ±2) or ends (±1).
So the region is filled from a few hundred edges instead of thousands of triangles, whatever the orientation of the
triangles, whether or not the surface is closed or the display mirrored.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.overlay.triangle_mesh import TriangleMesh

Array = npt.NDArray[np.float64]

SUBLINES = 4
WALL_CELL_PX = 4
_NEAREST_DEPTH_M = 1e-3


@dataclass(frozen=True, eq=False)
class Silhouette:
    """A surface in one image.

    Attributes:
        left: first column of the box that holds the visible region, pixels.
        top: its first row, pixels.
        coverage: (h, w) float32 share of each pixel covered, 0–1; (0, 0) where nothing is visible.
        wall_count: (⌈h/4⌉, ⌈w/4⌉) float32 how many triangles lie over each cell of 4×4 pixels (2 for a convex body).
        edges: (E, 2, 2) pixels, the fold and border edges.
        ends: (E, 2) numbers of the vertices that they join.
        centroids: (T, 2) float32 pixels, the triangles' centroids.
        facing: (T,) float32 cosine between each triangle's normal and the ray, 0 (edge-on) to 1.
        depth: (T,) float32 depth of the centroids, metres.
    """

    left: int
    top: int
    coverage: npt.NDArray[np.float32]
    wall_count: npt.NDArray[np.float32]
    edges: Array
    ends: npt.NDArray[np.int32]
    centroids: npt.NDArray[np.float32]
    facing: npt.NDArray[np.float32]
    depth: npt.NDArray[np.float32]


def silhouette(mesh: TriangleMesh, projection: Projection, transform: Array) -> Silhouette:
    """Project a surface moved by `transform` and find its region and its folds.

    Triangles that reach behind the source are left out. The region is clipped to the image.

    Args:
        mesh: the surface, metres, in the frame that `transform` maps to the world.
        projection: world to pixels.
        transform: (4, 4) rigid, mesh's frame to world.
    """
    moved = projection.matrix @ transform
    homogeneous = moved[:, :3] @ mesh.vertices.T + moved[:, 3:]
    depth = np.maximum(homogeneous[2], _NEAREST_DEPTH_M)
    pixels = homogeneous[:2] / depth
    x, y = (values[mesh.corners] for values in pixels)  # (3, T) each, corner by corner
    doubled = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
    turn = np.sign(doubled)
    if depth.min() <= _NEAREST_DEPTH_M:
        turn[(depth[mesh.corners] <= _NEAREST_DEPTH_M).any(axis=0)] = 0.0

    table = mesh.edges
    net = np.bincount(table.of_triangle.ravel(), weights=(table.direction * turn).ravel(), minlength=len(table.ends))
    kept = np.flatnonzero(net != 0.0)
    ends = table.ends[kept]
    edges = pixels.T[ends]
    centres = moved[:, :3].astype(np.float32) @ mesh.centroids + moved[:, 3:].astype(np.float32)
    centre_depth = np.maximum(centres[2], np.float32(_NEAREST_DEPTH_M))
    # Seen at an angle, a triangle's image shrinks by the cosine: |A_image| = A cos θ (f / z)², to first order.
    facing = np.abs(doubled).astype(np.float32) * centre_depth * centre_depth
    facing *= mesh.inverse_areas * np.float32(0.5 / projection.focal_length_px**2)
    left, top, coverage, wall_count = _fill(
        edges, np.asarray(net[kept], dtype=np.float64), projection.width, projection.height
    )
    return Silhouette(
        left=left,
        top=top,
        coverage=coverage,
        wall_count=wall_count,
        edges=edges,
        ends=ends,
        centroids=(centres[:2] / centre_depth).T,
        facing=np.minimum(facing, np.float32(1.0)) * (turn != 0.0),
        depth=centre_depth,
    )


def _fill(
    edges: Array, weights: Array, width: int, height: int
) -> tuple[int, int, npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Box, coverage and wall count of the region with non-zero winding, by sub-scanlines with exact ends."""
    empty = np.zeros((0, 0), dtype=np.float32)
    if len(edges) == 0:
        return 0, 0, empty, empty
    x, y = edges[..., 0], edges[..., 1]
    left, top = (max(math.floor(v.min()), 0) for v in (x, y))
    right, bottom = (min(math.ceil(v.max()) + 1, n) for v, n in ((x, width), (y, height)))
    if right <= left or bottom <= top:
        return 0, 0, empty, empty
    columns, rows = right - left, bottom - top

    line, x, weight = _crossings(edges, weights, top, rows)
    if len(line) == 0:
        return 0, 0, empty, empty
    order = np.argsort(line * (4.0 * max(width, height) + 4.0) + np.clip(x, -1.0 * width, 2.0 * width))
    line, x, weight = line[order], x[order], weight[order]
    # Every closed chain adds up to zero along a line, so one running sum serves all lines.
    winding = np.rint(np.cumsum(weight))
    before = np.concatenate([[0.0], winding[:-1]])
    boundary = ((winding != 0.0).astype(np.float64) - (before != 0.0)) / SUBLINES
    row = line // SUBLINES
    changed = boundary != 0.0
    coverage = _integrate(row[changed], x[changed] - left, boundary[changed], rows, columns)
    cell = WALL_CELL_PX
    wall_count = _integrate(
        row // cell,
        (x - left + 0.5) / cell - 0.5,
        (np.abs(winding) - np.abs(before)) / (SUBLINES * cell),
        -(-rows // cell),
        -(-columns // cell),
    )
    return left, top, coverage, wall_count


def _crossings(edges: Array, weights: Array, top: int, rows: int) -> tuple[npt.NDArray[np.int64], Array, Array]:
    """Where the edges cross the sub-scanlines of the box: line number, x in pixels, signed weight."""
    # Sub-scanline i lies at y = top − 0.5 + (i + 0.5) / SUBLINES; rows' centres are at integers.
    y0, y1 = ((edges[..., 1] - top + 0.5) * SUBLINES - 0.5).T
    x0, x1 = edges[..., 0].T
    start, end = np.ceil(np.minimum(y0, y1)), np.ceil(np.maximum(y0, y1))
    start, end = (np.clip(v, 0, rows * SUBLINES).astype(np.int64) for v in (start, end))
    count = end - start
    # What is one edge's is worked out by edge, and told to its crossings; an edge without any may be level.
    first = np.cumsum(count) - count
    slope = (x1 - x0) / np.where(count > 0, y1 - y0, 1.0)
    line = np.arange(count.sum()) + np.repeat(start - first, count)
    x = np.repeat(x0, count) + (line - np.repeat(y0, count)) * np.repeat(slope, count)
    return line, x, np.repeat(np.where(y1 > y0, weights, -weights), count)


def _integrate(row: npt.NDArray[np.int64], x: Array, step: Array, rows: int, columns: int) -> npt.NDArray[np.float32]:
    """(rows, columns) running sum along the rows of steps at real positions, each spread over its own pixel."""
    position = np.clip(x + 0.5, 0.0, columns)
    column = position.astype(np.int64)
    share = position - column
    stride = columns + 2
    flat = row * stride + column
    spread = step * share
    steps = np.zeros(rows * stride, dtype=np.float32)
    np.add.at(steps, flat, (step - spread).astype(np.float32))
    np.add.at(steps, flat + 1, spread.astype(np.float32))
    # Two rows of an integral image differ by the running sum along one: a quarter of the time of numpy's.
    integral = cv2.integral(steps.reshape(rows, stride)[:, :columns], sdepth=cv2.CV_32F)[:, 1:]
    return np.asarray(cv2.subtract(integral[1:], integral[:-1]))
