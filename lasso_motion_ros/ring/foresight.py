"""How far the motion so far foretells a place: which of several alike it leads to, and when none is to be believed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.covariance import squared_mahalanobis
from lasso_motion_ros.motion.respiration import Estimate, RespiratoryMotion
from lasso_motion_ros.ring.finding import Finding

Array = npt.NDArray[np.float64]

GAP_SIGMAS = 2.5  # of them the planes' disagreement may be before it makes the state DEGRADED
FEWEST_PAIRS = 3  # before, nothing is known of how regular the motion is
LONGEST_MEMORY = 24  # pairs; then old ones fade
# Squared Mahalanobis distances of 3 are expected. A strong heartbeat, which no prediction foretells at a few pairs a
# second, gives more; a lasso that is being moved, hundreds (docs/constants.md).
LARGEST_SURPRISE = 50.0
LARGEST_SHARE = 15.0  # of what was usual
PAIRS_TO_BE_SURE = 2  # refused, and none believed between: a sudden breath is foreseeable sooner


@dataclass(frozen=True, eq=False)
class Trial:
    """A finding, and what would follow from it.

    Attributes:
        finding: of the loop in the pair.
        respiration: the filter of the motion after it.
        departure: why the motion cannot be breathing; empty if it can.
        unforeseen: (3,) by which the displacement is off the predicted one, metres.
        surprise: squared Mahalanobis distance of that; 3 is expected.
    """

    finding: Finding
    respiration: RespiratoryMotion
    departure: str
    unforeseen: Array
    surprise: float

    @property
    def displacement(self) -> Array:
        """(3,) of the loop's centre since the reference, metres."""
        return self.respiration.at_a.displacement

    @property
    def implausibility(self) -> tuple[bool, float]:
        """More where it cannot be breathing, then where motion and planes make it less likely."""
        disagreement = GAP_SIGMAS * self.finding.gap_mm / self.finding.degraded_gap_mm
        return self.departure != "", self.surprise + disagreement**2


class Foresight:
    """Surprises so far."""

    def __init__(self) -> None:
        """Start with nothing foretold."""
        self._pairs, self._mean, self._refused = 0, 3.0, 0

    def accept(self, trial: Trial) -> None:
        """Take a trial for that of a pair that was believed."""
        self._refused = 0
        self._pairs = min(self._pairs + 1, LONGEST_MEMORY)
        self._mean += (trial.surprise - self._mean) / (self._pairs + 1)  # the expected one counts, too

    def refusal(self, trial: Trial) -> str:
        """Why a trial is not believed; empty if it is."""
        if self._pairs < FEWEST_PAIRS or trial.surprise <= max(LARGEST_SURPRISE, LARGEST_SHARE * self._mean):
            return ""
        self._refused += 1
        distance_mm = 1e3 * float(np.linalg.norm(trial.unforeseen))
        return f"{distance_mm:.1f} mm from where its motion so far leads: being moved?"

    @property
    def is_sure(self) -> bool:
        """Whether trials have been refused for long enough that the lasso must have been moved."""
        return self._refused >= PAIRS_TO_BE_SURE


def surprise_of(unforeseen: Array, predicted: Estimate) -> float:
    """Squared Mahalanobis distance of what is (3,) m off a prediction."""
    return squared_mahalanobis(unforeseen, predicted.covariance)
