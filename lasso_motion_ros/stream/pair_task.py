"""What the intake hands to the tracking session: a pair to answer, with the clicks on it."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from lasso_motion_ros.geometry.frames import FramePair, Seed

# Four pairs a second are what many systems take: no breath is missed between two of them.
FOLLOWED_NS = 250_000_000


@dataclass(frozen=True, eq=False)
class PairTask:
    """A pair for the tracker to answer, and the clicks on it, if any.

    Attributes:
        pair: the images.
        seed: clicks on this pair: the model is built here.
        answered: the pair was answered before, and comes again because its clicks came late.
        later: the pairs since then, oldest first, to be answered again after it.
        number: counts up from task to task.
    """

    pair: FramePair
    seed: Seed | None = None
    answered: bool = False
    later: tuple[FramePair, ...] = ()
    number: int = 0

    @property
    def begins_run(self) -> bool:
        """Whether the stamps went back here; when the pair comes again, that has been dealt with."""
        return self.pair.new_run and not self.answered

    def is_followed_by(self, other: PairTask) -> bool:
        """Whether the motion can be followed from here to another task, with nothing between them."""
        return other._newest.stamp_ns - self._newest.stamp_ns <= FOLLOWED_NS

    @property
    def is_whole(self) -> bool:
        """Whether the pair shows both planes."""
        return self.pair.is_whole

    @property
    def _newest(self) -> FramePair:
        return self.later[-1] if self.later else self.pair


class PromisedTasks:
    """Tasks that must not be lost, though a busy node may skip pairs: those with a seed, and the first of a run.

    The intake adds them and the session takes them, in the order of their numbers. No lock is needed between the two,
    so receiving never waits for the tracker.
    """

    def __init__(self) -> None:
        self._tasks: deque[PairTask] = deque()

    def add(self, tasks: Iterable[PairTask]) -> None:
        """Remember those of the next tasks that must not be lost."""
        self._tasks.extend(task for task in tasks if task.seed is not None or task.begins_run)

    def take_skipped(self, number: int) -> Iterator[PairTask]:
        """Those before the task with this number that were never worked on; the task itself is kept no longer."""
        while self._tasks and self._tasks[0].number <= number:
            task = self._tasks.popleft()
            if task.number < number:
                yield task

    def clear(self) -> None:
        """Forget them all."""
        self._tasks.clear()
