"""Which image of plane B belongs to which image of plane A, decided by their stamps.

A B belongs to the last A that is not later than it (jitter aside), up to half of A's frame period after it; or,
where the time from A's to B's exposure is known, to the A nearest to it. Frames of one plane come in order of
their stamps; between the planes any order will do: a frame waits for its partner until frames of the other plane
show that it is not coming, or its own plane has gone on for 0.5 s and two frames without one. A plane that was found
silent so is waited for 0.2 s only, until it is heard again: its silence delays the other plane once, not always.
"""

from __future__ import annotations

import statistics
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Generic, Literal

from lasso_motion_ros.geometry.frames import Item, Pair, Plane

NEW_RUN_NS = 1_000_000_000
# The slowest sequence is 1 frame/s: a longer interval is a pause, and says nothing about the period.
MAX_PERIOD_NS = 1_000_000_000
# Intervals of plane A, and offsets of plane B, that the medians are taken of.
RECENT = 5
# How far its own plane goes on, at least, before a frame gives up its partner: topics lag behind each other, and a
# reliable publisher sends lost pieces of an image again after some frames. And how far where the other plane is silent.
_LAG_NS = 500_000_000
_SILENT_LAG_NS = 200_000_000
_MAX_WAITING = 32
_MAX_BACKWARD = 16


@dataclass
class PlaneCounts:
    """What became of one plane's images.

    Attributes:
        received: all that were added.
        paired: given out together with their partner.
        alone: given out without a partner.
        dropped: never given out: repeated, out of order, or too late for their pair.
    """

    received: int = 0
    paired: int = 0
    alone: int = 0
    dropped: int = 0


@dataclass(eq=False)
class _Unpaired(Generic[Item]):
    stamp_ns: int
    item: Item
    interval_ns: int | None = None
    period_ns: int | None = None


@dataclass(eq=False)
class _PlaneQueue(Generic[Item]):
    """One plane's images that are not yet decided.

    Attributes:
        waiting: in order of stamps.
        newest_ns: newest stamp of this run, decided or not.
        backward: images from more than a second before it: a new run, if the other plane agrees.
        silent: frames of the other plane have waited for it in vain since it was heard last.
    """

    waiting: deque[_Unpaired[Item]] = field(default_factory=deque)
    newest_ns: int | None = None
    backward: list[tuple[int, Item]] = field(default_factory=list)
    silent: bool = False


