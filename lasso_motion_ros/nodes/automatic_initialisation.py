"""Looks for the ring beside the live stream, in a thread of its own, and says what it has found."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.initialisation.proposal import Proposal
from lasso_motion_ros.initialisation.ring_finder import OvertakenError
from lasso_motion_ros.nodes.worker import Worker
from lasso_motion_ros.stream.automatic_start import ProposedRings, RingLookout, only_ring
from lasso_motion_ros.stream.ring_need import Need, RingNeed
from lasso_motion_ros.tracking.tracker import TrackerState

NICENESS = 10  # on Linux of this thread only: images and pairs go first
# After a look, by how long it took: where there is a model, the tracker that looks for its ring goes first.
RESTS = {Need.FIRST: 1.0, Need.AGAIN: 4.0}


class AutomaticInitialisation:
    """The pairs that were answered go in, and no pair waits for it: a look that clicks or a pose overtake gives up.

    After a look the thread rests for as long as it took: while nobody clicks, half a core is busy at most.

    Args:
        config: the parameters.
        state: gives the state that the last pair was answered with.
        on_proposals: called with what a look has found, if that is news, and when a ring is passed over; best first.
        on_start: called in the thread with the ring to start with, unasked; never one that was passed over, nor where
            there is a model. Clicks may have come: whoever is told asks once more whether there is one now.
        on_error: takes what a look raised.
    """

    def __init__(
        self,
        config: StreamConfig,
        state: Callable[[], TrackerState],
        on_proposals: Callable[[Sequence[Proposal]], None],
        on_start: Callable[[Proposal], None],
        on_error: Callable[[Exception], None],
    ) -> None:
        self._mode = config.automatic_initialisation
        self._lookout = RingLookout(config)
        self._state, self._on_proposals, self._on_start = state, on_proposals, on_start
        self._need = RingNeed()
        self._lock = threading.Lock()
        self._proposed = ProposedRings()
        self._stopped, self._is_nice = threading.Event(), False
        self._overtaken = 0  # how often
        # One look may wait: of those that are overtaken the newest counts.
        self._worker: Worker[tuple[FramePair, ...]] = Worker(
            self._look, capacity=1, burst_capacity=1, takes_long=lambda _: False, on_error=on_error, name="lookout"
        )

    def reconfigure(self, config: StreamConfig) -> None:
        """Go on with other parameters."""
        self._mode = config.automatic_initialisation
        self._lookout.reconfigure(config)

    def add(self, pair: FramePair) -> None:
        """Take a pair that was answered; never waits."""
        self._need.take(pair, self._state())
        if self._mode == "off" or self._now is Need.NONE:
            self._lookout.forget()
            self._propose([])
            return
        if pair.new_run:
            self._propose([])  # a ring of another run
        if pairs := self._lookout.add(pair):
            self._worker.put([pairs])

    def accepted(self) -> Proposal:
        """The ring that is proposed first: the best that was not passed over.

        Raises:
            TrackingError: there is none.
        """
        with self._lock:
            return self._proposed.first

    def pass_over(self) -> Proposal:
        """Put the ring that is proposed first behind the others, in later looks too; the one that is first now.

        Raises:
            TrackingError: there is no other.
        """
        with self._lock:
            self._proposed.pass_over()
            self._on_proposals(self._proposed.rings)
            return self._proposed.first

    def overtake(self) -> None:
        """Clicks or a reset have come: give up what is being looked at; never waits."""
        self._overtaken += 1
        self._worker.clear()

    def stop(self, patience_s: float) -> None:
        """End the thread, with what it is looking at."""
        self._stopped.set()
        self._worker.stop(patience_s)
        self._propose([])

    def _look(self, pairs: tuple[FramePair, ...]) -> None:
        if not self._is_nice:
            os.nice(NICENESS)
            self._is_nice = True
        overtaken, begun_s = self._overtaken, time.monotonic()
        goes_on = partial(self._goes_on, overtaken)
        try:
            found = self._lookout.look(pairs, goes_on)
        except OvertakenError:
            return
        if found and goes_on():  # else what was proposed before stands
            self._propose(found)
            ring = only_ring(found)
            is_first = self._mode == "start" and self._now is Need.FIRST
            if is_first and ring is not None and not self._was_passed_over(ring):
                self._on_start(ring)
        self._stopped.wait(RESTS.get(self._now, 0.0) * (time.monotonic() - begun_s))

    @property
    def _now(self) -> Need:
        return self._need.now(self._state())

    def _goes_on(self, overtaken: int) -> bool:
        is_first = overtaken == self._overtaken and not self._stopped.is_set()
        return is_first and self._mode != "off" and self._now is not Need.NONE

    def _was_passed_over(self, ring: Proposal) -> bool:
        with self._lock:
            return self._proposed.was_passed_over(ring)

    def _propose(self, found: list[Proposal]) -> None:
        with self._lock:
            if not found and not self._proposed.rings:
                return
            self._proposed.replace(found)
            self._on_proposals(self._proposed.rings)  # in the order in which they hold
