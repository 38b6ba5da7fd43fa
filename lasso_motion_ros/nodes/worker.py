"""One thread that works through items, and would rather lose old ones than fall behind."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

Item = TypeVar("Item")


class Worker(Generic[Item]):
    """A worker thread behind a bounded queue; the newest wins.

    When the queue is full everything in it is dropped but the item that comes in: under lasting overload what waits is
    stale, and its age must not grow. In a short spell of work, such as building the model, all that waits is kept.

    Args:
        work: called in the worker's thread with each item. What it raises goes to `on_error`; the thread lives on.
        capacity: items that may wait.
        on_error: called in the worker's thread with what `work` raised.
        name: of the thread.
    """

    def __init__(
        self, work: Callable[[Item], None], capacity: int, on_error: Callable[[Exception], None], name: str
    ) -> None:
        self._work = work
        self._on_error = on_error
        self._capacity = capacity
        self._waiting: deque[Item] = deque()
        self._changed = threading.Condition()
        self._stopping = False
        self._dropped = 0
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    @property
    def dropped(self) -> int:
        """How many items were never worked on."""
        return self._dropped

    def put(self, item: Item) -> None:
        """Queue an item; never blocks."""
        with self._changed:
            if len(self._waiting) >= self._capacity:
                self._dropped += len(self._waiting)
                self._waiting.clear()
            self._waiting.append(item)
            self._changed.notify()

    def stop(self) -> None:
        """Let the item in work end, forget those that wait, and end the thread."""
        with self._changed:
            self._stopping = True
            self._waiting.clear()
            self._changed.notify()
        if self._thread is not threading.current_thread():
            self._thread.join()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._stopping)
                if self._stopping:
                    return
                item = self._waiting.popleft()
            try:
                self._work(item)
            except Exception as error:
                self._on_error(error)
