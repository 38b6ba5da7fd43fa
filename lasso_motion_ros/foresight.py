"""How well the motion so far has foretold the next place, and so when a place is not to be believed."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.respiration import Estimate

Array = npt.NDArray[np.float64]

FEWEST_PAIRS = 3  # before, nothing is known of how regular the motion is
LONGEST_MEMORY = 24  # pairs; then old ones fade
# Squared Mahalanobis distances of 3 are expected. A strong heartbeat, which no prediction foretells at a few pairs a
# second, gives 20 now and then, and once 120 where 12 was usual; a lasso that is being moved, hundreds.
LARGEST_SURPRISE = 50.0
LARGEST_SHARE = 15.0  # of what was usual
PAIRS_TO_BE_SURE = 2  # in a row: what is far off for so long is no sudden breath, which is foreseeable soon


class Foresight:
    """Surprises so far: squared Mahalanobis distances of what was found from what was predicted."""

    def __init__(self) -> None:
        """Start with nothing foretold."""
        self._pairs, self._mean, self._refused = 0, 3.0, 0

    def accept(self, surprise: float) -> None:
        """Take a surprise for that of a pair that was believed."""
        self._refused = 0
        self._pairs = min(self._pairs + 1, LONGEST_MEMORY)
        self._mean += (surprise - self._mean) / (self._pairs + 1)  # the expected one counts, too

    def refusal(self, surprise: float, unforeseen: Array) -> str:
        """Why a place is not believed that lies (3,) m from the predicted one; empty if it is."""
        if self._pairs < FEWEST_PAIRS or surprise <= max(LARGEST_SURPRISE, LARGEST_SHARE * self._mean):
            return ""
        self._refused += 1
        return f"{1e3 * float(np.linalg.norm(unforeseen)):.1f} mm from where its motion so far leads: being moved?"

    @property
    def is_sure(self) -> bool:
        """Whether places have been refused for long enough that the lasso must have been moved."""
        return self._refused >= PAIRS_TO_BE_SURE


def surprise_of(unforeseen: Array, predicted: Estimate) -> float:
    """Squared Mahalanobis distance of what is (3,) m off a prediction."""
    return float(unforeseen @ np.linalg.solve(predicted.covariance, unforeseen))
