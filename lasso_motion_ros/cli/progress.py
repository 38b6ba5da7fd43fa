"""A progress bar for people: on a terminal only, and never when asked to be quiet."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from typing import TypeVar

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

    yield from tqdm(iterable, total=total, desc=label, leave=False, file=sys.stderr)
