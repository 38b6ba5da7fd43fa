"""Progress for people: on a terminal, of work for hours also in a log, and never when asked to be quiet."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from lasso_motion_ros.core.terminal import bar_stream

Item = TypeVar("Item")

LOGGED_EVERY_S = 60.0
"""A log of many hours stays readable."""


def progress(iterable: Iterable[Item], total: int | None, label: str, quiet: bool) -> Iterator[Item]:
    """Iterate, showing how far it is.

    Args:
        iterable: what to go through.
        total: how many items there are, if known.
        label: what is being done, a word or two.
        quiet: True shows nothing.
    """
    if quiet or not sys.stderr.isatty():
        yield from iterable
        return
    from tqdm import tqdm

    yield from tqdm(iterable, total=total, desc=label, leave=False, file=bar_stream())


@contextmanager
def busy(label: str, quiet: bool) -> Iterator[None]:
    """Say what is being done while a block runs that cannot tell how far it is; the line is taken away at its end.

    Args:
        label: what is being done, a few words.
        quiet: True shows nothing.
    """
    if quiet or not sys.stderr.isatty():
        yield
        return
    print(f"{label} …", end="", file=bar_stream(), flush=True)
    try:
        yield
    finally:
        print(f"\r{' ' * (len(label) + 2)}\r", end="", file=bar_stream(), flush=True)


@contextmanager
def counting(label: str, quiet: bool) -> Iterator[Callable[[int], None]]:
    """Show a count that grows while a block runs, and for how long it has.

    Args:
        label: what is counted, a word or two.
        quiet: True shows nothing.

    Yields:
        Takes the count so far; to be called as often as one likes.
    """
    if quiet or not sys.stderr.isatty():
        yield lambda count: None
        return
    from tqdm import tqdm

    with tqdm(desc=label, leave=False, file=bar_stream()) as bar:
        yield lambda count: _set(bar, count)


@dataclass(frozen=True)
class Tally:
    """One recording more.

    Attributes:
        pairs: its image pairs.
        failed: whether it failed.
    """

    pairs: int = 0
    failed: bool = False


@contextmanager
def tallying(label: str, total: int, quiet: bool) -> Iterator[Callable[[Tally], None]]:
    """Show how many recordings are done, at which rate, and the time left; without a terminal as a line a minute.

    Args:
        label: what is being done, a word or two.
        total: how many recordings there are.
        quiet: True shows nothing.

    Yields:
        Takes one recording more.
    """
    if quiet:
        yield lambda one: None
        return
    from tqdm import tqdm

    terminal = sys.stderr.isatty()
    begun = said = time.monotonic()
    pairs = failed = 0
    with tqdm(desc=label, total=total, unit="recording", leave=False, disable=not terminal, file=bar_stream()) as bar:
        done = 0

        def take(one: Tally) -> None:
            nonlocal pairs, failed, said, done
            done, pairs, failed = done + 1, pairs + one.pairs, failed + one.failed
            now = time.monotonic()
            rate = f"{pairs / max(now - begun, 1e-9):.0f} pairs/s" + (f", {failed} failed" if failed else "")
            bar.set_postfix_str(rate, refresh=False)
            bar.update(1)
            if not terminal and now - said >= LOGGED_EVERY_S:
                said = now
                left = (now - begun) * (total - done) / done / 60.0
                print(
                    f"{label}: {done} of {total} recordings, {rate}, {left:.0f} min left", file=sys.stderr, flush=True
                )

        yield take


def _set(bar: Any, count: int) -> None:
    bar.update(count - bar.n)
