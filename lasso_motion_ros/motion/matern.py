"""The Matérn-5/2 process in state-space form: value, slope and curvature.

Hartikainen and Särkkä, "Kalman filtering and smoothing solutions to temporal Gaussian process regression models",
MLSP 2010.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def transition(interval_s: float, scale_s: float) -> Array:
    """(3, 3) transition of value, slope and curvature over an interval, for a process of a time scale."""
    lam = math.sqrt(5.0) / scale_s
    t, lt = interval_s, lam * interval_s
    return math.exp(-lt) * np.array(
        [
            [1 + lt + lt**2 / 2, t * (1 + lt), t**2 / 2],
            [-(lam**3) * t**2 / 2, 1 + lt - lt**2, t * (1 - lt / 2)],
            [lam**3 * t * (lt / 2 - 1), lam**2 * t * (lt - 3), 1 - 2 * lt + lt**2 / 2],
        ]
    )


@lru_cache
def stationary(scale_s: float) -> Array:
    """(3, 3) stationary covariance of value, slope and curvature, for a value of variance 1; not to be changed."""
    lam = math.sqrt(5.0) / scale_s
    kappa = lam**2 / 3.0
    covariance = np.array([[1.0, 0.0, -kappa], [0.0, kappa, 0.0], [-kappa, 0.0, lam**4]])
    covariance.setflags(write=False)
    return covariance
