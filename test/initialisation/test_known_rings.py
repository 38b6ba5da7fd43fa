"""Rings of earlier looks: known again where they have gone, and what they add."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.breathing_lasso import CONFIG, moved, pair
from support.lasso_inputs import PERIOD_NS, lasso_pair, lasso_seed

from lasso_motion_ros.initialisation.known_rings import FollowedRing, KnownRings
from lasso_motion_ros.ring.seed_curves import build_loop_model
from lasso_motion_ros.ring.tracker import RingTracker


def followed(pairs: int, *looks: tuple[int, float]) -> FollowedRing:
    """A ring that was followed through the first of some pairs, with the last pair and log odds of looks."""
    tracker = RingTracker(CONFIG)
    first = pair(0)
    ring = FollowedRing(tracker, tracker.begin(first, build_loop_model(first, lasso_seed(), CONFIG)), first.stamp_ns)
    for index in range(1, pairs):
        assert ring.follow(pair(index)) > 1.5
    stamped = tuple((first.stamp_ns + last * PERIOD_NS, log_odds) for last, log_odds in looks)
    ring.looks = stamped or ((first.stamp_ns, 0.0),)
    return ring


@pytest.mark.parametrize("index", [0, 2, 4])
def test_a_ring_is_known_where_it_has_moved_to(index: int) -> None:
    ring = followed(3)
    points = ring.track.model.points
    known = KnownRings([ring], pair(index))
    there = points + moved(index) - moved(0)
    assert known.of(there) is ring
    assert known.of(there + np.array([0.004, 0.0, 0.0])) is None


def test_a_ring_is_not_known_in_pairs_before_it_or_of_another_run() -> None:
    ring = followed(3)
    earlier = replace(pair(0), stamp_ns=pair(0).stamp_ns - 5 * PERIOD_NS)
    assert KnownRings([ring], earlier).of(ring.track.model.points) is None


def test_looks_that_share_no_pair_add_up_and_others_do_not() -> None:
    ring = followed(1, (2, 2.0), (5, 1.0))
    stamp = [pair(0).stamp_ns + index * PERIOD_NS for index in range(8)]
    assert ring.adds(stamp[2]) == 0.0
    assert ring.adds(stamp[3]) == pytest.approx(1.95)  # half of what the first says beyond what is said of all
    assert ring.adds(stamp[6]) == pytest.approx(1.45)
    assert followed(1, (2, 99.0)).adds(stamp[3]) == 2.5
    assert followed(1, (2, -99.0)).adds(stamp[3]) == -1.0


def test_what_a_look_did_not_find_is_remembered_and_of_many_the_likeliest() -> None:
    first = followed(1, (2, 1.0))
    known = KnownRings([first], pair(0))
    again = followed(1, (2, 1.0), (5, 2.0))
    other = followed(1, (5, -2.0))
    assert known.remembered([other]) == [first, other]
    assert known.remembered([other, again]) == [again, other]
    assert len(known.remembered([other] * 9)) == 4
    assert np.all([one is first for one in KnownRings([first], pair(0)).remembered([])])


def test_what_is_seen_of_a_ring_does_not_hang_on_whether_a_pose_rests_on_it() -> None:
    ring = followed(2)
    risen = lasso_pair(2, moved(2) + np.array([0.0, 0.0, 5e-3])).b  # by the time plane B is exposed
    seen = ring.follow(replace(pair(2), b=risen))
    assert not ring.track.is_followed
    assert seen > 1.5
    assert ring.follow(lasso_pair(3, None)) < 1.5


def test_no_pair_is_followed_into_twice() -> None:
    # The next look begins with pairs that this one has followed it into, and in which it was not seen.
    ring = followed(2)
    for index in (2, 3):
        ring.follow(lasso_pair(index, None))
    assert ring.at(pair(2)) is None
    assert ring.track.last_s == pytest.approx(3 * PERIOD_NS * 1e-9)
    assert ring.at(pair(4)) is not None
