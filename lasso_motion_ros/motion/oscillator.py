"""A damped oscillator that noise drives, in state-space form: value and speed.

What it does within a fraction of its period is smooth, and later it swings back, as a heart does after each of its
beats (Foreman-Mackey, Agol, Ambikasaran and Angus, "Fast and scalable Gaussian process modeling with applications to
astronomical time series", The Astronomical Journal 154, 2017, section 4).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def transition(interval_s: float, damping_per_s: float, turning_rad_s: float) -> Array:
    """(2, 2) transition of value and speed over an interval.

    Args:
        interval_s: seconds.
        damping_per_s: rate at which it dies away, 1/s.
        turning_rad_s: its angular frequency, rad/s, greater than zero.
    """
    angle = turning_rad_s * interval_s
    cosine, sine = math.cos(angle), math.sin(angle) / turning_rad_s
    stiffness = damping_per_s**2 + turning_rad_s**2
    return math.exp(-damping_per_s * interval_s) * np.array(
        [[cosine + damping_per_s * sine, sine], [-stiffness * sine, cosine - damping_per_s * sine]]
    )


def stationary(damping_per_s: float, turning_rad_s: float) -> Array:
    """(2, 2) stationary covariance of value and speed, for a value of variance 1; arguments as of `transition`."""
    return np.diag([1.0, damping_per_s**2 + turning_rad_s**2])
