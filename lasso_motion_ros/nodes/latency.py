"""How long the last pairs took, as percentiles."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from lasso_motion_ros.evaluation.recorded_input import LAST_LATENCY_KEY

REMEMBERED = 1024
PERCENTILES = (50, 95, 99)
LONGEST_AGE_S = 60.0
"""Stamps further from the clock are a recording's, or another clock's: they tell no latency."""


@dataclass
class Latencies:
    """Latencies of the last pairs; written by the worker, read by the diagnostics.

    Attributes:
        receipt_s: from the receipt of the pair's last image to the publication (steady clock).
        stamp_s: from the pair's stamp to the publication, where both are of one clock.
    """

    receipt_s: deque[float] = field(default_factory=lambda: deque(maxlen=REMEMBERED))
    stamp_s: deque[float] = field(default_factory=lambda: deque(maxlen=REMEMBERED))
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def add(self, receipt_s: float, stamp_s: float) -> None:
        """Take one pair's, seconds."""
        with self._lock:
            self.receipt_s.append(receipt_s)
            if 0.0 <= stamp_s <= LONGEST_AGE_S:
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
