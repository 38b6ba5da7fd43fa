"""Joins plane A's and plane B's images to pairs, by their stamps alone, as `PartnerRule` says.

Frames of one plane come in order of their stamps; between the planes any order will do: a frame waits for its partner
until frames of the other plane show that it is not coming, or its own plane has gone on for 0.5 s and two frames
without one. A plane found silent in this way is waited for only 0.2 s until it is heard again: its silence delays the
other plane once, not always.
"""

from __future__ import annotations

import statistics
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Generic, Literal

from lasso_motion_ros.geometry.frames import Item, Pair, Plane
from msg_adapters.sync.partner import NEW_RUN_NS, TUNING, FrameIntervals, PartnerRule


@dataclass(frozen=True)
class _Patience:
    """How long a frame waits for its partner.

    Attributes:
        frames: further frames of its own plane that a frame waits through, since the topics may overtake each other.
        lag_ns: how far its own plane's stamps go on, at least: topics lag behind each other, and a reliable publisher
            sends lost pieces of an image again after some frames.
        silent_lag_ns: the same where the other plane is silent.
        most_waiting: frames of a plane that wait at most.
        most_backward: frames of a plane that wait at most for the other plane to go back in time as well.
    """

    frames: int = 1
    lag_ns: int = 500_000_000
    silent_lag_ns: int = 200_000_000
    most_waiting: int = 32
    most_backward: int = 16


_PATIENCE = _Patience()

Relation = Literal["wait", "pair", "a alone", "b alone"]


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
    """A frame that waits for its partner.

    Attributes:
        stamp_ns: its stamp.
        item: what goes into the pair.
        interval_ns: plane A only: time since the frame before it.
        period_ns: plane A only: the frame period when it came.
    """

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
        rule: which B belongs to which A.
    """

    def __init__(self, rule: PartnerRule) -> None:
        self._rule = rule
        self.counts: dict[Plane, PlaneCounts] = {"a": PlaneCounts(), "b": PlaneCounts()}
        self._start_run()

    @property
    def restarting(self) -> bool:
        """Whether one plane's stamps have gone back and the other plane's have not yet."""
        return bool(self._queues["a"].backward or self._queues["b"].backward)

    @property
    def offset_ns(self) -> int:
        """Time from A's to B's exposure: the known one, or the median of the last pairs; 0 before the first."""
        if self._rule.offset_ns is not None:
            return self._rule.offset_ns
        return round(statistics.median(self._offsets)) if self._offsets else 0

    @property
    def waiting_a(self) -> Item | None:
        """Plane A's item of the next pair, while nothing of plane B is there; None where it waits for nothing."""
        waiting_a, waiting_b = self._queues["a"].waiting, self._queues["b"].waiting
        return waiting_a[0].item if waiting_a and not waiting_b else None

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
        self._intervals = FrameIntervals()
        self._offsets: deque[int] = deque(maxlen=TUNING.recent)
        self._last_pair_ns: int | None = None
        self._new_run = False

    def _add_backward(self, plane: Plane, stamp_ns: int, item: Item) -> list[Pair[Item]]:
        backward = self._queues[plane].backward
        if backward and stamp_ns <= backward[-1][0]:
            # Back once more before the other plane followed: what came first belongs to no run.
            self.counts[plane].dropped += len(backward)
            backward.clear()
        backward.append((stamp_ns, item))
        if len(backward) > _PATIENCE.most_backward:
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
        if plane == "a":
            self._intervals.add(stamp_ns)
            entry.interval_ns, entry.period_ns = self._intervals.last_ns, self._intervals.period_ns
            if queue.waiting and queue.waiting[-1].period_ns is None:
                queue.waiting[-1].period_ns = entry.interval_ns  # a run's first A has only the next one to tell
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
                relation = self._relation(waiting_a, waiting_b, final)
                if relation == "wait":
                    return
                yield from self._give(
                    None if relation == "b alone" else waiting_a.popleft(),
                    None if relation == "a alone" else waiting_b.popleft(),
                )

    def _has_waited(self, plane: Plane) -> bool:
        """Whether a plane's oldest frame has waited for its partner as long as it may."""
        waiting, other = self._queues[plane].waiting, self._queues["b" if plane == "a" else "a"]
        if len(waiting) <= 1 + _PATIENCE.frames:
            return False
        lag_ns = _PATIENCE.silent_lag_ns if other.silent else _PATIENCE.lag_ns
        return waiting[-1].stamp_ns - waiting[0].stamp_ns >= lag_ns or len(waiting) > _PATIENCE.most_waiting

    def _relation(self, waiting_a: deque[_Unpaired[Item]], waiting_b: deque[_Unpaired[Item]], final: bool) -> Relation:
        """What the oldest undecided A and B are to each other."""
        first, after = waiting_a[0], waiting_b[0].stamp_ns - waiting_a[0].stamp_ns
        jitter = self._rule.jitter_ns
        until_next = waiting_a[1].stamp_ns - first.stamp_ns if len(waiting_a) > 1 else None
        nothing_to_wait_for = final or until_next is not None or self._has_waited("b")
        period = first.period_ns
        if period is None and nothing_to_wait_for:
            between_b = waiting_b[1].stamp_ns - waiting_b[0].stamp_ns if len(waiting_b) > 1 else None
            period = min(between_b or TUNING.longest_period_ns, TUNING.longest_period_ns)
        # The median outlives lost frames; where the rate has slowed down, both neighbours are further away.
        longest = period
        if period is not None and first.interval_ns is not None:
            longest = max(period, first.interval_ns)
            if until_next is not None:
                period = max(period, min(first.interval_ns, until_next))
        shortest = self._intervals.shortest_ns or period
        earliest, latest = self._rule.window_ns(period, shortest)
        if after < earliest:
            return "b alone"
        if self._rule.offset_ns is None:
            if until_next is not None and until_next <= after + jitter:
                return "a alone"
            usual = bool(self._offsets) and abs(after - self.offset_ns) <= 2 * jitter
            sure = after <= latest if usual else after <= jitter
        else:
            sure = after <= latest
        if sure:
            return "pair"
        if not nothing_to_wait_for:
            # As long as no period is known, a B may be later than its window.
            beyond = period is not None and after > self._rule.window_ns(longest, shortest)[1]
            return "a alone" if beyond else "wait"
        return "pair" if after <= latest else "a alone"

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
        period = self._intervals.shortest_ns or TUNING.longest_period_ns
        return min(2 * self._rule.jitter_ns, period // 4)
