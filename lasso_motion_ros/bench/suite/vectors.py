"""Vectors as scenarios are drawn and hold them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def unit(vector: npt.ArrayLike) -> Array:
    """A vector of length 1."""
    values = np.asarray(vector, dtype=np.float64)
    return np.asarray(values / np.linalg.norm(values))


def direction(random: np.random.Generator) -> Array:
    """A random unit vector (3,)."""
    return unit(random.normal(size=3))


def as_vector(values: npt.ArrayLike) -> tuple[float, ...]:
    """Numbers as a scenario holds them."""
    return tuple(float(value) for value in np.asarray(values))
