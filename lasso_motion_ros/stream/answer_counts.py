"""How the pairs were answered, in numbers."""

from __future__ import annotations

from collections import Counter

from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.tracking.tracker import TrackerState


class AnswerCounts:
    """Counts answers by state; a pair answered again, because its clicks came late, counts once, as it was last.

    Args:
        remembered: pairs that may be answered again.

    Attributes:
        half_pairs: pairs of which a plane was missing.
    """

    def __init__(self, remembered: int) -> None:
        self._remembered = remembered
        # All keys from the start: another thread goes through them while the tracker counts.
        self._states: Counter[TrackerState] = Counter(dict.fromkeys(TrackerState, 0))
        self._answers: dict[int, TrackerState] = {}
        self.half_pairs = 0

    def add(self, pair: FramePair, state: TrackerState) -> None:
        """Count a pair's answer."""
        before = self._answers.pop(pair.stamp_ns, None)
        if before is not None:
            self._states[before] -= 1
        else:
            self.half_pairs += not pair.is_whole
        self._states[state] += 1
        self._answers[pair.stamp_ns] = state
        while len(self._answers) > self._remembered:
            del self._answers[next(iter(self._answers))]

    def forget(self) -> None:
        """No pair counted so far will be answered again."""
        self._answers.clear()

    @property
    def states(self) -> dict[TrackerState, int]:
        """Pairs answered, by state; only states that occurred."""
        return {state: count for state, count in dict(self._states).items() if count}

    @property
    def pairs(self) -> int:
        """Pairs answered."""
        return sum(self._states.values())

    @property
    def poses(self) -> int:
        """Pairs answered with a pose."""
        return sum(count for state, count in self._states.items() if state.has_pose)
