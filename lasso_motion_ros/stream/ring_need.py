"""Whether a ring is to be looked for: there is no model, or its ring has not been where it belongs for long."""

from __future__ import annotations

from enum import Enum

from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.tracking.tracker import TrackerState

# The tracker looks everywhere itself, for the ring as it was. Contrast hides it for some four seconds.
LONG_NS = 5_000_000_000


class Need(Enum):
    """What a ring is looked for, for.

    Attributes:
        NONE: it is followed, or may be found again by the tracker itself.
        FIRST: there is no model.
        AGAIN: there is one, but LOST or DISPLACED for long. Who begins anew begins a reference at which no volume has
            been registered, and what takes the ring away is a hand more often than not: nobody does so unasked.
    """

    NONE = "none"
    FIRST = "first"
    AGAIN = "again"


class RingNeed:
    """Tells it by how the pairs were answered."""

    def __init__(self) -> None:
        self._since_ns: int | None = None
        self._is_long = False

    def take(self, pair: FramePair, state: TrackerState) -> None:
        """Take note of a pair and the state that it was answered with."""
        if not state.is_alarm:
            self._since_ns = None
        elif self._since_ns is None or pair.new_run:
            self._since_ns = pair.stamp_ns
        self._is_long = self._since_ns is not None and pair.stamp_ns - self._since_ns >= LONG_NS

    def now(self, state: TrackerState) -> Need:
        """What there is, in the state that the tracker is in now."""
        if state is TrackerState.WAITING_FOR_SEED:
            return Need.FIRST
        return Need.AGAIN if state.is_alarm and self._is_long else Need.NONE
