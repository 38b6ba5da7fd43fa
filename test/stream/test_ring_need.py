"""When a ring is looked for again, what is found then, and what it becomes the reference of."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from support.breathing_lasso import ASIDE, DISPLACED, LOST, TRACKING, WARM, centre_error_mm, moved, pair, warm_up
from support.lasso_inputs import CURVE, LOOP, PERIOD_NS, curve_pair, lasso_pair, turned

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.initialisation.proposal import Proposal
from lasso_motion_ros.ring.tracker import RingTracker
from lasso_motion_ros.stream.automatic_start import RingLookout
from lasso_motion_ros.stream.ring_need import LONG_NS, Need, RingNeed
from lasso_motion_ros.tracking.tracker import TrackerState, TrackResult

LONG = LONG_NS // PERIOD_NS + 1  # pairs
STATES_WITHOUT_MODEL = (TrackerState.INACTIVE, TrackerState.WAITING_FOR_CALIBRATION)


@pytest.fixture
def tracker() -> RingTracker:
    """A tracker that has followed the drawn lasso for a breath and a half; each test has its own."""
    return copy.deepcopy(warm_up()[0])


class Watched:
    """A tracker that has followed the drawn lasso, and who looks for the ring where it does not."""

    def __init__(self, tracker: RingTracker) -> None:
        self.tracker, self.need, self.lookout = tracker, RingNeed(), RingLookout(StreamConfig(polarity="dark"))
        self.needs: list[Need] = []
        self.found: list[Proposal] = []
        self.last: TrackResult | None = None

    def take(self, pairs: list[FramePair]) -> None:
        for one in pairs:
            self.last = self.tracker.track(one)
            self.need.take(one, self.last.state)
            self.needs.append(self.need.now(self.last.state))
            if self.needs[-1] is Need.NONE:
                self.lookout.forget()
            elif looked_at := self.lookout.add(one):
                self.found += self.lookout.look(looked_at)


def hidden(first: int, count: int) -> list[FramePair]:
    return [lasso_pair(index, None) for index in range(first, first + count)]


@pytest.mark.parametrize("state", STATES_WITHOUT_MODEL)
def test_nothing_is_looked_for_before_there_are_pairs(state: TrackerState) -> None:
    assert RingNeed().now(state) is Need.NONE


def test_without_a_model_it_is_looked_for_at_once_and_with_one_only_when_it_has_been_gone_for_long() -> None:
    need = RingNeed()
    assert need.now(TrackerState.WAITING_FOR_SEED) is Need.FIRST
    states = [TRACKING] + [LOST] * 2 + [TRACKING] + [LOST, DISPLACED] * LONG
    needs = []
    for index, state in enumerate(states):
        need.take(pair(index % 12), state) if index < 12 else need.take(lasso_pair(index, None), state)
        needs.append(need.now(state))
    assert needs[: 4 + LONG] == [Need.NONE] * (4 + LONG)
    assert set(needs[4 + LONG :]) == {Need.AGAIN}
    assert need.now(TRACKING) is Need.NONE


@pytest.mark.slow
def test_hidden_for_long_it_is_looked_for_and_back_as_it_was_it_is_followed_on_the_old_reference(
    tracker: RingTracker,
) -> None:
    watched = Watched(tracker)
    watched.take(hidden(WARM, LONG + 2))
    assert watched.needs[-1] is Need.AGAIN
    assert not watched.found
    back = WARM + LONG + 2
    watched.take([pair(index) for index in range(back, back + 4)])
    assert watched.last is not None
    assert watched.last.state is TRACKING
    assert watched.needs[-1] is Need.NONE
    assert watched.last.reference_stamp_ns == 0
    assert centre_error_mm(watched.last, moved(back + 3)) < 0.3


@pytest.mark.slow
def test_moved_and_staying_it_is_found_and_who_takes_it_begins_a_reference_there(tracker: RingTracker) -> None:
    watched = Watched(tracker)
    last = WARM + LONG + 3
    watched.take([pair(index, ASIDE) for index in range(WARM, last)])
    assert watched.last is not None
    assert watched.last.state is DISPLACED
    ring = watched.found[0]
    first = ring.pair.stamp_ns // PERIOD_NS
    assert 1e3 * np.linalg.norm(ring.centre - LOOP.centre - ASIDE - moved(first)) < 1.0
    began = tracker.initialise(ring.pair, ring.seed)
    assert began.state.has_pose
    assert began.reference_stamp_ns == ring.pair.stamp_ns
    watched.take([pair(index, ASIDE) for index in range(first + 1, last)])
    assert watched.last.state is TRACKING
    assert centre_error_mm(watched.last, ASIDE + moved(last - 1), ASIDE + moved(first)) < 0.5


@pytest.mark.slow
def test_back_with_another_attitude_the_tracker_does_not_know_it_but_it_is_found(tracker: RingTracker) -> None:
    watched = Watched(tracker)
    watched.take(hidden(WARM, LONG))
    again = turned((25.0, -20.0, 40.0))
    first, last = WARM + LONG, WARM + LONG + 3
    watched.take([curve_pair(index, again + moved(index)) for index in range(first, last)])
    assert watched.last is not None
    assert watched.last.state in (LOST, DISPLACED)
    assert len(watched.found) == 1
    ring = watched.found[0]
    middle = CURVE.mean(axis=0) + moved(ring.pair.stamp_ns // PERIOD_NS)
    assert 1e3 * np.linalg.norm(ring.centre - middle) < 1.0
    assert tracker.initialise(ring.pair, ring.seed).state.has_pose
