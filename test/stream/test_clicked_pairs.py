"""Clicks that wait while the stamps may be about to start anew."""

from __future__ import annotations

import numpy as np
import pytest
from support.message_inputs import projection, stamp

from lasso_motion_ros.geometry.frames import Frame, FramePair
from lasso_motion_ros.stream.clicked_pairs import ClickedPairs
from lasso_motion_ros.stream.pair_task import PairTask

POINTS = np.zeros((6, 2))


def pair(index: int, new_run: bool = False) -> FramePair:
    a, b = (Frame(stamp(index), np.zeros((32, 32), np.uint8), projection(plane)) for plane in ("a", "b"))
    return FramePair(stamp(index), a, b, new_run)


def clicked(count: int, on: int) -> ClickedPairs:
    """Pairs 0 … count - 1, and held clicks in both planes on one of them."""
    made = ClickedPairs(8)
    for index in range(count):
        made.add_pair(pair(index))
    for plane in ("a", "b"):
        assert made.add_clicks(plane, stamp(on), POINTS, hold=True) is None
    return made


def stamps(ready: PairTask) -> list[int]:
    return [ready.pair.stamp_ns, *(later.stamp_ns for later in ready.later)]


def test_held_clicks_on_an_earlier_pair_are_used_with_the_next() -> None:
    earlier, newest = clicked(4, on=1).add_pair(pair(4))
    assert stamps(earlier) == [stamp(1), stamp(2), stamp(3)]
    assert earlier.seed is not None
    assert earlier.answered
    assert (stamps(newest), newest.seed, newest.answered) == ([stamp(4)], None, False)
    assert newest.number == earlier.number + 1


def test_they_are_not_judged_while_a_restart_is_suspected() -> None:
    made = clicked(4, on=-30)  # of the run that may begin
    (waiting,) = made.add_pair(pair(4), hold=True)
    assert waiting.seed is None
    assert made.take_complaints() == []
    (first,) = made.add_pair(pair(-30, new_run=True))
    assert first.begins_run
    assert first.seed is not None


def test_they_are_refused_where_no_run_began_and_they_fit_no_pair() -> None:
    made = clicked(4, on=-30)
    (newest,) = made.add_pair(pair(4))
    assert newest.seed is None
    assert "is not among the last 8 pairs" in made.take_complaints()[0][1]


@pytest.mark.parametrize("on", [15, 1], ids=["on a pair of the old run, too", "on none of them any more"])
def test_clicks_that_overtake_the_first_pair_of_a_run_are_on_it(on: int) -> None:
    made = ClickedPairs(8)
    for index in range(20):
        made.add_pair(pair(index))
    for plane in ("a", "b"):
        made.add_clicks(plane, stamp(on), POINTS)
    (first,) = made.add_pair(pair(on, new_run=True))
    assert first.begins_run
    assert first.seed is not None


def test_of_clicks_in_one_plane_that_overtake_its_image_nothing_is_lost() -> None:
    made = ClickedPairs(8)
    for index in range(20):
        made.add_pair(pair(index))
    made.add_clicks("a", stamp(15), POINTS)
    made.add_clicks("b", stamp(15), POINTS, hold=True)  # plane A's image has come in between
    assert made.add_pair(pair(15, new_run=True))[0].seed is not None


def test_clicks_on_another_pair_or_before_the_last_one_are_not_the_new_runs() -> None:
    made = ClickedPairs(8)
    for index in range(20):
        made.add_pair(pair(index))
    for plane in ("a", "b"):
        made.add_clicks(plane, stamp(16), POINTS)
    assert made.add_pair(pair(15, new_run=True))[0].seed is None
    assert made.add_pair(pair(16))[0].seed is None
    for plane in ("a", "b"):
        made.add_clicks(plane, stamp(15), POINTS)
    made.add_pair(pair(17))
    assert made.add_pair(pair(15, new_run=True))[0].seed is None


def test_a_reset_forgets_clicks_that_came_since_the_last_pair() -> None:
    made = ClickedPairs(8)
    for plane in ("a", "b"):
        made.add_clicks(plane, stamp(0), POINTS)
    made.clear()
    assert made.add_pair(pair(0, new_run=True))[0].seed is None
