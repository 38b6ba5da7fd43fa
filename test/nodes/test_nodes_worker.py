"""The worker drops what is stale, keeps what fits, and survives its work."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest

from lasso_motion_ros.nodes.worker import Worker


class Gate:
    """Work that waits until it is let on, so that a test decides what has come in meanwhile."""

    def __init__(self) -> None:
        self.begun = threading.Semaphore(0)
        self.released = threading.Semaphore(0)
        self.done: list[int] = []
        self.rested = threading.Event()

    def rest(self) -> bool:
        """What a worker does while it is idle: nothing."""
        self.rested.set()
        return False

    def __call__(self, item: int) -> None:
        self.begun.release()
        assert self.released.acquire(timeout=10)
        self.done.append(item)
        if item < 0:
            raise ValueError(item)

    def let(self, count: int) -> None:
        for _ in range(count):
            self.released.release()


def make(gate: Gate, on_error: Callable[[Exception], None] = lambda error: None) -> Worker[int]:
    """Three may wait; five, while an item of 100 or more is in work."""
    return Worker(
        gate, capacity=3, burst_capacity=5, takes_long=lambda item: item >= 100, on_error=on_error, name="test"
    )


def make_of(
    gate: Gate, capacity: int = 9, takes_long: Callable[[int], bool] = lambda _: False, **options: Any
) -> Worker[int]:
    """As many may wait whatever is in work."""
    return Worker(
        gate,
        capacity=capacity,
        burst_capacity=capacity,
        takes_long=takes_long,
        on_error=lambda _: None,
        name="test",
        **options,
    )


def test_everything_that_fits_is_worked_on_in_order() -> None:
    gate = Gate()
    worker = make(gate)
    worker.put([0])
    assert gate.begun.acquire(timeout=10)
    for item in (1, 2, 3):
        worker.put([item])
    gate.let(4)
    for _ in range(3):
        assert gate.begun.acquire(timeout=10)
    worker.stop()
    assert gate.done == [0, 1, 2, 3]
    assert worker.dropped == 0


def test_when_full_only_the_newest_is_kept() -> None:
    gate = Gate()
    worker = make(gate)
    worker.put([0])
    assert gate.begun.acquire(timeout=10)
    for item in (1, 2, 3, 4):
        worker.put([item])
    gate.let(2)
    assert gate.begun.acquire(timeout=10)
    worker.stop()
    assert gate.done == [0, 4]
    assert worker.dropped == 3


def test_while_one_takes_long_more_may_wait_until_all_is_done() -> None:
    gate = Gate()
    worker = make(gate)
    worker.put([100])
    assert gate.begun.acquire(timeout=10)
    worker.put([1, 2, 3])
    worker.put([4, 5])
    gate.let(6)
    for _ in range(5):
        assert gate.begun.acquire(timeout=10)
    worker.put([6])
    gate.let(1)
    assert gate.begun.acquire(timeout=10)
    worker.put([7, 8, 9])
    worker.put([10])
    gate.let(2)
    assert gate.begun.acquire(timeout=10)
    worker.stop()
    assert gate.done == [100, 1, 2, 3, 4, 5, 6, 10]
    assert worker.dropped == 3


@pytest.mark.parametrize(
    ("step", "expected"),
    [
        (9, [0, 4, 100, 102]),  # what takes long is not left out
        (2, [0, 2, 4, 100, 102]),  # no further at once than it may go
        (0, [0, 100, 102]),  # too far in any case: all the way
    ],
)
def test_one_that_has_had_no_rest_goes_on_with_the_newest_that_it_may(step: int, expected: list[int]) -> None:
    gate = Gate()
    worker = make_of(
        gate,
        takes_long=lambda item: item == 100,
        behind_s=0.0,
        may_skip=lambda last, other: other - last <= step,
    )
    worker.put([0])
    assert gate.begun.acquire(timeout=10)
    worker.put([1, 2, 3, 4, 100, 101, 102])
    for _ in expected[1:]:
        gate.let(1)
        assert gate.begun.acquire(timeout=10)
    gate.let(1)
    worker.stop()
    assert gate.done == expected
    assert worker.dropped == 8 - len(expected)


@pytest.mark.parametrize(
    ("step", "expected"),
    [
        (10, [0, 20, 21, 25]),  # the newest whole one, then what has come since
        (0, [0, 20, 21, 25]),  # all too far away
    ],
)
def test_one_that_tells_less_does_not_take_the_turn_of_one_that_tells_all(step: int, expected: list[int]) -> None:
    """Odd ones lack a plane: where they are the newest each time, the tracker would never see both planes."""
    gate, left_out = Gate(), []
    worker = make_of(
        gate,
        behind_s=0.0,
        may_skip=lambda last, other: other - last <= 2 * step,
        is_whole=lambda item: item % 2 == 0,
        left_out=lambda items: left_out.append(list(items)),
    )
    worker.put([0])
    assert gate.begun.acquire(timeout=10)
    worker.put([16, 18, 20, 21])
    gate.let(1)
    assert gate.begun.acquire(timeout=10)
    gate.let(1)
    assert gate.begun.acquire(timeout=10)
    worker.put([23, 25])  # none is whole: the newest
    gate.let(1)
    assert gate.begun.acquire(timeout=10)
    gate.let(1)
    worker.stop()
    assert gate.done == expected
    assert left_out == [[16, 18], [23]]
    assert worker.dropped == 3


def test_those_dropped_from_a_full_queue_are_told_before_the_next_is_worked_on() -> None:
    gate, told = Gate(), []
    worker = make_of(
        gate,
        capacity=2,
        left_out=lambda items: told.append((list(items), list(gate.done))),
    )
    worker.put([0])
    assert gate.begun.acquire(timeout=10)
    for item in (1, 2, 3):
        worker.put([item])
    gate.let(1)
    assert gate.begun.acquire(timeout=10)
    gate.let(1)
    worker.stop()
    assert (told, gate.done) == ([([1, 2], [0])], [0, 3])


def test_one_that_was_idle_meanwhile_leaves_nothing_out() -> None:
    gate, now_s = Gate(), 0.0
    worker = make_of(
        gate,
        idle=gate.rest,
        behind_s=2.0,
        clock=lambda: now_s,
    )
    for items in ([0, 1, 2], [3, 4]):
        gate.rested.clear()
        worker.put(items)
        gate.let(len(items))
        assert gate.rested.wait(10)
        now_s += 10.0
    worker.put([5])
    for _ in range(6):
        assert gate.begun.acquire(timeout=10)
    now_s += 2.5  # without a rest
    worker.put([6, 7])
    gate.let(2)
    assert gate.begun.acquire(timeout=10)
    worker.stop()
    assert gate.done == [0, 1, 2, 3, 4, 5, 7]


@pytest.mark.parametrize(
    ("waited_s", "expected"),
    [
        (0.4, [100, 1, 2, 3, 4, 5]),  # in their order
        (0.6, [100, 2, 4, 5]),  # the newest that may be the next, until there is a rest
    ],
)
def test_what_has_waited_for_long_behind_a_long_one_gives_way_to_the_newest(
    waited_s: float, expected: list[int]
) -> None:
    gate, now_s = Gate(), 0.0
    worker = make_of(
        gate,
        takes_long=lambda item: item == 100,
        idle=gate.rest,
        behind_s=1000.0,
        late_s=0.5,
        may_skip=lambda last, other: other - last % 100 <= 2,
        clock=lambda: now_s,
    )
    worker.put([100])
    assert gate.begun.acquire(timeout=10)
    worker.put([1, 2, 3, 4, 5])
    now_s += waited_s
    gate.rested.clear()
    gate.let(len(expected))
    for _ in expected[1:]:
        assert gate.begun.acquire(timeout=10)
    assert gate.rested.wait(10)
    assert gate.done == expected
    worker.put([10, 11, 12])  # after its rest, and behind nothing that takes long
    now_s += 0.6
    gate.let(3)
    for _ in range(3):
        assert gate.begun.acquire(timeout=10)
    worker.stop()
    assert gate.done == [*expected, 10, 11, 12]


def test_clear_forgets_without_counting() -> None:
    gate = Gate()
    worker = make(gate)
    worker.put([0])
    assert gate.begun.acquire(timeout=10)
    worker.put([1, 2])
    worker.clear()
    gate.let(1)
    worker.stop()
    assert gate.done == [0]
    assert worker.dropped == 0


def test_work_that_fails_is_reported_and_the_next_is_done() -> None:
    gate, errors = Gate(), []
    worker = make(gate, errors.append)
    worker.put([-1])
    worker.put([5])
    gate.let(2)
    for _ in range(2):
        assert gate.begun.acquire(timeout=10)
    worker.stop()
    assert gate.done == [-1, 5]
    assert [str(error) for error in errors] == ["-1"]


def test_stop_ends_the_item_in_work_and_forgets_the_rest() -> None:
    gate = Gate()
    worker = make(gate)
    worker.put([1])
    assert gate.begun.acquire(timeout=10)
    worker.put([2])
    stopping = threading.Thread(target=worker.stop)
    stopping.start()
    tick = threading.Event()
    while not worker.is_stopping:  # else the first could end, and the second begin, before
        assert not tick.wait(0.001)
    gate.let(1)
    stopping.join(10)
    assert not stopping.is_alive()
    assert gate.done == [1]


def test_idle_work_is_done_in_steps_and_stands_back_for_an_item() -> None:
    gate, steps = Gate(), 0
    idle = threading.Event()

    def step() -> bool:
        nonlocal steps
        steps += 1
        if steps == 2:
            worker.put([1])
        if steps == 4:
            idle.set()
            raise ValueError("in the last step")
        return True

    errors: list[Exception] = []
    worker: Worker[int] = Worker(
        gate,
        capacity=3,
        burst_capacity=5,
        takes_long=lambda _: False,
        on_error=errors.append,
        name="test",
        idle=step,
    )
    assert steps == 0  # nothing has been worked on that could leave something
    worker.put([0])
    assert gate.begun.acquire(timeout=10)
    gate.let(1)
    assert gate.begun.acquire(timeout=10)
    assert steps == 2
    gate.let(1)
    assert idle.wait(10)
    worker.stop()
    assert (gate.done, [str(error) for error in errors]) == ([0, 1], ["in the last step"])


def stood_back(worker: Worker[int], rest_s: float) -> threading.Event:
    """Set once somebody who stands back for the worker goes on."""
    gone_on = threading.Event()

    def stand_back() -> None:
        worker.stand_back(patience_s=20.0, rest_s=rest_s)
        gone_on.set()

    threading.Thread(target=stand_back, daemon=True).start()
    return gone_on


def test_who_stands_back_goes_on_once_all_is_worked_on() -> None:
    gate = Gate()
    worker = make(gate)
    worker.put([0, 1])
    gone_on = stood_back(worker, rest_s=0.0)
    gate.let(1)
    for _ in range(2):
        assert gate.begun.acquire(timeout=10)
    assert gate.done == [0]
    assert not gone_on.is_set()
    gate.let(1)
    assert gone_on.wait(10)
    assert gate.done == [0, 1]
    worker.stop()
    worker.stand_back(patience_s=20.0, rest_s=0.0)  # of one that has ended: at once


def test_nobody_stands_back_for_long_or_for_one_that_hardly_keeps_up() -> None:
    gate, now = Gate(), [0.0]
    worker = Worker(
        gate,
        capacity=3,
        burst_capacity=5,
        takes_long=lambda _: False,
        on_error=lambda _: None,
        name="test",
        clock=lambda: now[0],
    )
    gate.let(1)
    worker.put([0])
    worker.stand_back(patience_s=20.0, rest_s=0.0)
    now[0] = 0.005
    worker.put([1])  # after a rest of 5 ms
    assert not stood_back(worker, rest_s=0.004).wait(0.05)
    assert stood_back(worker, rest_s=0.006).wait(10)
    worker.put([2])  # it had none
    assert stood_back(worker, rest_s=0.001).wait(10)
    worker.stand_back(patience_s=0.01, rest_s=0.0)
    assert gate.done == [0]
    gate.let(2)
    worker.stop()


def test_one_that_rests_is_roused_once_and_what_waits_comes_first() -> None:
    gate, rests = Gate(), threading.Semaphore(0)

    def rest() -> bool:
        rests.release()
        return False

    worker = make_of(gate, idle=rest)
    for _ in range(2):
        worker.rouse()
        assert rests.acquire(timeout=10)
    assert not rests.acquire(timeout=0.05)
    worker.put([0])
    assert gate.begun.acquire(timeout=10)
    worker.rouse()
    worker.put([1])
    gate.let(1)
    assert gate.begun.acquire(timeout=10)
    assert not rests.acquire(timeout=0.05)
    gate.let(1)
    assert rests.acquire(timeout=10)
    worker.stop()
    assert gate.done == [0, 1]
