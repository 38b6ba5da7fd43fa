"""How long the last pairs took, as percentiles."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from msg_adapters.topics import LAST_LATENCY_KEY

PERCENTILES = (50, 95, 99)


@dataclass(frozen=True)
class _Tuning:
    """Which latencies count.

    Attributes:
        remembered: pairs whose latency counts.
        longest_age_s: stamps further from the clock are a recording's, or another clock's, and tell no latency.
    """

    remembered: int = 1024
    longest_age_s: float = 60.0


TUNING = _Tuning()


@dataclass
class Latencies:
    """Latencies of the last pairs: begun where images are received, ended by the worker, read by the diagnostics.

    Attributes:
        receipt_s: from the receipt of the pair's last image to the publication (steady clock).
        stamp_s: from the pair's stamp to the publication, where both are of one clock.
    """

    receipt_s: deque[float] = field(default_factory=lambda: deque(maxlen=TUNING.remembered))
    stamp_s: deque[float] = field(default_factory=lambda: deque(maxlen=TUNING.remembered))
    _received_s: dict[int, float] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def begin(self, number: int, now_s: float) -> None:
        """A pair has all its images.

        Args:
            number: of its task.
            now_s: steady clock, seconds.
        """
        with self._lock:
            self._received_s[number] = now_s
            while len(self._received_s) > TUNING.remembered:
                del self._received_s[next(iter(self._received_s))]

    def end(self, number: int, now_s: float, stamp_s: float) -> None:
        """A pair has been published.

        Args:
            number: of its task, as in `begin`.
            now_s: steady clock, seconds.
            stamp_s: how long after the pair's stamp this is, by the clock that stamps messages.
        """
        with self._lock:
            received_s = self._received_s.pop(number, None)
            if received_s is None:
                return
            self.receipt_s.append(now_s - received_s)
            if 0.0 <= stamp_s <= TUNING.longest_age_s:
                self.stamp_s.append(stamp_s)

    def words(self) -> dict[str, str]:
        """What the diagnostics say."""
        with self._lock:
            kinds = {"receipt": list(self.receipt_s), "stamp": list(self.stamp_s)}
        last = {LAST_LATENCY_KEY: f"{1e3 * kinds['receipt'][-1]:.1f}"} if kinds["receipt"] else {}
        return last | {
            f"latency {kind} to published p50, p95, p99 (ms)": ", ".join(
                f"{1e3 * value:.1f}" for value in np.percentile(values, PERCENTILES)
            )
            for kind, values in kinds.items()
            if values
        }
