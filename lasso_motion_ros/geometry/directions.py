"""Directions in space."""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def axes_across(normals: Array) -> tuple[Array, Array]:
    """(N, 3) two unit vectors across each of some unit vectors (N, 3), and across each other."""
    # Whichever axis of the world is farther from the normal.
    start = np.where(np.abs(normals[:, :1]) < 0.6, np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 1.0, 0.0]]))
    first = np.cross(normals, start)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return first, np.cross(normals, first)


@cache
def half_sphere(count: int) -> Array:
    """(count, 3) unit vectors, evenly spread over half a sphere (a Fibonacci lattice); not to be changed."""
    index = np.arange(count) + 0.5
    height = index / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * index
    across = np.sqrt(1.0 - height**2)
    normals = np.stack([across * np.cos(turn), across * np.sin(turn), height], axis=1)
    normals.setflags(write=False)
    return normals
