"""A tracker around another: what it does not override is the other's."""

from __future__ import annotations

import time
from collections.abc import Callable

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.geometry.frames import Frame, FramePair, Seed
from lasso_motion_ros.tracking.tracker import Tracker, TrackResult


class WrappedTracker:
    """Does as another tracker does.

    Args:
        tracker: what does the work.
    """

    def __init__(self, tracker: Tracker) -> None:
        self._tracker = tracker

    def initialise(self, pair: FramePair, seed: Seed) -> TrackResult:
        """Build the model from the clicks on `pair`."""
        return self._tracker.initialise(pair, seed)

    def track(self, pair: FramePair) -> TrackResult:
        """Find the catheter in the next pair."""
        return self._tracker.track(pair)

    def prepare(self, frame: Frame) -> None:
        """Work out ahead what the next pair asks of plane A's frame alone."""
        self._tracker.prepare(frame)

    def learn(self) -> None:
        """As the tracker's."""
        self._tracker.learn()

    def leave_out(self, pair: FramePair) -> None:
        """Take note of a pair for which there is no time."""
        self._tracker.leave_out(pair)

    def reset(self) -> None:
        """Forget model and motion."""
        self._tracker.reset()

    def set_reference(self) -> None:
        """Make the present phase the reference."""
        self._tracker.set_reference()

    def reconfigure(self, config: TrackerConfig) -> None:
        """Go on with other tuning parameters."""
        self._tracker.reconfigure(config)


class TimedTracker(WrappedTracker):
    """Another tracker, timed.

    Args:
        tracker: what does the work.
        clock: seconds: wall time, or processor time where other programs must not count.

    Attributes:
        milliseconds: of each pair tracked; building the model is not timed.
    """

    def __init__(self, tracker: Tracker, clock: Callable[[], float] = time.perf_counter) -> None:
        super().__init__(tracker)
        self._clock = clock
        self.milliseconds: list[float] = []

    def track(self, pair: FramePair) -> TrackResult:
        """Find the catheter in the next pair."""
        begin = self._clock()
        try:
            return super().track(pair)
        finally:
            self.milliseconds.append(1e3 * (self._clock() - begin))
