"""Which image of plane B belongs to which image of plane A, by their stamps: one rule, for everybody.

A B belongs to the last A that is not later than it (jitter aside), up to half of A's frame period after it; or, where
the time from A's to B's exposure is known, to the A nearest to it. Tracker, overlay and page apply it as the parameters
`sync.…` say; whatever only reads a recording (truth, annotation, `lasso-motion check`) with their defaults.
"""

from __future__ import annotations

import statistics
from collections import deque
from dataclasses import dataclass

NEW_RUN_NS = 1_000_000_000
"""Stamps that go back by more than this begin a new run."""


@dataclass(frozen=True)
class _Tuning:
    """How a frame period is learnt from stamps.

    Attributes:
        longest_period_ns: the slowest sequence has 1 frame/s; a longer interval is a pause and tells no period.
        recent: intervals that count. Their median outlives single lost frames.
    """

    longest_period_ns: int = 1_000_000_000
    recent: int = 5


TUNING = _Tuning()


class FrameIntervals:
    """The last frame intervals of plane A, learnt from its stamps."""

    def __init__(self) -> None:
        self._last_stamp_ns: int | None = None
        self._intervals: deque[int] = deque(maxlen=TUNING.recent)

    def add(self, stamp_ns: int) -> None:
        """Take the next stamp; one that is not later is left out, one of a new run begins anew."""
        last_ns = self._last_stamp_ns
        if last_ns is not None:
            if stamp_ns < last_ns - NEW_RUN_NS:
                self._intervals.clear()
            elif stamp_ns <= last_ns:
                return
            else:
                self._intervals.append(min(stamp_ns - last_ns, TUNING.longest_period_ns))
        self._last_stamp_ns = stamp_ns

    @property
    def last_ns(self) -> int | None:
        """The last interval; None before the first."""
        return self._intervals[-1] if self._intervals else None

    @property
    def period_ns(self) -> int | None:
        """The frame period; None before the first interval."""
        return statistics.median_low(self._intervals) if self._intervals else None

    @property
    def shortest_ns(self) -> int | None:
        """The shortest of the intervals; None before the first."""
        return min(self._intervals) if self._intervals else None


@dataclass(frozen=True)
class PartnerRule:
    """The rule, as `sync` configures it.

    Attributes:
        jitter_ns: a B this much earlier than its A still belongs to it.
        offset_ns: the time from A's to B's exposure, where it is known; else None.
    """

    jitter_ns: int = 5_000_000
    offset_ns: int | None = None

    @classmethod
    def from_seconds(cls, jitter_s: float, plane_b_offset_s: float) -> PartnerRule:
        """The rule from the parameters `sync.jitter_s` and `sync.plane_b_offset_s` (negative: unknown)."""
        return cls(round(jitter_s * 1e9), round(plane_b_offset_s * 1e9) if plane_b_offset_s >= 0.0 else None)

    def window_ns(self, period_ns: int | None, shortest_ns: int | None) -> tuple[int, int]:
        """How long after an A's exposure that of its B may be: the earliest and the latest, nanoseconds.

        Args:
            period_ns: A's frame period; None where it is unknown.
            shortest_ns: A's shortest recent interval, likewise. It counts where the offset is known: a lost A makes
                an interval twice as long, and a known offset needs no such margin.
        """
        if self.offset_ns is None:
            return -self.jitter_ns, (period_ns or 0) // 2 + self.jitter_ns
        reach = max(2 * (shortest_ns or 0) // 5, self.jitter_ns)
        return self.offset_ns - reach, self.offset_ns + reach
