"""Progress for people: on a terminal only, and never when asked to be quiet."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from lasso_motion_ros.core.terminal import bar_stream

Item = TypeVar("Item")


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


def _set(bar: Any, count: int) -> None:
    bar.update(count - bar.n)
