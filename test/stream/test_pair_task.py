"""Which tasks must not be lost when a busy node skips pairs."""

from __future__ import annotations

import numpy as np

from lasso_motion_ros.geometry.frames import FramePair, Seed
from lasso_motion_ros.stream.pair_task import PairTask, PromisedTasks

SEED = Seed(np.zeros((6, 2)), np.zeros((6, 2)))


def task(number: int, *, seed: bool = False, new_run: bool = False, answered: bool = False) -> PairTask:
    return PairTask(FramePair(number, None, None, new_run), SEED if seed else None, answered, number=number)


def skipped(promised: PromisedTasks, number: int) -> list[int]:
    return [one.number for one in promised.take_skipped(number)]


def test_a_pair_that_comes_again_begins_no_run_again() -> None:
    assert task(1, new_run=True).begins_run
    assert not task(1, new_run=True, answered=True).begins_run
    assert not task(1).begins_run


def test_the_motion_is_followed_over_a_quarter_of_a_second_from_the_newest_pair_that_was_answered() -> None:
    at = [PairTask(FramePair(ms * 1_000_000, None, None)) for ms in (0, 250, 251, 500)]
    assert at[0].is_followed_by(at[1])
    assert not at[0].is_followed_by(at[2])
    clicked = PairTask(at[0].pair, SEED, later=(at[1].pair, at[2].pair))  # with those that came since, answered again
    assert clicked.is_followed_by(at[3])
    # Clicks on an old pair may be refused: then those since then that still wait are needed.
    assert not at[0].is_followed_by(clicked)


def test_seeds_and_new_runs_are_made_up_for_and_other_pairs_are_not() -> None:
    promised = PromisedTasks()
    promised.add([task(1), task(2, seed=True), task(3), task(4, new_run=True), task(5), task(6, seed=True)])
    assert skipped(promised, 5) == [2, 4]
    assert skipped(promised, 6) == []  # its own turn
    assert skipped(promised, 9) == []


def test_nothing_is_made_up_for_after_a_reset() -> None:
    promised = PromisedTasks()
    promised.add([task(1, seed=True)])
    promised.clear()
    assert skipped(promised, 2) == []


def test_what_was_not_reached_is_kept() -> None:
    """The tracker may fail on one of them."""
    promised = PromisedTasks()
    promised.add([task(1, seed=True), task(2, seed=True)])
    assert next(iter(promised.take_skipped(3))).number == 1
    assert skipped(promised, 3) == [2]
