"""From log odds to a probability."""

from __future__ import annotations

import math


def logistic(log_odds: float) -> float:
    """Probability whose odds have this natural logarithm; right to 1e-16, however large the odds are.

    The textbook's 1 / (1 + exp(−x)) overflows where x is below −709.
    """
    return 0.5 + 0.5 * math.tanh(0.5 * log_odds)
