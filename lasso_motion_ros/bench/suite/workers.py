"""Work on many things by several processes; the results come in the things' order."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import TypeVar

Thing = TypeVar("Thing")
Result = TypeVar("Result")


def in_turn(work: Callable[[Thing], Result], things: Sequence[Thing], workers: int | None) -> Iterator[Result]:
    """The results in the order of the things.

    Args:
        work: what is done with each; it can be pickled, as the things and the results can.
        things: on which.
        workers: processes at a time; None: one a processor; 1: this one.
    """
    workers = workers or os.cpu_count() or 1
    if workers == 1:
        yield from map(work, things)
        return
    # A fork would copy OpenCV's threads in whatever state they are.
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        waiting = [pool.submit(work, thing) for thing in things]
        try:
            yield from (future.result() for future in waiting)
        finally:
            # After an error or Ctrl-C nobody waits for those that have not begun.
            pool.shutdown(wait=True, cancel_futures=True)
