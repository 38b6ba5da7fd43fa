"""The tracker node's pairs are answered one after another, in a thread of its own."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from lasso_motion_ros.core.errors import TrackingError
from lasso_motion_ros.geometry.frames import Frame
from lasso_motion_ros.nodes.describer import Describer
from lasso_motion_ros.nodes.latency import Latencies
from lasso_motion_ros.nodes.state_watch import StateWatch
from lasso_motion_ros.nodes.worker import Worker
from lasso_motion_ros.stream.pair_task import PairTask
from lasso_motion_ros.stream.pipeline import TrackingPipeline
from msg_adapters.messages import NANOSECONDS


@dataclass(frozen=True)
class _Tuning:
    """How the node keeps up.

    Attributes:
        waiting_pairs: pairs that may wait for the tracker. Ten come at once where calibrations were sent again.
        behind_s: a tracker that has had no rest for so long is too slow for the stream, and goes on with the newest
            pair from which the motion can be followed. To build a model, and answer the pairs that came meanwhile in
            their order, takes less.
        late_s: so does one that lets a pair wait for so long while a model is built. On a machine that keeps up none
            waits for half of this.
        stand_back_s: how long callbacks wait at most for the answer to a pair that has come, so as not to take turns
            with the tracker at Python's lock.
        rest_s: they do where the tracker had so long a rest before.
        apart_s: plane A's image is worked on before plane B's has come where that is exposed so much later, at least.
            One that is right behind would be kept waiting by it.
        patience_s: how long anything but a pair waits for a pair that is being answered.
    """

    waiting_pairs: int = 12
    behind_s: float = 2.0
    late_s: float = 0.5
    stand_back_s: float = 0.02
    rest_s: float = 0.01
    apart_s: float = 0.005
    patience_s: float = 5.0


TUNING = _Tuning()


class Answering:
    """The pipeline while the node is configured, and the thread that answers its pairs while the node is active.

    Args:
        state_watch: publishes the answers.
        now_ns: the node's clock.
        on_error: takes what the tracker raised; in the thread, as the next two are.
        on_worked: called with each task once the tracker is done with it, and why it refused its clicks.
        on_answered: called with each task that was answered, once its answer is out.

    Attributes:
        pipeline: None while the node is not configured.
        latencies: of the pairs.
    """

    def __init__(
        self,
        state_watch: StateWatch,
        now_ns: Callable[[], int],
        on_error: Callable[[Exception], None],
        on_worked: Callable[[PairTask, str], None],
        on_answered: Callable[[PairTask], None],
    ) -> None:
        self.pipeline: TrackingPipeline | None = None
        self.latencies = Latencies()
        self._state_watch, self._now_ns, self._on_error = state_watch, now_ns, on_error
        self._on_worked, self._on_answered = on_worked, on_answered
        self._worker: Worker[PairTask] | None = None
        self._describer = Describer()
        # Answers are published in the order in which they came about: nothing from before a reset comes after it.
        self._answering = threading.Lock()
        self._begun: Frame | None = None  # the last one that was worked on before its pair was there

    @property
    def is_active(self) -> bool:
        """Whether pairs are answered."""
        return self.pipeline is not None and self._worker is not None

    @property
    def dropped(self) -> int:
        """How many pairs were never worked on."""
        return 0 if self._worker is None else self._worker.dropped

    def active(self) -> TrackingPipeline:
        """The pipeline.

        Raises:
            TrackingError: the node is not active.
        """
        if self.pipeline is None or self._worker is None:
            raise TrackingError("the node is not active")
        return self.pipeline

    def begin(self, burst_capacity: int) -> None:
        """Start the thread.

        Args:
            burst_capacity: pairs that may wait while a model is built and those since the clicked one are answered.
        """
        self._worker = Worker(
            self._track,
            capacity=TUNING.waiting_pairs,
            burst_capacity=burst_capacity,
            takes_long=lambda task: task.seed is not None,
            on_error=self._on_error,
            name="tracker",
            idle=self._use_rest,
            behind_s=TUNING.behind_s,
            late_s=TUNING.late_s,
            may_skip=PairTask.is_followed_by,
            is_whole=lambda task: task.is_whole,
            left_out=self._leave_out,
        )

    def end(self) -> bool:
        """Stop the thread; False if the tracker hangs in a pair: it is left behind, and the pipeline with it."""
        is_done = self._worker is None or self._worker.stop(TUNING.patience_s)
        self._worker = None
        if not is_done:
            self.pipeline, self._answering = None, threading.Lock()
        return is_done

    def enqueue(self, tasks: Sequence[PairTask]) -> None:
        """Have pairs answered, in their order; or what can be worked out before the next one has come."""
        worker = self._worker
        if worker is None:
            return
        if not tasks:
            if self._unbegun() is not None:
                worker.rouse()
            return
        for task in tasks:
            if not task.answered:  # else it waited for clicks, not for us
                self.latencies.begin(task.number, time.monotonic())
        self._state_watch.timeout.asked(tasks[-1].number, time.monotonic())
        worker.put(tasks)
        if not any(task.seed is not None for task in tasks):
            worker.stand_back(TUNING.stand_back_s, TUNING.rest_s)

    def clear(self) -> None:
        """Forget the pairs that wait."""
        if self._worker is not None:
            self._worker.clear()

    @contextlib.contextmanager
    def between_answers(self) -> Iterator[None]:
        """While no pair is being answered; does not wait for a tracker that hangs.

        Raises:
            TrackingError: it has not answered in time.
        """
        if not self._answering.acquire(timeout=TUNING.patience_s):
            raise TrackingError(f"the tracker hangs: it has not answered a pair for {TUNING.patience_s:g} s or more")
        try:
            yield
        finally:
            self._answering.release()

    def if_free(self, action: Callable[[], None]) -> None:
        """Do something at once, unless a pair waits or is being answered."""
        is_free = self._worker is not None and not self._worker.waiting
        if is_free and self._answering.acquire(blocking=False):
            try:
                action()
            finally:
                self._answering.release()

    def _track(self, task: PairTask) -> None:
        pipeline, worker = self.active(), self._worker
        refusal = "the tracker failed on these clicks; its log says why"
        if worker is None:
            return
        try:
            answers = pipeline.session.answers(task, lambda: worker.waiting > 0)
            with self._answering, contextlib.closing(answers):
                for outputs in answers:
                    if self._worker is worker:  # else it hung, and the node was deactivated meanwhile
                        self._state_watch.answer(task.number, outputs)
                    if worker.is_stopping:  # dozens of pairs may be to be answered again
                        break
            refusal = pipeline.session.last_refusal
        finally:
            # A pair on which the tracker failed is not answered: if they all are such, that is a loss.
            if self._worker is worker:
                self._on_worked(task, refusal)
        if self._worker is not worker:
            return
        age_s = (self._now_ns() - task.pair.stamp_ns) / NANOSECONDS
        self.latencies.end(task.number, time.monotonic(), age_s)
        self._on_answered(task)

    def _leave_out(self, tasks: Sequence[PairTask]) -> None:
        with self._answering:
            self.active().session.leave_out(tasks)

    def _use_rest(self) -> bool:
        """While no pair waits; whether there is more to do."""
        pipeline = self.pipeline
        if pipeline is None:
            return False
        frame = self._unbegun()
        if frame is not None:
            self._begun = frame
            pipeline.session.prepare(frame)
            return True
        result = pipeline.session.last_result
        return self._describer.step(None if result is None else result.catheter)

    def _unbegun(self) -> Frame | None:
        """Plane A's frame of the next pair, while plane B's is to come and nothing was worked out of it yet."""
        if self.pipeline is None or self.pipeline.intake.offset_ns < TUNING.apart_s * NANOSECONDS:
            return None
        frame = self.pipeline.intake.waiting_a
        return None if frame is self._begun else frame
