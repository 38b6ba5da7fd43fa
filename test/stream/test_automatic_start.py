"""Rings that are proposed: in which order, and which comes next."""

from __future__ import annotations

import pytest
from support.lasso_inputs import CURVE, PERIOD_NS, lasso_pair
from support.proposed_ring import ring

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import TrackingError
from lasso_motion_ros.initialisation.proposal import Proposal
from lasso_motion_ros.stream.automatic_start import ProposedRings, RingLookout


def places(rings: list[Proposal]) -> list[float]:
    return [round(float(one.points[0, 0] - CURVE[0, 0]), 3) for one in rings]


def test_a_ring_that_is_passed_over_comes_last_in_later_looks_too() -> None:
    proposed = ProposedRings()
    with pytest.raises(TrackingError, match="no ring is proposed"):
        proposed.pass_over()
    proposed.replace([ring(0.0), ring(0.03), ring(0.06)])
    proposed.pass_over()
    assert places(proposed.rings) == [0.03, 0.06, 0.0]
    assert [proposed.was_passed_over(one) for one in proposed.rings] == [False, False, True]
    moved = [ring(0.002), ring(0.028), ring(0.061)]  # best first, as ever
    proposed.replace(moved)
    assert places(proposed.rings) == [0.028, 0.061, 0.002]
    assert proposed.first is moved[1]
    proposed.pass_over()
    proposed.pass_over()
    assert proposed.first is moved[0]  # all have been passed over
    proposed.pass_over()
    assert proposed.first is moved[1]
    proposed.replace([])
    proposed.replace([ring(0.0), ring(0.03)])
    assert places(proposed.rings) == [0.0, 0.03]


def test_of_one_ring_there_is_no_next() -> None:
    proposed = ProposedRings()
    proposed.replace([ring(0.0)])
    with pytest.raises(TrackingError, match="no other ring is proposed"):
        proposed.pass_over()
    assert places(proposed.rings) == [0.0]


def test_a_breath_between_two_looks_does_not_make_another_ring_the_first() -> None:
    proposed = ProposedRings()
    proposed.replace([ring(0.0), ring(0.03), ring(0.06)])
    proposed.pass_over()
    # Half the way from one ring to the next: what was passed over is where none was before.
    proposed.replace([ring(0.015), ring(0.045), ring(0.075)])
    assert places(proposed.rings) == [0.045, 0.075, 0.015]


def test_the_ring_that_was_first_stays_so_while_it_is_found() -> None:
    # Somebody may be about to say yes to it.
    proposed = ProposedRings()
    proposed.replace([ring(0.0), ring(0.03)])
    proposed.replace([ring(0.031), ring(0.002)])
    assert places(proposed.rings) == [0.002, 0.031]
    proposed.replace([ring(0.035)])
    assert places(proposed.rings) == [0.035]
    proposed.replace([])
    proposed.replace([ring(0.03), ring(0.0)])
    assert places(proposed.rings) == [0.03, 0.0]


def test_a_look_has_three_pairs_the_next_those_too_and_a_pair_that_lacks_a_plane_begins_anew() -> None:
    lookout, looks = RingLookout(StreamConfig()), []
    for index in range(16):
        planes = "a" if index == 10 else "ab"
        looks.append([one.stamp_ns // PERIOD_NS for one in lookout.add(lasso_pair(index, None, planes))])
    assert [look for look in looks if look] == [[0, 1, 2], [0, 1, 2, 3, 4, 5], [3, 4, 5, 6, 7, 8], [11, 12, 13]]
    lookout.forget()
    assert [len(lookout.add(lasso_pair(index, None))) for index in range(16, 19)] == [0, 0, 3]
