"""What a heart may do to the ring: how far it may move it, and which way, each a model with odds of its own.

A heart moves to and fro on nearly one way, and how far and which way differs between patients. Where plane B is exposed
later than plane A, what the heart did in between is in the depth, and only its way tells it from what the planes show
across their rays. So ways in all directions stand side by side with hearts that go any way, until measurements leave
few of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.directions import half_sphere

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Hearts:
    """Models of the heart's motion.

    Attributes:
        covariances: (N, 3, 3) m².
        odds: (N,) of them before any measurement; their sum is 1.
        is_any_way: (N,) whether it is alike in all directions.
        number: (N,) which of all the hearts that there are each one is.
    """

    covariances: Array
    odds: Array
    is_any_way: npt.NDArray[np.bool_]
    number: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.odds)

    @cached_property
    def log_odds(self) -> Array:
        """(N,) natural logarithms of the odds."""
        return np.log(self.odds)

    def only(self, kept: npt.NDArray[np.bool_]) -> Hearts:
        """Those of a mask (N,)."""
        odds = self.odds[kept]
        any_way, number = self.is_any_way[kept], self.number[kept]
        return Hearts(self.covariances[kept], odds / odds.sum(), any_way, number)


def hearts(
    any_way: tuple[tuple[float, float], ...],
    one_way: tuple[tuple[float, float], ...],
    ways: int,
    across_share: float,
) -> Hearts:
    """Hearts that go any way, and on one way in each of so many directions.

    Args:
        any_way: standard deviation, metres, and odds of each size of a heart that goes any way.
        one_way: likewise, of each size of one that goes to and fro.
        ways: how many directions there are, evenly spread.
        across_share: how far it strays from its way, as a share of how far it goes, standard deviations.
    """
    across = across_share**2
    directions = half_sphere(ways)
    along = across * np.eye(3) + (1.0 - across) * directions[:, :, None] * directions[:, None, :]
    shapes = [np.eye(3)[None]] * len(any_way) + [along] * len(one_way)
    sizes = (*any_way, *one_way)
    counts = [len(shape) for shape in shapes]
    odds = np.repeat([share / count for (_, share), count in zip(sizes, counts, strict=True)], counts)
    is_any_way = np.repeat([True] * len(any_way) + [False] * len(one_way), counts)
    variances = np.repeat([size_m**2 for size_m, _ in sizes], counts)
    covariances = variances[:, None, None] * np.concatenate(shapes)
    return Hearts(covariances, odds / odds.sum(), is_any_way, np.arange(len(odds)))
