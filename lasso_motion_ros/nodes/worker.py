"""One thread that works through items, and drops old ones rather than fall behind."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

Item = TypeVar("Item")


class Worker(Generic[Item]):
    """A worker thread behind a bounded queue; the newest wins.

    When the queue is full, everything that waits is dropped in favour of what comes in: under lasting overload waiting
    items are stale, and their age must not grow. A single item may take long; until it is done and the queue is empty
    again, the queue may grow to the larger bound. A worker that has not been idle for a while, or lets items wait for
    long behind one that takes long, is behind: until it is idle again the newest item is the next, as far as those
    between may be left out; of these the newest that is whole, where there is one.

    Args:
        work: called in the worker's thread with each item. What it raises goes to `on_error`; the thread lives on.
        capacity: items that may wait.
        burst_capacity: items that may wait after one that takes long.
        takes_long: whether an item is of that kind.
        on_error: called in the worker's thread with what `work` raised.
        name: of the thread.
        idle: called in the worker's thread while nothing waits, again and again while it returns True, and when it is
            roused. An item that comes in waits until it has returned.
        behind_s: after so long without having been idle it is behind.
        late_s: so is it where an item has waited for so long behind one that takes long.
        may_skip: whether what lies between an item that was worked on and another may be left out, if it is behind.
        is_whole: whether an item tells all that it could. Else one that tells less, being the newest each time, would
            keep all others from their turn.
        left_out: called in the worker's thread with the items that were dropped, oldest first, before the one that
            they were dropped for is worked on.
        clock: steady, seconds.
    """

    def __init__(
        self,
        work: Callable[[Item], None],
        *,
        capacity: int,
        burst_capacity: int,
        takes_long: Callable[[Item], bool],
        on_error: Callable[[Exception], None],
        name: str,
        idle: Callable[[], bool] = lambda: False,
        behind_s: float = math.inf,
        late_s: float = math.inf,
        may_skip: Callable[[Item, Item], bool] = lambda last, other: True,
        is_whole: Callable[[Item], bool] = lambda item: True,
        left_out: Callable[[Sequence[Item]], None] = lambda items: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._work, self._idle = work, idle
        self._on_error = on_error
        self._takes_long = takes_long
        self._capacity = capacity
        self._burst_capacity = burst_capacity
        self._burst = False
        self._behind_s, self._late_s, self._clock = behind_s, late_s, clock
        self._may_skip, self._is_whole, self._left_out = may_skip, is_whole, left_out
        self._busy_since_s = math.inf
        self._is_late = False
        self._last: Item | None = None
        self._waiting: deque[Item] = deque()
        self._came_s: deque[float] = deque()  # when each of them did
        self._changed = threading.Condition()
        self._stopping = self._roused = False
        self._dropped = 0
        self._untold: list[Item] = []  # of the dropped ones
        self._resting_since_s, self._rested_s = -math.inf, 0.0  # the first: inf while it works; the second: before that
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    @property
    def dropped(self) -> int:
        """How many items were never worked on."""
        return self._dropped

    @property
    def waiting(self) -> int:
        """How many items wait."""
        return len(self._waiting)

    @property
    def is_stopping(self) -> bool:
        """Whether the item in work is the last one."""
        return self._stopping

    def put(self, items: Sequence[Item]) -> None:
        """Queue items that belong together; never blocks."""
        with self._changed:
            self._burst = self._burst or any(map(self._takes_long, items))
            if len(self._waiting) + len(items) > (self._burst_capacity if self._burst else self._capacity):
                self._drop(len(self._waiting))
            now_s = self._clock()
            self._waiting.extend(items)
            self._came_s.extend(now_s for _ in items)
            self._rested_s = max(0.0, now_s - self._resting_since_s)
            self._resting_since_s = math.inf
            self._changed.notify_all()

    def rouse(self) -> None:
        """Have `idle` called once nothing waits: there is something to do ahead of the next item; never blocks."""
        with self._changed:
            self._roused = True
            self._changed.notify_all()

    def stand_back(self, patience_s: float, rest_s: float) -> None:
        """Wait until what was put is worked on: Python's lock is the worker's alone meanwhile.

        Args:
            patience_s: how long at most.
            rest_s: only if the worker had rested so long before; one that hardly keeps up has to hear of what comes.
        """
        with self._changed:
            if self._rested_s >= rest_s:
                self._changed.wait_for(lambda: self._resting_since_s < math.inf or self._stopping, patience_s)

    def clear(self) -> None:
        """Forget what waits, without counting it as dropped."""
        with self._changed:
            self._waiting.clear()
            self._came_s.clear()
            self._untold.clear()

    def stop(self, patience_s: float | None = None) -> bool:
        """Finish the item being worked on, forget those that wait, and end the thread.

        Args:
            patience_s: how long to wait for that item; None: as long as it takes.

        Returns:
            Whether the thread has ended; else it ends with the item, if ever.
        """
        with self._changed:
            self._stopping = True
            self._waiting.clear()
            self._came_s.clear()
            self._changed.notify_all()
        if self._thread is not threading.current_thread():
            self._thread.join(patience_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        more = False
        while (taken := self._take(wait=not more)) is not None:
            items, dropped = taken
            more = bool(items)
            try:
                if dropped:
                    self._left_out(dropped)
                for item in items:
                    self._work(item)
                if not items:
                    more = self._idle()
            except Exception as error:
                self._on_error(error)

    def _take(self, *, wait: bool) -> tuple[list[Item], list[Item]] | None:
        """The next item, or none where none waits, and those dropped for it; None where the thread is to end."""
        with self._changed:
            if not self._waiting:
                self._busy_since_s, self._is_late = math.inf, False
                if self._resting_since_s == math.inf:
                    self._resting_since_s = self._clock()
                    self._changed.notify_all()
            if wait:
                self._changed.wait_for(lambda: self._waiting or self._roused or self._stopping)
            if self._stopping:
                return None
            self._roused = False
            if not self._waiting:
                return [], []
            now_s = self._clock()
            self._busy_since_s = min(self._busy_since_s, now_s)
            self._is_late = self._is_late or (self._burst and now_s - self._came_s[0] > self._late_s)
            if self._is_late or now_s - self._busy_since_s > self._behind_s:
                self._skip()
            item = self._last = self._waiting.popleft()
            self._came_s.popleft()
            self._burst = self._takes_long(item) or (self._burst and bool(self._waiting))
            dropped, self._untold = self._untold, []
            return [item], dropped

    def _skip(self) -> None:
        """Leave out what need not be worked on before the newest; nothing that takes long."""
        last, candidates = self._last, list(self._waiting)
        for number, item in enumerate(candidates):
            if self._takes_long(item):
                del candidates[number + 1 :]
                break
        within = [number for number, item in enumerate(candidates) if last is None or self._may_skip(last, item)]
        # Where even the first is too far away, leaving out more does no further harm.
        within = within or list(range(len(candidates)))
        whole = [number for number in within if self._is_whole(candidates[number])]
        self._drop((whole or within)[-1])

    def _drop(self, count: int) -> None:
        """Drop those that have waited longest."""
        self._untold += [self._waiting.popleft() for _ in range(count)]
        for _ in range(count):
            self._came_s.popleft()
        self._dropped += count
