"""Phase of the heart from R peaks, and the gate that opens in a part of the beat.

Causal: the end of the current beat is not known yet, so a phase is a part of the typical beat so far.
"""

from __future__ import annotations

import math
from bisect import bisect_right, insort
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lasso_motion_ros.core.errors import ConfigurationError


@dataclass(frozen=True)
class PeakTuning:
    """Which R peaks are believed, and for how long. Lengths are in typical beats unless the name has a unit.

    Attributes:
        remembered: peaks kept.
        typical_of: intervals whose median is the typical beat: one missing and one extra peak do not change it.
        shortest_beat: an earlier peak is a false detection or a premature beat.
        longest_beat: a longer interval has a missing peak in it.
        overdue_beat: so long after the last peak the phase of a beat that goes on is no longer known.
        last_sure_beat: so long after the last peak its phase still means something.
        new_run_ns: stamps that go back by more begin another run, as for images.
        same_peak_ns: peaks closer than this are one.
    """

    remembered: int = 64
    typical_of: int = 8
    shortest_beat: float = 0.6
    longest_beat: float = 1.6
    overdue_beat: float = 1.45
    last_sure_beat: float = 2.5
    new_run_ns: int = 1_000_000_000
    same_peak_ns: int = 20_000_000


TUNING = PeakTuning()


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


@dataclass(frozen=True)
class Beats:
    """The heart's beats by the R peaks known at one time: of any moment, the part of its beat that had passed.

    Attributes:
        peaks_s: times of the peaks, ascending, seconds: those that are believed.
        beat_s: length of a typical beat, seconds.
    """

    peaks_s: tuple[float, ...]
    beat_s: float

    @staticmethod
    def of(peaks_s: Sequence[float]) -> Beats | None:
        """By peaks, ascending, seconds; None for fewer than two, or where they tell of no beat's length."""
        if len(peaks_s) < 2:
            return None
        accepted, beat_s = _accepted(peaks_s)
        return Beats(tuple(accepted), beat_s) if beat_s > 0.0 else None

    def phase(self, time_s: float) -> float:
        """0 at an R peak, 1 at the next, and until that has come.

        Args:
            time_s: at which it is known, see `is_known`.
        """
        last = bisect_right(self.peaks_s, time_s) - 1
        return min((time_s - self.peaks_s[last]) / self._length_s(last), 1.0)

    def is_known(self, time_s: float) -> bool:
        """Whether its phase at a time means something: not before the first peak, nor where the next one is overdue.

        Then the heart may pause, or a peak was missed, or comes late.
        """
        last = bisect_right(self.peaks_s, time_s) - 1
        return last >= 0 and time_s - self.peaks_s[last] <= TUNING.overdue_beat * self._length_s(last)

    def _length_s(self, last: int) -> float:
        """Of the beat after a peak, as far as it is known; a typical one where it is not, or a peak was missed."""
        if last + 1 < len(self.peaks_s):
            seen_s = self.peaks_s[last + 1] - self.peaks_s[last]
            if seen_s <= TUNING.longest_beat * self.beat_s:
                return seen_s
        return self.beat_s


class RPeaks:
    """R peaks as they come: late ones are sorted in, repeated ones dropped, unexpected ones marked doubtful."""

    def __init__(self) -> None:
        self._peaks: list[int] = []

    def add(self, stamp_ns: int) -> None:
        """Take a peak's stamp; one more than a second before the last begins a new run."""
        if self._peaks and stamp_ns < self._peaks[-1] - TUNING.new_run_ns:
            self._peaks.clear()
        if all(abs(stamp_ns - peak) > TUNING.same_peak_ns for peak in self._peaks):
            insort(self._peaks, stamp_ns)
            del self._peaks[: -TUNING.remembered]

    def begin_run(self, stamp_ns: int) -> None:
        """A new run begins at a stamp: forget the peaks of the last, unless the new run's own came first."""
        if self._peaks and abs(self._peaks[-1] - stamp_ns) > TUNING.new_run_ns:
            self._peaks.clear()

    def phase(self, stamp_ns: int) -> HeartPhase | None:
        """The phase at a time by the peaks up to it.

        Returns:
            None where it is unknown: fewer than two peaks before, or none in the last 2.5 beats.
        """
        peaks = self._peaks[: bisect_right(self._peaks, stamp_ns)]
        if len(peaks) < 2:
            return None
        accepted, beat_ns = _accepted(peaks)
        phase = HeartPhase(round(accepted[-1]), round(beat_ns), doubtful=peaks[-1] != accepted[-1])
        return phase if phase.at(stamp_ns) <= TUNING.last_sure_beat else None

    @property
    def stamps_ns(self) -> tuple[int, ...]:
        """The peaks so far, ascending, as many as are remembered."""
        return tuple(self._peaks)


def _accepted(peaks: Sequence[float]) -> tuple[list[float], float]:
    """The peaks, two or more, that are believed, and the typical beat; in whatever unit of time."""
    rough = float(np.median(np.diff(peaks)[-TUNING.typical_of :]))
    accepted = [peaks[0]]
    for peak in peaks[1:]:
        if peak - accepted[-1] >= TUNING.shortest_beat * rough:
            accepted.append(peak)
    beats = np.diff(accepted)
    beats = beats[beats <= TUNING.longest_beat * rough][-TUNING.typical_of :]
    return accepted, float(np.median(beats)) if len(beats) else rough


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