class PairSynchroniser(Generic[Item]):
    """Joins two streams of stamped items into pairs.

    Pairs come out in strictly increasing order of their stamps within a run; no item is given out twice; what
    waits is bounded, to a few items a plane.

    Args:
        jitter_s: a B this much earlier than its A still belongs to it.
        plane_b_offset_s: known time from A's to B's exposure; negative: unknown.
        patience: further frames of its own plane (and 0.5 s of their stamps, 0.2 s after a silence) that a frame
            waits through for a partner that the other plane's frames do not yet rule out: the topics may overtake
            each other.
    """

    def __init__(self, jitter_s: float, plane_b_offset_s: float, patience: int = 1) -> None:
        self._jitter_ns = round(jitter_s * 1e9)
        self._known_offset_ns = round(plane_b_offset_s * 1e9) if plane_b_offset_s >= 0.0 else None
        self._patience = patience
        self.counts: dict[Plane, PlaneCounts] = {"a": PlaneCounts(), "b": PlaneCounts()}
        self._start_run()

    @property
    def restarting(self) -> bool:
        """Whether one plane's stamps have gone back and the other plane's have not yet."""
        return bool(self._queues["a"].backward or self._queues["b"].backward)

    @property
    def offset_ns(self) -> int:
        """Time from A's to B's exposure: the known one, or the median of the last pairs; 0 before the first."""
        if self._known_offset_ns is not None:
            return self._known_offset_ns
        return round(statistics.median(self._offsets)) if self._offsets else 0

    def add(self, plane: Plane, stamp_ns: int, item: Item) -> list[Pair[Item]]:
        """Take one item, give back the pairs that are decided now."""
        queue, counts = self._queues[plane], self.counts[plane]
        counts.received += 1
        if queue.newest_ns is not None and stamp_ns < queue.newest_ns - NEW_RUN_NS:
            return self._add_backward(plane, stamp_ns, item)
        if queue.newest_ns is not None and stamp_ns <= queue.newest_ns:
            counts.dropped += 1
            return []
        # A plane that goes on forwards takes back what looked like a new run.
        counts.dropped += len(queue.backward)
        queue.backward.clear()
        self._append(plane, stamp_ns, item)
        return list(self._decide())

    def flush(self) -> list[Pair[Item]]:
        """The pairs that are left when nothing more will come."""
        return list(self._decide(final=True))

    def reset(self) -> None:
        """Forget all items and what was learnt of the stream; the counts go on."""
        for plane, queue in self._queues.items():
            self.counts[plane].dropped += len(queue.waiting) + len(queue.backward)
        self._start_run()

    def _start_run(self) -> None:
        self._queues: dict[Plane, _PlaneQueue[Item]] = {"a": _PlaneQueue(), "b": _PlaneQueue()}
        self._intervals: deque[int] = deque(maxlen=RECENT)
        self._offsets: deque[int] = deque(maxlen=RECENT)
        self._last_pair_ns: int | None = None
        self._new_run = False

    def _add_backward(self, plane: Plane, stamp_ns: int, item: Item) -> list[Pair[Item]]:
        backward = self._queues[plane].backward
        if backward and stamp_ns <= backward[-1][0]:
            # Back once more before the other plane followed: what came first belongs to no run.
            self.counts[plane].dropped += len(backward)
            backward.clear()
        backward.append((stamp_ns, item))
        if len(backward) > _MAX_BACKWARD:
            backward.pop(0)
            self.counts[plane].dropped += 1
        if not (self._queues["a"].backward and self._queues["b"].backward):
            return []
        pairs = self.flush()
        restart: dict[Plane, list[tuple[int, Item]]] = {
            "a": self._queues["a"].backward,
            "b": self._queues["b"].backward,
        }
        self._start_run()
        self._new_run = True
        # In order of stamps, so that the order of arrival does not show.
        merged = sorted(((stamp, name) for name in restart for stamp, _ in restart[name]))
        for stamp, name in merged:
            self._append(name, stamp, restart[name].pop(0)[1])
            pairs.extend(self._decide())
        return pairs

    def _append(self, plane: Plane, stamp_ns: int, item: Item) -> None:
        queue = self._queues[plane]
        entry = _Unpaired(stamp_ns, item)
        if plane == "a" and queue.newest_ns is not None:
            interval = min(stamp_ns - queue.newest_ns, MAX_PERIOD_NS)
            self._intervals.append(interval)
            entry.interval_ns, entry.period_ns = interval, statistics.median_low(self._intervals)
            if queue.waiting and queue.waiting[-1].period_ns is None:
                queue.waiting[-1].period_ns = interval  # a run's first A has only the next one to tell
        queue.newest_ns = stamp_ns
        queue.silent = False
        queue.waiting.append(entry)

    def _decide(self, final: bool = False) -> Iterator[Pair[Item]]:
        waiting_a, waiting_b = self._queues["a"].waiting, self._queues["b"].waiting
        while waiting_a or waiting_b:
            if not waiting_b:
                if not (final or self._has_waited("a")):
                    return
                self._queues["b"].silent = True
                yield from self._give(waiting_a.popleft(), None)
            elif not waiting_a:
                if not (final or self._has_waited("b")):
                    return
                self._queues["a"].silent = True
                yield from self._give(None, waiting_b.popleft())
            else:
                verdict = self._verdict(waiting_a, waiting_b, final)
                if verdict == "wait":
                    return
                yield from self._give(
                    None if verdict == "b alone" else waiting_a.popleft(),
                    None if verdict == "a alone" else waiting_b.popleft(),
                )

    def _has_waited(self, plane: Plane) -> bool:
        """Whether a plane's oldest frame has waited for its partner as long as it may."""
        waiting, other = self._queues[plane].waiting, self._queues["b" if plane == "a" else "a"]
        if len(waiting) <= 1 + self._patience:
            return False
        lag_ns = _SILENT_LAG_NS if other.silent else _LAG_NS
        return waiting[-1].stamp_ns - waiting[0].stamp_ns >= lag_ns or len(waiting) > _MAX_WAITING

    def _verdict(
        self, waiting_a: deque[_Unpaired[Item]], waiting_b: deque[_Unpaired[Item]], final: bool
    ) -> Literal["wait", "pair", "a alone", "b alone"]:
        """What the oldest undecided A and B are to each other."""
        first, after = waiting_a[0], waiting_b[0].stamp_ns - waiting_a[0].stamp_ns
        jitter, known = self._jitter_ns, self._known_offset_ns
        until_next = waiting_a[1].stamp_ns - first.stamp_ns if len(waiting_a) > 1 else None
        nothing_to_wait_for = final or until_next is not None or self._has_waited("b")
        period = first.period_ns
        if period is None and nothing_to_wait_for:
            between_b = waiting_b[1].stamp_ns - waiting_b[0].stamp_ns if len(waiting_b) > 1 else MAX_PERIOD_NS
            period = min(between_b, MAX_PERIOD_NS)
        # The median outlives lost frames; where the rate has slowed down, both neighbours are further away.
        longest = period
        if period is not None and first.interval_ns is not None:
            longest = max(period, first.interval_ns)
            if until_next is not None:
                period = max(period, min(first.interval_ns, until_next))
        if known is None:
            if after < -jitter:
                return "b alone"
            if until_next is not None and until_next <= after + jitter:
                return "a alone"
            limit = None if period is None else period // 2 + jitter
            beyond = longest is not None and after > longest // 2 + jitter
            usual = bool(self._offsets) and abs(after - self.offset_ns) <= 2 * jitter
            sure = after <= jitter or (usual and limit is not None and after <= limit)
        else:
            after -= known
            # A lost A makes the interval behind it twice as long; the known time needs no such margin.
            shortest = min(self._intervals, default=period)
            limit = None if shortest is None else max(2 * shortest // 5, jitter)
            if after < -(limit if limit is not None else jitter):
                return "b alone"
            sure = abs(after) <= (limit if limit is not None else jitter)
            beyond = limit is not None and after > limit
        if sure:
            return "pair"
        if not nothing_to_wait_for:
            return "a alone" if beyond else "wait"
        return "pair" if limit is not None and after <= limit else "a alone"

    def _give(self, a: _Unpaired[Item] | None, b: _Unpaired[Item] | None) -> Iterator[Pair[Item]]:
        if a is not None:
            stamp = a.stamp_ns
        elif b is not None:
            stamp = b.stamp_ns - self.offset_ns
        pair = Pair(stamp, a.item if a else None, b.item if b else None, self._new_run)
        # A frame whose partner was given out alone before: its instant has been answered.
        margin = 0 if pair.is_whole else self._late_margin_ns()
        if self._last_pair_ns is not None and stamp <= self._last_pair_ns + margin:
            for plane in pair.frames:
                self.counts[plane].dropped += 1
            return
        for plane in pair.frames:
            if pair.is_whole:
                self.counts[plane].paired += 1
            else:
                self.counts[plane].alone += 1
        if a is not None and b is not None:
            self._offsets.append(b.stamp_ns - a.stamp_ns)
        self._last_pair_ns, self._new_run = stamp, False
        yield pair

    def _late_margin_ns(self) -> int:
        period = min(self._intervals) if self._intervals else MAX_PERIOD_NS
        return min(2 * self._jitter_ns, period // 4)
