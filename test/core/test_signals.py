"""Ctrl-C in a command is never lost, also where Python itself would print it and go on."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator

import pytest

from lasso_motion_ros.core.signals import Terminated, deferred, held_signals, interruptible

PATIENCE_S = 20.0


class Interrupted:
    """An object in whose finaliser a signal comes: Python has nobody to raise the interrupt to."""

    def __init__(self, number: signal.Signals) -> None:
        self.number = number

    def __del__(self) -> None:
        signal.raise_signal(self.number)


def work_through_a_signal(number: signal.Signals) -> None:
    """Goes on for long, as a command does that has not noticed."""
    Interrupted(number)
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        time.sleep(0.01)


@pytest.fixture(autouse=True)
def handlers_of_a_fresh_process() -> Iterator[None]:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize(("number", "kind"), [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, Terminated)])
def test_a_signal_within_a_finaliser_comes_once_more(
    number: signal.Signals, kind: type[KeyboardInterrupt], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(kind) as raised, interruptible():
        work_through_a_signal(number)
    assert raised.type is kind
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(("number", "kind"), [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, Terminated)])
def test_a_signal_within_compiled_code_is_what_it_was(number: signal.Signals, kind: type[KeyboardInterrupt]) -> None:
    """A compiled function that returns a result though a signal was raised within it: Python makes its error."""

    def compiled() -> None:
        try:
            signal.raise_signal(number)
        except KeyboardInterrupt as interrupt:
            raise SystemError("CPUDispatcher(…) returned a result with an exception set") from interrupt

    with pytest.raises(KeyboardInterrupt) as raised, interruptible():
        compiled()
    assert raised.type is kind
    with pytest.raises(SystemError, match="another"), interruptible():
        raise SystemError("another")


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_what_is_no_signal_is_reported_as_ever() -> None:
    class Broken:
        def __del__(self) -> None:
            raise ValueError("broken")

    with interruptible():
        Broken()
        time.sleep(0.1)  # nothing comes


@pytest.mark.parametrize(("number", "raised"), [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, Terminated)])
def test_a_deferred_signal_comes_after_the_block(number: signal.Signals, raised: type[BaseException]) -> None:
    done = []

    def work() -> None:
        with deferred():
            signal.raise_signal(number)
            done.append("whole")
        done.append("the signal was lost")

    with interruptible():
        before = signal.getsignal(number)
        with pytest.raises(raised):
            work()
        assert signal.getsignal(number) is before
    assert done == ["whole"]


def test_what_a_deferred_block_raises_is_raised() -> None:
    with pytest.raises(ValueError, match="its own"), deferred():
        raise ValueError("its own")


@pytest.mark.parametrize(("number", "kind"), [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, Terminated)])
def test_a_held_signal_says_later_which_it_was(number: signal.Signals, kind: type[KeyboardInterrupt]) -> None:
    """So that the exit status says it."""
    with held_signals() as held:
        assert not held.is_set()
        signal.raise_signal(number)
        assert held.is_set()
        assert type(held.interrupt()) is kind
