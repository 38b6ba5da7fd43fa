"""One function over many items, by processes of this machine or a Dask cluster; one that dies costs no other item.

Items and answers are all that is sent, so both should be small: paths and rows, no images.
"""

from __future__ import annotations

import os
import re
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from dataclasses import dataclass
from multiprocessing import active_children, get_context, parent_process, resource_tracker
from multiprocessing.process import BaseProcess
from typing import Any, Protocol, TypeVar

from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.one_thread import one_thread

Item = TypeVar("Item")
Answer = TypeVar("Answer")

_ADDRESS = r"(tcp|tls|ws|wss|ucx)://.+|[^/]+:\d+"
ATTEMPTS = 2
"""How often an item may cost its process its life: once may be somebody else's doing, a signal or another's memory."""


@dataclass(frozen=True)
class Lost:
    """What there is instead of an answer.

    Attributes:
        reason: what became of the process, in words.
    """

    reason: str


Answers = Generator[tuple[int, Answer | Lost], None, None]
"""Items' numbers and answers, as they come."""


class Pool(Protocol):
    """Where the work is done."""

    def run(self, function: Callable[[Item], Answer], items: Sequence[Item]) -> Answers[Answer]:
        """Apply a function to each item, on one thread each; whoever stops early ends what is still at work.

        Args:
            function: of a module, so that it can be named to another process.
            items: what it is given.

        Yields:
            An item's number and its answer, as they come.
        """
        ...


class ThisProcess:
    """This process, one item after the other."""

    def run(self, function: Callable[[Item], Answer], items: Sequence[Item]) -> Answers[Answer]:
        """As `Pool.run`; what the function raises is raised."""
        for number, item in enumerate(items):
            yield number, _alone(function, item)


class LocalPool:
    """Processes on this machine, each a pool of the standard library's with one worker.

    In a common pool the death of one worker takes all answers that are under way, and does not say whose fault it was.

    Args:
        workers: how many at a time, at least 1.
    """

    def __init__(self, workers: int) -> None:
        self._workers = workers

    def run(self, function: Callable[[Item], Answer], items: Sequence[Item]) -> Answers[Answer]:
        """As `Pool.run`; what the function raises is raised."""
        waiting = deque(enumerate(items))
        deaths = [0] * len(items)
        idle = [_Worker() for _ in range(min(self._workers, len(items)))]
        busy: dict[Future[Answer], tuple[_Worker, int]] = {}
        try:
            while waiting or busy:
                while waiting and idle:
                    worker, (number, item) = idle.pop(), waiting.popleft()
                    busy[worker.submit(function, item)] = worker, number
                for future in wait(busy, return_when=FIRST_COMPLETED).done:
                    worker, number = busy.pop(future)
                    try:
                        answer: Answer | Lost = future.result()
                    except BrokenProcessPool:
                        how = worker.end()
                        deaths[number] += 1
                        if deaths[number] < ATTEMPTS:
                            waiting.append((number, items[number]))
                            idle.append(_Worker())
                            continue
                        answer = Lost(f"its process was lost {ATTEMPTS} times: {how}")
                        worker = _Worker()
                    idle.append(worker)
                    yield number, answer
        finally:
            for worker, _ in busy.values():
                worker.kill()
            for worker in (*idle, *(worker for worker, _ in busy.values())):
                worker.end()


def processors(workers: int | None = None) -> Pool:
    """A pool on this machine.

    Args:
        workers: how many processes at a time; None: one a processor; 1: this one.
    """
    workers = workers or os.cpu_count() or 1
    return ThisProcess() if workers == 1 else LocalPool(workers)


class DaskCluster:
    """A Dask cluster that is running; which worker does what, and what becomes of a dead one's work, is Dask's affair.

    Args:
        address: of its scheduler, `tcp://host:8786`.
        say: takes a line for the user.

    Raises:
        LassoMotionError: dask.distributed is not installed, or no scheduler answers there.
    """

    def __init__(self, address: str, say: Callable[[str], None]) -> None:
        try:
            import distributed
        except ImportError as error:
            raise LassoMotionError(
                "--scheduler needs dask.distributed: pip install 'lasso_motion_ros[cluster]'"
            ) from error
        if re.fullmatch(_ADDRESS, address) is None:
            raise LassoMotionError(f"--scheduler: expected an address such as tcp://host:8786, found {address!r}")
        self._distributed: Any = distributed
        self._address = address
        self._say = say
        try:
            self._client: Any = distributed.Client(address, set_as_default=False)
        except (OSError, ValueError) as error:
            raise LassoMotionError(f"--scheduler {address}: no Dask scheduler answers there: {error}") from error

    def run(self, function: Callable[[Item], Answer], items: Sequence[Item]) -> Answers[Answer]:
        """As `Pool.run`, once; what cannot be done, because the workers lack something, is lost with that reason."""
        with self._client as client:
            if not client.scheduler_info()["workers"]:
                self._say(f"{self._address} has no workers yet: waiting for some")
            numbers = {client.submit(_alone, function, item, pure=False): n for n, item in enumerate(items)}
            try:
                for future in self._distributed.as_completed(list(numbers), loop=client.loop):
                    failure = future.exception()
                    yield numbers.pop(future), future.result() if failure is None else Lost(_reason(failure))
            finally:
                client.cancel(list(numbers))


def in_order(answers: Answers[Answer]) -> Iterator[Answer]:
    """Answers in the order of their items.

    Raises:
        LassoMotionError: one is lost.
    """
    early: dict[int, Answer] = {}
    due = 0
    with closing(answers):
        for number, answer in answers:
            if isinstance(answer, Lost):
                raise LassoMotionError(f"number {number} could not be done: {answer.reason}")
            early[number] = answer
            while due in early:
                yield early.pop(due)
                due += 1


class _Worker:
    """A pool of one process, which starts with its first item."""

    def __init__(self) -> None:
        self._pool: ProcessPoolExecutor | None = None
        self._process: BaseProcess | None = None

    def submit(self, function: Callable[[Item], Answer], item: Item) -> Future[Answer]:
        if self._pool is not None:
            return self._pool.submit(_alone, function, item)
        before = set(active_children())
        with _ctrl_c_for_the_parent_only():
            # A fork would copy OpenCV's threads in whatever state they are.
            self._pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=_end_with_the_parent)
            future = self._pool.submit(_alone, function, item)
        self._process = next(iter(set(active_children()) - before), None)
        return future

    def kill(self) -> None:
        """Ask the process to end, whatever it is at."""
        if self._process is not None:
            self._process.terminate()

    def end(self) -> str:
        """Wait until the process has ended; returns how it did."""
        if self._pool is None:
            return ""
        self._pool.shutdown(cancel_futures=True)
        code = None if self._process is None else self._process.exitcode
        if code is not None and code < 0:
            memory = " (is there memory enough?)" if code == -signal.SIGKILL else ""
            return f"{signal.Signals(-code).name}{memory}"
        return f"exit status {code}"


def _alone(function: Callable[[Item], Answer], item: Item) -> Answer:
    with one_thread():
        return function(item)


def _reason(error: BaseException) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


@contextmanager
def _ctrl_c_for_the_parent_only() -> Iterator[None]:
    """Processes that are started meanwhile do not get the terminal's Ctrl-C; here it waits for the block's end."""
    resource_tracker.ensure_running()  # which would lift the mask again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_with_the_parent() -> None:
    """A worker waits for its next item for ever, also from a parent that was killed."""

    def watch() -> None:
        parent = parent_process()
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
