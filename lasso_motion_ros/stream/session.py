"""What is tracked: the model's life from its seed to its reset, and what each pair is answered with."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Generator, Iterator, Sequence

import cv2
import numpy as np

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import LassoMotionError, TrackingError
from lasso_motion_ros.geometry.frames import Frame, FramePair, Seed
from lasso_motion_ros.stream.answer_counts import AnswerCounts
from lasso_motion_ros.stream.heart_phases import HeartPhases
from lasso_motion_ros.stream.heartbeat_separation import HeartbeatSeparation
from lasso_motion_ros.stream.outputs import Output
from lasso_motion_ros.stream.pair_task import FOLLOWED_NS, PairTask, PromisedTasks
from lasso_motion_ros.stream.problem_log import ProblemLog
from lasso_motion_ros.stream.result_messages import ResultMessages
from lasso_motion_ros.tracking.tracker import Tracker, TrackerState, TrackResult

SEED_PROBLEMS = "seed"  # what clicks of both planes together are refused for
_TOLD_PAIRS = 3  # of those left out: the last three successive images tell a filter over time, and its state
Answers = Generator[list[Output], None, None]
# What a method may raise on a pair: also numbers on which the mathematics fails, which must not end the stream.
_METHOD_ERRORS = (LassoMotionError, ValueError, ArithmeticError, np.linalg.LinAlgError, cv2.error)


class TrackingSession:
    """Runs the tracker on pair after pair and says what is to be published.

    Methods wait for each other; attributes may be read at any time, also while the tracker works.

    Args:
        config: what is published, and how.
        tracker: the method.
        phases: the heart's phase at each pair.
        promised: tasks to be made up for where they were skipped.
        problems: takes what the tracker could not do.

    Attributes:
        state: the state now.
        reason: why, in a few plain words.
        counts: how the pairs were answered.
        heartbeat: keeps the heartbeat out of `motion`.
        seeds_taken: how many times clicks made a model.
        last_refusal: why the last clicks were refused; empty where they were not.
        last_pair: the last pair answered, or None.
        last_result: the tracker's answer to it; None where there was no model.
    """

    def __init__(
        self,
        config: StreamConfig,
        tracker: Tracker,
        *,
        phases: HeartPhases,
        promised: PromisedTasks,
        problems: ProblemLog,
    ) -> None:
        self._lock = threading.Lock()
        self._tracker = tracker
        self._messages = ResultMessages(config.world_frame)
        self._promised = promised
        self._problems = problems
        self._has_model = False
        self._forgotten_seeds = 0  # seeds of tasks up to this number were clicked before a reset
        self.state, self.reason = TrackerState.WAITING_FOR_CALIBRATION, "no calibration yet"
        self.counts = AnswerCounts(config.seed_buffer_pairs)
        self._phases = phases
        self.heartbeat = HeartbeatSeparation(config.heartbeat, phases)
        self.seeds_taken = 0
        self.last_refusal = ""
        self.last_pair: FramePair | None = None
        self.last_result: TrackResult | None = None

    def initial_outputs(self) -> list[Output]:
        """What is published on start: the state. A model from before it is LOST till a pair comes."""
        with self._lock:
            if not self._has_model:
                return [self._state_output(0)]
            self._set_state(TrackerState.LOST, "no pair since activation")
            self.last_result = None
            return [self._state_output(0), *self._messages.take_catheter_away(0)]

    def loss_outputs(self) -> list[Output]:
        """What says that the tracker is lost though it has not answered; never waits for it."""
        return self._messages.of_loss()

    def calibrated(self) -> list[Output]:
        """Both planes have a valid calibration; what is to be published, if that is news."""
        with self._lock:
            if self.state is not TrackerState.WAITING_FOR_CALIBRATION:
                return []
            self._set_state(TrackerState.WAITING_FOR_SEED, "no seed yet")
            return [self._state_output(0)]

    def process(self, task: PairTask) -> list[Output]:
        """Answer one pair: reference (where it changes), state, poses, catheter, in this order.

        Pairs may be left out when there is no time for them, but not come out of order. A seed or a new run that
        was left out is made up for with the next pair.
        """
        return [output for answer in self.answers(task) for output in answer]

    def answers(self, task: PairTask, in_hurry: Callable[[], bool] = lambda: False) -> Answers:
        """As `process`, each pair's outputs as soon as they are there: a model's first pose waits for no other pair.

        Args:
            task: the pair, and those since then where its clicks came late.
            in_hurry: whether newer pairs wait: then those since the clicked one are answered again only as close
                together as the motion must be followed. They have had an answer, and keep it.
        """
        with self._lock:
            for one in (*self._promised.take_skipped(task.number), task):
                for outputs in self._answer(one, in_hurry):
                    yield outputs
                    self._learn()

    def prepare(self, frame: Frame) -> None:
        """Have the tracker do ahead what the next pair asks of plane A's frame alone: plane B's is on its way."""
        with self._lock, contextlib.suppress(*_METHOD_ERRORS):  # the answer meets them, too, and says so
            if self._has_model:
                self._tracker.prepare(frame)

    def leave_out(self, tasks: Sequence[PairTask]) -> None:
        """Tell the tracker of pairs that are not answered, since newer ones wait; oldest first, before the next one."""
        with self._lock:
            self._leave_out([task.pair for task in tasks if not task.answered])

    def reset(self, last_task: int) -> list[Output]:
        """Forget model and motion: WAITING_FOR_SEED.

        Args:
            last_task: number of the last task given out; no seed up to it is used any more.

        Returns:
            What is to be published.
        """
        with self._lock:
            self._forgotten_seeds = last_task
            self._promised.clear()
            return [*self._forget(0), self._state_output(0)]

    def set_reference(self) -> None:
        """Make the present phase the reference; published with the next pair.

        In DISPLACED it says that the lasso is now where it belongs.

        Raises:
            TrackingError: the lasso is not tracked: the state is neither TRACKING nor DISPLACED.
        """
        with self._lock:
            if self.state not in (TrackerState.TRACKING, TrackerState.DISPLACED):
                raise TrackingError(
                    f"the reference can be set in TRACKING and DISPLACED only, the state is {self.state.value}"
                )
            self._tracker.set_reference()

    def reconfigure(self, config: StreamConfig) -> None:
        """Go on with other tuning parameters; what is read-only must be as it was.

        Raises:
            ConfigurationError: parameters that contradict each other; then all stays as it was.
        """
        with self._lock:
            if config.heartbeat != self.heartbeat.config:
                self.heartbeat = HeartbeatSeparation(config.heartbeat, self._phases)
            self._tracker.reconfigure(config)

    def _answer(self, task: PairTask, in_hurry: Callable[[], bool]) -> Iterator[list[Output]]:
        outputs: list[Output] = []
        if task.begins_run:
            self._problems.report("", "the stamps of both planes went back: a new run, which needs a seed of its own")
            outputs += self._forget(task.pair.stamp_ns)
        seed = task.seed if task.number > self._forgotten_seeds else None
        result = None if seed is None else self._initialised(task.pair, seed)
        if result is not None:
            yield outputs + self._result_outputs(task.pair, result, is_new=True)
            yield from self._answers_again(task, in_hurry)
            return
        if task.answered:
            pass  # refused clicks change nothing, and this pair has its answer already
        elif self._has_model:
            outputs += self._result_outputs(task.pair, self._tracked(task.pair))
        else:
            self._set_state(TrackerState.WAITING_FOR_SEED, self.last_refusal or "no seed yet")
            self._count(task.pair, None)
            outputs.append(self._state_output(task.pair.stamp_ns))
        yield outputs

    def _answers_again(self, task: PairTask, in_hurry: Callable[[], bool]) -> Iterator[list[Output]]:
        followed_ns = task.pair.stamp_ns
        left_out: list[FramePair] = []
        for pair in task.later:
            if pair.stamp_ns - followed_ns < FOLLOWED_NS and pair is not task.later[-1] and in_hurry():
                left_out.append(pair)
                continue
            followed_ns = pair.stamp_ns
            self._leave_out(left_out)
            left_out.clear()
            yield self._result_outputs(pair, self._tracked(pair))

    def _learn(self) -> None:
        try:
            if self._has_model:
                self._tracker.learn()
        except _METHOD_ERRORS as error:
            self._problems.report("", _words(error))

    def _leave_out(self, pairs: Sequence[FramePair]) -> None:
        if not self._has_model:
            return
        try:
            for pair in pairs[-_TOLD_PAIRS:]:
                self._tracker.leave_out(pair)
        except _METHOD_ERRORS as error:
            self._problems.report("", _words(error))

    def _initialised(self, pair: FramePair, seed: Seed) -> TrackResult | None:
        """The tracker's answer to clicks; None where it refuses them."""
        try:
            result = self._tracker.initialise(pair, seed)
        except _METHOD_ERRORS as error:
            self.last_refusal = _words(error)
            self._problems.report(SEED_PROBLEMS, self.last_refusal)
            return None
        self.last_refusal = ""
        self.seeds_taken += 1
        self._has_model = True
        return result

    def _tracked(self, pair: FramePair) -> TrackResult:
        """The tracker's answer to the next pair; a pair that it cannot work with is one where the lasso is lost."""
        try:
            return self._tracker.track(pair)
        except _METHOD_ERRORS as error:
            self._problems.report("", _words(error))
            known = self._messages.reference_ns
            reference = known if known is not None else pair.stamp_ns
            return TrackResult(pair.stamp_ns, TrackerState.LOST, _words(error), None, None, None, reference)

    def _count(self, pair: FramePair, result: TrackResult | None) -> None:
        self.last_pair, self.last_result = pair, result
        if result is not None:
            self._set_state(result.state, result.reason)
        self.counts.add(pair, self.state)

    def _result_outputs(self, pair: FramePair, result: TrackResult, *, is_new: bool = False) -> list[Output]:
        self._count(pair, result)
        published = None
        if result.state.has_pose and result.motion is not None:
            published = self.heartbeat.publish(result, is_new=is_new)
        return self._messages.of_result(result, published, is_new=is_new)

    def _forget(self, stamp_ns: int) -> list[Output]:
        self._tracker.reset()
        self.heartbeat.reset()
        self._has_model = False
        self._messages.reference_ns = None
        self.counts.forget()
        self.last_result = None
        self.last_refusal = ""
        if self.state is not TrackerState.WAITING_FOR_CALIBRATION:
            self._set_state(TrackerState.WAITING_FOR_SEED, "the model was forgotten")
        return self._messages.take_catheter_away(stamp_ns)

    def _set_state(self, state: TrackerState, reason: str) -> None:
        self.state, self.reason = state, reason

    def _state_output(self, stamp_ns: int) -> Output:
        return self._messages.of_state(self.state, stamp_ns)


def _words(error: Exception) -> str:
    """One line on an error; where it is none of the package's, its type says what kind."""
    text = " ".join(str(error).split())
    return text if isinstance(error, LassoMotionError) else f"{type(error).__name__}: {text}"
