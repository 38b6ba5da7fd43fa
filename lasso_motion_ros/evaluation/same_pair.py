"""Which stamps are one pair's: those of a pair that lacks plane A come from plane B, rounded."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol, TypeVar

NEAR_NS = 5_000_000  # far below the time between two pairs


class Stamped(Protocol):
    """What belongs to a pair."""

    @property
    def stamp_ns(self) -> int:
        """Of the pair, or nearly."""


OneStamped = TypeVar("OneStamped", bound=Stamped)


def is_same_pair(stamp_ns: int, other_ns: int) -> bool:
    """Whether two stamps are one pair's."""
    return abs(stamp_ns - other_ns) <= NEAR_NS


def of_pair(things: Iterable[OneStamped], stamp_ns: int) -> OneStamped | None:
    """The first that belongs to the pair with a stamp, or None."""
    return next((thing for thing in things if is_same_pair(thing.stamp_ns, stamp_ns)), None)
