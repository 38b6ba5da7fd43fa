"""Triangle surfaces: vertices, triangles, and the edges that these share."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import SurfaceError
from lasso_motion_ros.geometry import transforms

Array = npt.NDArray[np.float64]

MAX_TRIANGLES = 2_000_000


@dataclass(frozen=True, eq=False)
class EdgeTable:
    """Which edges a surface's triangles share.

    Attributes:
        ends: (E, 2) int32 vertex indices of each edge, the smaller first.
        of_triangle: (3, T) the edges of each triangle, from its corners 0–1, 1–2 and 2–0.
        direction: (3, T) float64, +1 where the triangle runs along `ends`, −1 where against.
    """

    ends: npt.NDArray[np.int32]
    of_triangle: npt.NDArray[np.intp]
    direction: Array


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A surface of triangles; open, closed, in parts, or inconsistently oriented.

    Attributes:
        vertices: (V, 3) float64, metres, in the frame the owner states.
        triangles: (T, 3) int32 indices into the vertices.

    Raises:
        SurfaceError: wrong shapes, coordinates that are not finite, indices out of range, or no triangle.
    """

    vertices: Array
    triangles: npt.NDArray[np.int32]

    def __post_init__(self) -> None:
        vertices = np.asarray(self.vertices, dtype=np.float64)
        triangles = np.asarray(self.triangles)
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise SurfaceError(f"a surface's vertices are (V, 3), found shape {vertices.shape}")
        if triangles.ndim != 2 or triangles.shape[1] != 3 or not np.issubdtype(triangles.dtype, np.integer):
            raise SurfaceError(f"a surface's triangles are (T, 3) indices, found {triangles.dtype} {triangles.shape}")
        if len(triangles) == 0:
            raise SurfaceError("the surface has no triangle")
        if len(triangles) > MAX_TRIANGLES:
            raise SurfaceError(f"{len(triangles)} triangles, at most {MAX_TRIANGLES} are drawn: decimate the surface")
        if not np.all(np.isfinite(vertices)):
            raise SurfaceError("the surface has coordinates that are not finite")
        if triangles.min() < 0 or triangles.max() >= len(vertices):
            raise SurfaceError(f"a triangle refers to a vertex that does not exist (there are {len(vertices)})")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "triangles", triangles.astype(np.int32, copy=False))

    @cached_property
    def corners(self) -> npt.NDArray[np.intp]:
        """(3, T) the triangles' vertices, corner by corner: numpy works on long rows, and indexes, fastest so."""
        return np.ascontiguousarray(self.triangles.T, dtype=np.intp)

    @cached_property
    def edges(self) -> EdgeTable:
        """The edges and the triangles that share them; computed once a surface."""
        starts = self.corners.astype(np.int64)
        ends = np.roll(starts, -1, axis=0)
        low, high = np.minimum(starts, ends), np.maximum(starts, ends)
        keys, index = np.unique((low * len(self.vertices) + high).ravel(), return_inverse=True)
        pairs = np.stack([keys // len(self.vertices), keys % len(self.vertices)], axis=1)
        return EdgeTable(
            ends=pairs.astype(np.int32),
            of_triangle=index.reshape(3, -1),
            direction=np.where(starts < ends, 1.0, -1.0),
        )

    @cached_property
    def centroids(self) -> npt.NDArray[np.float32]:
        """(3, T) of the triangles, metres; for shading, which asks for no more digits."""
        return np.ascontiguousarray(self.vertices.T[:, self.corners].mean(axis=1), dtype=np.float32)

    @cached_property
    def areas(self) -> Array:
        """(T,) areas of the triangles, m²."""
        a, b, c = (self.vertices[self.triangles[:, i]] for i in range(3))
        return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))

    @cached_property
    def inverse_areas(self) -> npt.NDArray[np.float32]:
        """(T,) 1/m²; 0 for a triangle without area."""
        has_area = self.areas > 0.0
        return np.asarray(has_area / np.where(has_area, self.areas, 1.0), dtype=np.float32)

    def moved(self, transform: Array) -> TriangleMesh:
        """The surface moved by a (4, 4) transform, metres."""
        return TriangleMesh(transforms.apply(transform, self.vertices), self.triangles)


def clean_mesh(vertices: Array, triangles: npt.NDArray[np.integer]) -> TriangleMesh:
    """Join vertices at the same place, then drop triangles without area and vertices without triangle.

    Args:
        vertices: (V, 3) metres.
        triangles: (T, 3) indices.

    Raises:
        SurfaceError: nothing is left, or the input is not a surface.
    """
    checked = TriangleMesh(vertices, triangles.astype(np.int32))
    places, joined = np.unique(checked.vertices, axis=0, return_inverse=True)
    faces = joined.reshape(-1)[checked.triangles]
    a, b, c = (places[faces[:, i]] for i in range(3))
    has_area = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 0.0
    if not np.any(has_area):
        raise SurfaceError("every triangle of the surface is degenerate (no area)")
    used, faces = np.unique(faces[has_area], return_inverse=True)
    return TriangleMesh(places[used], faces.reshape(-1, 3).astype(np.int32))
