"""How the ring lies from pair to pair: the heartbeat tilts it to and fro, in another vein it lies otherwise."""

from __future__ import annotations

from collections import deque

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

FOUND_AGAIN_TURN_DEG = 4.0  # what is found again may be turned so far from how it lay in any pair before
STILL_TURNED_SHARE = 0.6  # of that, once it was turned further: its tilt takes it to and fro across a limit
PAIRS_KEPT = 64


class RingLay:
    """Rotation vectors (3,) rad of the ring since the seed pair: the last one, and those in its place.

    Attributes:
        last: when last seen.
    """

    def __init__(self) -> None:
        """Start at the seed pair, where it lies as it belongs."""
        self.last: Array = np.zeros(3)
        self.settle()

    def settle(self) -> None:
        """Take it that the ring belongs as it lies now."""
        self._home = self.last
        self._before = deque([self.last], maxlen=PAIRS_KEPT)
        self._is_turned_away = False

    def accept(self, turn: Array) -> None:
        """Take a rotation vector (3,) rad for one of the ring in its place."""
        self.last = turn
        self._before.append(turn)
        self._is_turned_away = False

    def turned_deg(self, turn: Array) -> float:
        """Angle between a rotation vector (3,) rad and how the ring belongs, degrees."""
        return float(np.degrees(np.linalg.norm(turn - self._home)))

    def return_refusal(self, turn: Array) -> str:
        """Why a ring that was found after a loss lies too differently from any pair before; empty if it does not."""
        turned_deg = min(float(np.degrees(np.linalg.norm(turn - before))) for before in self._before)
        if turned_deg <= FOUND_AGAIN_TURN_DEG * (STILL_TURNED_SHARE if self._is_turned_away else 1.0):
            return ""
        self._is_turned_away = True
        return f"found again, but turned by {turned_deg:.0f} degrees: moved?"
