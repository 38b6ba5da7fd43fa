"""Closes connections that ask for nothing: half-open ones would stay for ever, and take the places of pages."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class _Tuning:
    """How long a connection may wait.

    Attributes:
        request_s: for its next whole request, seconds: a browser on a slow line needs less than a second.
        most_waiting: connections that may wait at once; of more, the oldest are closed at once.
    """

    request_s: float = 10.0
    most_waiting: int = 64


TUNING = _Tuning()


class IdleConnections:
    """Knows which connections have a request, and ends those that have had none for too long.

    aiohttp waits without end for a connection's first request, and for the rest of one that has begun.

    Args:
        clock: steady clock, seconds.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._waiting_since: dict[Any, float] = {}
        self._busy: Counter[Any] = Counter()

    def begin(self, connection: Any) -> None:
        """A whole request has come."""
        self._busy[connection] += 1
        self._waiting_since.pop(connection, None)

    def end(self, connection: Any) -> None:
        """It is answered."""
        self._busy[connection] -= 1
        if not self._busy[connection]:
            del self._busy[connection]

    def sweep(self, connections: Iterable[Any]) -> int:
        """Close those that have waited for too long, or are too many; returns how many."""
        now = self._clock()
        waiting = [one for one in connections if one not in self._busy and one.transport is not None]
        self._waiting_since = since = {one: self._waiting_since.get(one, now) for one in waiting}
        oldest_first = sorted(waiting, key=lambda one: since[one])
        surplus = len(waiting) - TUNING.most_waiting
        ended = [
            one for place, one in enumerate(oldest_first) if place < surplus or now - since[one] > TUNING.request_s
        ]
        for one in ended:
            one.transport.abort()
        return len(ended)
