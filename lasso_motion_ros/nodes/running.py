"""What every node's process does: start, spin, stop cleanly on a signal, and stay up on a bad message."""

from __future__ import annotations

import contextlib
import functools
import os
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.signals import wait_until_set
from lasso_motion_ros.nodes.ros_start import require_ros, ros_problem, start_ros

THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

EXIT_DONE = 0
EXIT_BAD_INPUT = 2

Callback = TypeVar("Callback", bound=Callable[..., Any])


@dataclass(frozen=True)
class _Tuning:
    """How a process logs and shares its time.

    Attributes:
        log_period_s: least time between two complaints of a kind.
        kind_length: letters of a complaint that tell its kind.
        error_pause_s: after an error of the executor itself: one that recurs at once must not take the processor.
        spin_s: the longest wait for the next callback, after which it is looked whether to stop. Waking the executor
            does not end its wait while no timer is due.
        switch_interval_s: how long one Python thread may keep another waiting. Whoever has taken in an image goes on
            to wait for the next one, which takes a millisecond, while the tracker waits to begin.
    """

    log_period_s: float = 5.0
    kind_length: int = 40
    error_pause_s: float = 0.005
    spin_s: float = 0.2
    switch_interval_s: float = 0.0002


_TUNING = _Tuning()


class ThrottledLog:
    """Logs at most one complaint of a kind in a few seconds, and says with the next how many were held back.

    Args:
        logger: the node's logger.
    """

    def __init__(self, logger: Any) -> None:
        self._logger = logger
        self._last: dict[str, float] = {}
        self._held_back: Counter[str] = Counter()

    def complain(self, subject: str, text: str, *, kind: str = "", period_s: float = _TUNING.log_period_s) -> None:
        """Complain about a subject (a topic, a kind of error); the subjects must be few.

        Args:
            subject: what is complained about.
            text: the complaint.
            kind: tells complaints of one subject apart that do not hold each other back.
            period_s: the least time between two of them.
        """
        if line := self._due(subject, text, kind, period_s):
            self._logger.warning(line)

    def inform(self, subject: str, text: str, *, kind: str = "") -> None:
        """Say what is no complaint, as seldom; the arguments as those of `complain`."""
        if line := self._due(subject, text, kind, _TUNING.log_period_s):
            self._logger.info(line)

    def _due(self, subject: str, text: str, kind: str, period_s: float) -> str:
        """The line to log; empty while it is held back."""
        now = time.monotonic()
        key = f"{subject} {kind}"
        if now - self._last.get(key, now - period_s) < period_s:
            self._held_back[key] += 1
            return ""
        self._last[key] = now
        more = self._held_back.pop(key, 0)
        return f"{subject}: {text}" + (f" (and {more} more)" if more else "")

    def error(self, error: Exception) -> None:
        """Complain about an exception."""
        if isinstance(error, LassoMotionError):
            self.complain("input", str(error))
        else:
            self.complain(type(error).__name__, str(error))


def kind_of(text: str) -> str:
    """What tells one complaint from another although its numbers change: its first letters."""
    return "".join(letter for letter in text if not letter.isdigit())[: _TUNING.kind_length]


class RunnableNode(Protocol):
    """An rclpy node that can be closed before it is destroyed."""

    complaints: ThrottledLog

    def start(self) -> None:
        """Begin work; called before the first callback."""

    def close(self) -> None:
        """End threads and say goodbye on the topics, while the node can still publish."""

    def destroy_node(self) -> None:
        """As rclpy's."""

    def get_logger(self) -> Any:
        """As rclpy's."""


def guarded(method: Callback) -> Callback:
    """A callback whose exceptions are logged, throttled, instead of ending the node."""

    @functools.wraps(method)
    def call(self: RunnableNode, *arguments: Any) -> Any:
        try:
            return method(self, *arguments)
        except Exception as error:  # whatever a message provokes, the node stays up
            self.complaints.error(error)
            return None

    return call  # type: ignore[return-value]


