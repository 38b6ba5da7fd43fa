"""How far rings stand out by their lines alone: what lies along each, by what lies along the same ring laid elsewhere.

As `distinctness`, before there is a close-up or a curve: on the laid-out maps of lines, where a ring is a few dozen
places. What is none mostly lies where there is much of everything.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.initialisation.circles import POINTS
from lasso_motion_ros.initialisation.direction_maps import DirectionMaps, nearest_direction
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid
from lasso_motion_ros.initialisation.laid_image import CELL_M
from lasso_motion_ros.initialisation.shaped_rings import ShapedRings

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


@dataclass(frozen=True)
class _Tuning:
    """Where else a ring is laid."""

    reach_cells: int = 16  # as far as `distinctness` goes
    step_cells: int = 2
    nearest_cells: float = 4.0  # what is nearer shows the ring itself
    smallest_spread: float = 0.02  # of a response: where nothing is, nothing is divided


TUNING = _Tuning()


def _elsewhere() -> Indices:
    """(2, K) cells along columns and rows by which a ring is laid aside; first not at all."""
    reach = TUNING.reach_cells
    one = np.arange(-reach, reach + 1, TUNING.step_cells)
    columns, rows = (each.reshape(-1) for each in np.meshgrid(one, one))
    is_far = np.hypot(columns, rows) >= TUNING.nearest_cells
    return np.stack([np.concatenate([[0], each[is_far]]) for each in (columns, rows)]).astype(np.int64)


_ELSEWHERE = _elsewhere()


def lines_stand_out(rings: ShapedRings, maps: Mapping[Plane, DirectionMaps], grid: EpipolarGrid) -> Array:
    """(N,) by how many standard deviations the lines along rings stand out, sum of the planes.

    Outside a picture there are none: near its edge a ring may stand out more than it does.

    Args:
        rings: some.
        maps: both planes'.
        grid: on which they lie.
    """
    total = np.zeros(len(rings))
    points = rings.points().reshape(-1, 3)
    for plane in PLANES:
        columns, rows = (one.reshape(-1, POINTS) for one in grid.lay(plane, points))
        if plane == "b":
            rows = rows + rings.lifts[:, None]
        total += _stand_out(columns, rows, maps[plane])
    return total


def _stand_out(columns: Array, rows: Array, maps: DirectionMaps) -> Array:
    """(N,) of closed curves (N, POINTS), m, in one plane."""
    direction = nearest_direction(columns, rows)
    x, y = (np.rint((at - start) / CELL_M).astype(np.int64) for at, start in ((columns, maps.left), (rows, maps.top)))
    if has_kernels():
        from lasso_motion_ros.initialisation import kernels

        means = np.empty((len(x), _ELSEWHERE.shape[1]))
        everything: list[Any] = [maps.widened, direction.astype(np.int64), x, y, _ELSEWHERE, means]
        kernels.laid_elsewhere(*everything)
    else:
        columns, rows = (
            start + CELL_M * (at[:, None] + aside[None, :, None])
            for start, at, aside in zip((maps.left, maps.top), (x, y), _ELSEWHERE, strict=True)
        )
        means = maps.at(columns, rows, direction[:, None], widened=True).mean(axis=2, dtype=np.float64)
    others = means[:, 1:]
    spread = np.maximum(others.std(axis=1), TUNING.smallest_spread)
    return np.asarray((means[:, 0] - others.mean(axis=1)) / spread)
