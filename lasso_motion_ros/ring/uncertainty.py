"""What the covariance of the published motion holds besides the filter's own."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

# A displacement is known to this share of itself: calibrations are off by a tenth of a degree or two,
CALIBRATION_SHARE = 0.0015
# or by more, where the planes disagreed at the seed. What they disagree by, they do at about this distance.
SOURCE_DISTANCE_M = 0.75
# The point about which the ring tilts and stretches by itself is known as well as this (standard deviation, metres):
# an open or overlapping loop's centre is no better defined.
PIVOT_M = 1e-3


def calibration_covariance(displacement: Array, gap_mm: float) -> Array:
    """(3, 3) m² by which an imperfect calibration may have put off a displacement (3,) m.

    Args:
        displacement: since the reference.
        gap_mm: by which the planes disagreed at the seed, mm: as an angle about the source, it turns displacements.
    """
    share = np.hypot(CALIBRATION_SHARE, 1e-3 * gap_mm / SOURCE_DISTANCE_M)
    return np.asarray(share**2 * float(displacement @ displacement) * np.eye(3))


def pivot_covariance(turn: Array, stretch: float) -> Array:
    """(3, 3) m² by which the ring's own motion may pass for a displacement of its centre.

    An offset r of the pivot shows as a displacement θ × r + s r; r has covariance σ² 1.

    Args:
        turn: (3,) rotation vector θ of the ring, rad.
        stretch: logarithm s of its size.
    """
    return np.asarray(PIVOT_M**2 * ((turn @ turn + stretch**2) * np.eye(3) - np.outer(turn, turn)))
