"""Answers in numbers: each pair once, as it was answered last."""

from __future__ import annotations

from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.stream.answer_counts import AnswerCounts
from lasso_motion_ros.tracking.tracker import TrackerState

LOST, TRACKING, DEGRADED = TrackerState.LOST, TrackerState.TRACKING, TrackerState.DEGRADED


def pair(stamp_ns: int) -> FramePair:
    return FramePair(stamp_ns, None, None)


def test_pairs_poses_and_states() -> None:
    counts = AnswerCounts(8)
    for stamp_ns, state in enumerate((TRACKING, DEGRADED, LOST, TRACKING)):
        counts.add(pair(stamp_ns), state)
    assert (counts.pairs, counts.poses, counts.half_pairs) == (4, 3, 4)
    assert counts.states == {TRACKING: 2, DEGRADED: 1, LOST: 1}


def test_a_pair_answered_again_counts_as_it_was_last() -> None:
    counts = AnswerCounts(8)
    counts.add(pair(1), LOST)
    counts.add(pair(1), TRACKING)
    assert (counts.pairs, counts.half_pairs, counts.states) == (1, 1, {TRACKING: 1})


def test_a_stamp_of_another_run_or_of_long_ago_is_another_pair() -> None:
    counts = AnswerCounts(2)
    counts.add(pair(1), LOST)
    counts.forget()
    counts.add(pair(1), TRACKING)
    assert counts.pairs == 2
    for stamp_ns in (2, 3, 1):
        counts.add(pair(stamp_ns), TRACKING)
    assert counts.pairs == 5
