"""How far the ring turns by itself: as expected at first, and as it has turned so far.

The heartbeat tilts it, and the atrium turns with the breath, by a degree in one patient and by ten in another. They do
so from the first beats on; a C-arm that moves without its calibration turns a ring that did not turn before.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

# What a turn tells of a hand, as a natural logarithm of the odds: so much for each standard deviation beyond what tells
# nothing, and at most so much. That it is not turned tells little: hands put rings elsewhere as they lie.
ODDS_A_SIGMA = 2.6
INDIFFERENT_SIGMAS = 1.3
MOST_ODDS = 4.5
EXPECTED_PAIRS = 4.0  # as which the expectation counts
REMEMBERED_PAIRS = 24.0  # over which what is usual follows the patient


@dataclass(frozen=True, eq=False)
class OwnTurn:
    """What is known of it.

    Attributes:
        expected_rad: standard deviation about each axis that was expected, rad.
        variance: rad², of the turn about each axis, as known by now.
        last: (3,) rotation vector, rad, by which it was turned in the last pair, from the seed pair.
        pairs: as which what is known counts.
    """

    expected_rad: float
    variance: float
    last: Array = field(default_factory=lambda: np.zeros(3))
    pairs: float = EXPECTED_PAIRS

    @staticmethod
    def expected(sigma_rad: float) -> OwnTurn:
        """Before it was seen: a standard deviation about each axis, rad."""
        return OwnTurn(sigma_rad, sigma_rad**2)

    @property
    def sigma_rad(self) -> float:
        """Standard deviation of the turn about each axis, rad."""
        return math.sqrt(self.variance)

    @property
    def excess(self) -> float:
        """How many times as far as expected it turns; 1 at least."""
        return max(self.sigma_rad / self.expected_rad, 1.0)

    def log_odds_of_a_hand(self, turn: Array, home: Array) -> float:
        """Natural logarithm of the odds that a hand has turned it since the last pair, which turns it any way and far.

        Args: as of `seen`.
        """
        sigmas = math.sqrt(self._square(turn, home)) / (self.expected_rad * self.excess)
        return min(max(ODDS_A_SIGMA * (sigmas - INDIFFERENT_SIGMAS), 0.0), MOST_ODDS)

    def seen(self, turn: Array, home: Array) -> OwnTurn:
        """With one more pair.

        What heart and breath turn comes back; what a hand or a C-arm has turned stays so, and counts once.

        Args:
            turn: (3,) rotation vector, rad, by which it is turned from the seed pair.
            home: (3,) likewise, by which it is as it belongs.
        """
        square = self._square(turn, home) / 3.0
        pairs = min(self.pairs + 1.0, REMEMBERED_PAIRS)
        variance = self.variance + (square - self.variance) / pairs
        return replace(self, variance=variance, last=np.array(turn), pairs=pairs)

    def _square(self, turn: Array, home: Array) -> float:
        """Rad², of the turn from home; what stays from pair to pair counts once."""
        own, change = turn - home, turn - self.last
        return min(float(own @ own), float(change @ change))
