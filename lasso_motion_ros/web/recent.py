"""A mapping that keeps its newest entries only."""

from __future__ import annotations

from collections import OrderedDict
from typing import TypeVar

Key = TypeVar("Key")
Entry = TypeVar("Entry")


class Recent(OrderedDict[Key, Entry]):
    """The newest entries by key; one that is set again is the newest.

    Args:
        most: entries that are kept.
    """

    def __init__(self, most: int) -> None:
        super().__init__()
        self._most = most

    def __setitem__(self, key: Key, entry: Entry) -> None:
        super().__setitem__(key, entry)
        self.move_to_end(key)
        while len(self) > self._most:
            self.popitem(last=False)

    @property
    def newest(self) -> Key | None:
        """The key that was set last; None where there is no entry."""
        return next(reversed(self), None)