def bound_threads() -> None:
    """Give OpenCV and linear algebra one thread each, and keep freed memory from pair to pair.

    Images this small gain nothing from more threads, and latency suffers. To be called before NumPy is imported; what
    the user has set stays in force.
    """
    for name in THREAD_VARIABLES:
        os.environ.setdefault(name, "1")
    import cv2

    from lasso_motion_ros.core.memory import keep_freed_memory

    cv2.setNumThreads(1)
    keep_freed_memory()
    sys.setswitchinterval(_TUNING.switch_interval_s)


class _StopSignal:
    """SIGINT and SIGTERM, from now on: whoever waits is woken, and work that has not been started for good is given up.

    A launch file asks once, and kills what has not ended 15 s later; on a busy machine a start takes longer.

    Attributes:
        stopped: set by the first signal.
    """

    def __init__(self) -> None:
        self.stopped = threading.Event()
        self._interrupts = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._on_signal)

    def _on_signal(self, *_: object) -> None:
        self.stopped.set()
        if self._interrupts:
            self._interrupts = False
            raise KeyboardInterrupt

    @contextlib.contextmanager
    def at_once(self) -> Iterator[None]:
        """A block that a signal ends, also one that has come before.

        An error of a block that is given up is no error: compiled code may have made one of the interrupt.

        Raises:
            KeyboardInterrupt: there was a signal.
        """
        self._interrupts = True
        try:
            if self.stopped.is_set():
                raise KeyboardInterrupt
            yield
        except Exception:
            if self.stopped.is_set():
                raise KeyboardInterrupt from None
            raise
        finally:
            self._interrupts = False


def run_node(make_node: Callable[[], RunnableNode], arguments: list[str] | None = None) -> int:
    """Run a node until SIGINT or SIGTERM.

    The executor has a thread of its own: the main thread takes the signal at once, and the node can still publish its
    last state. rclpy's own handlers would have shut the context down by then.

    Args:
        make_node: makes the node, once rclpy is up.
        arguments: the process's arguments, ROS arguments included; None takes `sys.argv`.

    Returns:
        Exit status: 0 stopped by a signal, 1 failed, 2 bad parameters.
    """
    stop = _StopSignal()  # before the imports, which take seconds
    try:
        with stop.at_once():
            require_ros()
            bound_threads()
        warning = start_ros(arguments)
    except KeyboardInterrupt:
        return EXIT_DONE
    except LassoMotionError as error:
        print(error, file=sys.stderr)  # noqa: T201 - there is no logger without ROS
        return EXIT_BAD_INPUT
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.logging import get_logger

    try:
        try:
            node = make_node()
        except Exception as error:
            words = str(error) if isinstance(error, LassoMotionError) else ros_problem(error)
            if words is None:
                raise
            get_logger("lasso_motion_ros").fatal(words)
            return EXIT_BAD_INPUT
        if warning:
            node.get_logger().warning(warning)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        spinning = threading.Thread(target=_spin, args=(executor, node, stop.stopped), name="executor", daemon=True)
        try:
            with stop.at_once():
                node.start()
            spinning.start()
            wait_until_set(stop.stopped)
            return EXIT_DONE
        except KeyboardInterrupt:
            return EXIT_DONE
        except LassoMotionError as error:
            node.get_logger().fatal(str(error))
            return EXIT_BAD_INPUT
        finally:
            stop.stopped.set()
            executor.wake()
            if spinning.ident is not None:
                spinning.join()
            node.close()
            executor.shutdown()
            node.destroy_node()
    finally:
        rclpy.try_shutdown()
        # One more (launch's, behind that of the terminal) would make a failure of this end: Python's own has handlers
        # no more. SIGTERM still ends it.
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def _spin(executor: Any, node: RunnableNode, stopped: threading.Event) -> None:
    from rclpy.executors import ExternalShutdownException, ShutdownException

    while not stopped.is_set():
        try:
            executor.spin_once(timeout_sec=_TUNING.spin_s)
        except (ExternalShutdownException, ShutdownException):
            stopped.set()
        except Exception as error:
            node.complaints.error(error)
            stopped.wait(_TUNING.error_pause_s)
