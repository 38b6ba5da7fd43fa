"""How fast images come, and after how long a stream has stopped: one rule for the tracker and for the page."""

from __future__ import annotations

import statistics
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise


@dataclass(frozen=True)
class _Tuning:
    """When a stream counts as stopped where the user has not said so.

    Attributes:
        least_s: never sooner, seconds; images may come in bursts, and in one second a breath moves the heart by 10 mm.
        periods: frame periods.
        most_s: no later, seconds: two images with a long pause between them tell of no frame period.
        arrivals: images from which the frame period is taken.
    """

    least_s: float = 1.0
    periods: float = 3.0
    most_s: float = 10.0
    arrivals: int = 9


TUNING = _Tuning()


class Pace:
    """When the last images of a plane came. All times are of the steady clock, seconds."""

    def __init__(self) -> None:
        self._arrivals: deque[float] = deque(maxlen=TUNING.arrivals)

    def arrived(self, now_s: float) -> None:
        """An image has come."""
        self._arrivals.append(now_s)

    @property
    def last_s(self) -> float | None:
        """When the last image came; None before the first."""
        return self._arrivals[-1] if self._arrivals else None

    @property
    def period_s(self) -> float | None:
        """Median time between the last images; None before the second."""
        periods = [later - earlier for earlier, later in pairwise(self._arrivals)]
        return statistics.median(periods) if periods else None


def stopped_after_s(paces: Iterable[Pace]) -> float:
    """The time without what is expected of every frame after which it has stopped to come.

    Args:
        paces: of the planes; the one with the longer frame period decides.
    """
    period_s = max((pace.period_s or 0.0 for pace in paces), default=0.0)
    return min(max(TUNING.least_s, TUNING.periods * period_s), TUNING.most_s)
