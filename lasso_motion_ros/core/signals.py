"""Ctrl-C and SIGTERM in a command: during its imports they just end it, later it throws away what is half done."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

AGAIN_S = 0.02
"""After which a Ctrl-C that Python could not raise comes once more."""
LOOK_S = 0.2
"""Between two looks of who waits for a signal."""


def end_at_once() -> None:
    """Let Ctrl-C end the process without a word: to be called before heavy imports, which show a traceback of it.

    A SIGINT that is ignored (a job in the background) stays so.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def wait_until_set(event: threading.Event) -> None:
    """Wait in the main thread for an event that a signal sets.

    Again and again: of a signal that came while the process was stopped (Ctrl-Z, then `kill %1`) the kernel may tell
    another thread, and a wait without a limit would go on.
    """
    while not event.wait(LOOK_S):
        pass


class Terminated(KeyboardInterrupt):
    """SIGTERM, as Ctrl-C is a KeyboardInterrupt."""


@contextmanager
def interruptible() -> Iterator[None]:
    """Ctrl-C and SIGTERM raise KeyboardInterrupt and Terminated while a block runs.

    Where Python has nobody to raise it to (it was running a finaliser or a weak reference's callback, as it does within
    every import) it would print the exception and go on. The signal then comes once more, a moment later. Where it came
    within a compiled function that returned all the same, Python makes a SystemError of it: taken for what it was.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def terminate(*_: object) -> None:
        raise Terminated

    before = signal.signal(signal.SIGTERM, terminate)
    if signal.getsignal(signal.SIGINT) is signal.SIG_DFL:  # see `end_at_once`
        signal.signal(signal.SIGINT, signal.default_int_handler)
    hook = sys.unraisablehook

    def unraisable(found: sys.UnraisableHookArgs) -> None:
        if not issubclass(found.exc_type, KeyboardInterrupt):
            hook(found)
            return
        number = signal.SIGTERM if issubclass(found.exc_type, Terminated) else signal.SIGINT
        # Not from here: within this hook it could not be raised either.
        again = threading.Timer(AGAIN_S, _thread.interrupt_main, [number])
        again.daemon = True
        again.start()

    sys.unraisablehook = unraisable
    try:
        yield
    except SystemError as error:
        interrupt = _interrupt_behind(error)
        if interrupt is None:
            raise
        raise interrupt from None
    finally:
        sys.unraisablehook = hook
        signal.signal(signal.SIGTERM, before)


def _interrupt_behind(error: BaseException) -> KeyboardInterrupt | None:
    """The interrupt that an error was made of, if any."""
    cause = error.__cause__
    while cause is not None and not isinstance(cause, KeyboardInterrupt):
        cause = cause.__cause__
    return cause


class HeldSignal(threading.Event):
    """Set by SIGINT or SIGTERM.

    Attributes:
        number: of the last one.
    """

    number: int = signal.SIGINT

    def come(self, number: int) -> None:
        """Take note of one."""
        self.number = number
        self.set()

    def interrupt(self) -> KeyboardInterrupt:
        """What to raise of it."""
        return Terminated() if self.number == signal.SIGTERM else KeyboardInterrupt()


@contextmanager
def held_signals() -> Iterator[HeldSignal]:
    """SIGINT and SIGTERM as an event, to be looked at where it is safe to stop.

    A KeyboardInterrupt may come between the start of a child and the note that it exists, or while children are being
    stopped; either would leave a process behind.
    """
    interrupted = HeldSignal()
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, lambda number, _: interrupted.come(number)) for number in numbers]
    try:
        yield interrupted
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)


@contextmanager
def deferred() -> Iterator[None]:
    """SIGINT and SIGTERM come after a block instead of within.

    For libraries that call back into Python from compiled code: what is raised there is printed and lost, and what they
    were doing is left half done.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, lambda number, _: came.append(number)) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)
    if came:
        signal.raise_signal(came[0])
