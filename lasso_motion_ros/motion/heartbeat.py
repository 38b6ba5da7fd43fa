"""Phase of the heart from R peaks, and the gate that opens in a part of the beat.

All is causal: the end of the running beat is not known yet, so phases are parts of the typical beat so far.
"""

from __future__ import annotations

import math
from bisect import bisect_right, insort
from dataclasses import dataclass

import numpy as np

from lasso_motion_ros.core.errors import ConfigurationError

REMEMBERED_PEAKS = 24
TYPICAL_OF = 8  # intervals whose median is the typical beat: one missing and one extra peak do not change it
SHORTEST_BEAT = 0.6  # of the typical beat; an earlier peak is a false detection or a premature beat
LONGEST_BEAT = 1.6  # a longer interval has a missing peak in it
LAST_SURE_BEAT = 2.5  # beats after the last peak at which its phase still means something
NEW_RUN_NS = 1_000_000_000  # stamps back by more than this: another run, as for images
SAME_PEAK_NS = 20_000_000


@dataclass(frozen=True)
class HeartPhase:
    """Where an exposure lies in the heart's beat, as known when it was taken.

    Attributes:
        peak_ns: stamp of the R peak it is counted from.
        beat_ns: length of a typical beat.
        doubtful: an unexpected peak came since: a false detection, or a premature beat.
    """

    peak_ns: int
    beat_ns: int
    doubtful: bool = False

    def at(self, stamp_ns: int) -> float:
        """Beats from the peak to a time, its fraction being the phase; beyond 1 the next peak is overdue."""
        return (stamp_ns - self.peak_ns) / self.beat_ns

    @property
    def frequency_hz(self) -> float:
        """Beats per second."""
        return 1e9 / self.beat_ns


class RPeaks:
    """R peaks as they come: late ones are sorted in, repeated ones dropped, unexpected ones doubted."""

    def __init__(self) -> None:
        self._peaks: list[int] = []

    def add(self, stamp_ns: int) -> None:
        """Take a peak's stamp; one more than a second before the last begins a new run."""
        if self._peaks and stamp_ns < self._peaks[-1] - NEW_RUN_NS:
            self._peaks.clear()
        if all(abs(stamp_ns - peak) > SAME_PEAK_NS for peak in self._peaks):
            insort(self._peaks, stamp_ns)
            del self._peaks[:-REMEMBERED_PEAKS]

    def begin_run(self, stamp_ns: int) -> None:
        """A new run begins at a stamp: forget the peaks of the last, unless the new run's own came first."""
        if self._peaks and abs(self._peaks[-1] - stamp_ns) > NEW_RUN_NS:
            self._peaks.clear()

    def phase(self, stamp_ns: int) -> HeartPhase | None:
        """The phase at a time by the peaks up to it.

        Returns:
            None where it is unknown: fewer than two peaks before, or none in the last 2.5 beats.
        """
        peaks = self._peaks[: bisect_right(self._peaks, stamp_ns)]
        if len(peaks) < 2:
            return None
        rough = float(np.median(np.diff(peaks)[-TYPICAL_OF:]))
        accepted = peaks[:1]
        for peak in peaks[1:]:
            if peak - accepted[-1] >= SHORTEST_BEAT * rough:
                accepted.append(peak)
        beats = np.diff(accepted)
        beats = beats[beats <= LONGEST_BEAT * rough][-TYPICAL_OF:]
        beat_ns = round(float(np.median(beats)) if len(beats) else rough)
        phase = HeartPhase(accepted[-1], beat_ns, doubtful=peaks[-1] != accepted[-1])
        return phase if phase.at(stamp_ns) <= LAST_SURE_BEAT else None


class CardiacGate:
    """Open in one part of every beat.

    Args:
        start: phase at which it opens, 0 (R peak) to 1 (the next).
        end: phase at which it closes; below `start` the window reaches over the R peak.

    Raises:
        ConfigurationError: a window without width.
    """

    def __init__(self, start: float, end: float) -> None:
        if math.isclose(start, end):
            raise ConfigurationError(f"heartbeat.window_start and window_end must differ, both are {start:g}")
        self._start, self._end = start, end

    def is_open(self, phase: HeartPhase | None, stamp_ns: int) -> bool:
        """Whether an exposure lies in the window; never where the phase is unknown, doubtful or overdue."""
        if phase is None or phase.doubtful:
            return False
        part = phase.at(stamp_ns)
        if not 0.0 <= part < 1.0:
            return False
        if self._start < self._end:
            return self._start <= part < self._end
        return part >= self._start or part < self._end
