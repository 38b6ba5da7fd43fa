"""The heart's phase at each pair, from the R peaks that were known when the pair was complete."""

from __future__ import annotations

from lasso_motion_ros.motion.heartbeat import HeartPhase, RPeaks


class HeartPhases:
    """Takes the phase down when a pair is complete.

    A pair that waits for the tracker, or is answered again because its clicks came late, so keeps the phase that was
    known then, and timing changes no pose. One thread adds, another may read.

    Args:
        remembered: pairs whose phases are kept.

    Attributes:
        peaks_received: R peaks so far.
    """

    def __init__(self, remembered: int) -> None:
        self._remembered = remembered
        self._peaks = RPeaks()
        self._phases: dict[int, HeartPhase | None] = {}
        self.peaks_received = 0

    def add_r_peak(self, stamp_ns: int) -> None:
        """Take an R peak's stamp."""
        self._peaks.add(stamp_ns)
        self.peaks_received += 1

    def add_pair(self, stamp_ns: int, *, new_run: bool) -> None:
        """Take down the phase at a pair that has come."""
        if new_run:
            self._peaks.begin_run(stamp_ns)
        self._phases[stamp_ns] = self._peaks.phase(stamp_ns)
        while len(self._phases) > self._remembered:
            del self._phases[next(iter(self._phases))]

    @property
    def r_peaks_ns(self) -> tuple[int, ...]:
        """Stamps of the R peaks that are known now, ascending."""
        return self._peaks.stamps_ns

    def is_remembered(self, stamp_ns: int) -> bool:
        """Whether the pair is one of the last."""
        return stamp_ns in self._phases

    def at(self, stamp_ns: int) -> HeartPhase | None:
        """The phase at a pair; None where it was not known, or the pair is not remembered."""
        return self._phases.get(stamp_ns)
