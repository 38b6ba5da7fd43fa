"""What a pair tells of each arc of the ring, compiled: see `core/compiled.py`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]


@compiled("float64[:, ::1](float64[:, ::1], float64[:, ::1], float64[::1], int64, int64, float64, float64)")
def tells(
    shown: Array, expected: Array, variances: Array, shortest: int, longest: int, least_gain: float, most_gain: float
) -> Array:
    """Log odds of nothing there against the ring there, for each arc: `withdrawal._tells`.

    Args:
        shown: (P, S) evidence of each segment.
        expected: (P, S) of the ring, if it is there.
        variances: (P,) of a segment's.
        shortest: arc, segments,
        longest: and the longest one.
        least_gain: of the rest of the ring,
        most_gain: and the largest one.

    Returns:
        (P, A).
    """
    planes, count = shown.shape
    odds = np.empty((planes, (longest - shortest + 1) * count))
    for p in range(planes):
        all_cross, all_energy = 0.0, 0.0
        for s in range(count):
            all_cross += shown[p, s] * expected[p, s]
            all_energy += expected[p, s] * expected[p, s]
        for first in range(count):
            cross, energy, known = 0.0, 0.0, 0
            for length in range(1, longest + 1):
                s = (first + length - 1) % count
                cross += shown[p, s] * expected[p, s]
                energy += expected[p, s] * expected[p, s]
                known += expected[p, s] > 0.0
                if length < shortest:
                    continue
                at = (length - shortest) * count + first
                if known < shortest:
                    odds[p, at] = 0.0
                    continue
                gain = (all_cross - cross) / max(all_energy - energy, 1e-6)
                gain = min(max(gain, least_gain), most_gain)
                odds[p, at] = (gain * gain * energy - 2.0 * gain * cross) / (2.0 * variances[p])
    return odds
