"""Messages in, tracker, messages out: what the node and the offline command share.

Callbacks add messages, which is cheap, and get back the pairs whose turn it is; `process` runs the tracker on
them, in that order. Nothing here looks at a clock: the same messages give the same poses.
"""

from __future__ import annotations

import dataclasses
import threading
from collections import Counter, deque
from typing import Any

import cv2
import numpy as np

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import LassoMotionError, TrackingError
from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane, Seed
from lasso_motion_ros.stream.clicked_pairs import ClickedPairs, PairTask
from lasso_motion_ros.stream.heartbeat_separation import HeartbeatSeparation
from lasso_motion_ros.stream.outputs import Output, PipelineStatistics, Problem
from lasso_motion_ros.stream.result_messages import ResultMessages
from lasso_motion_ros.tracking.tracker import Tracker, TrackerState, TrackResult
from msg_adapters.calibrations import Extrinsics
from msg_adapters.messages import MessageFactory, stamp_to_ns
from msg_adapters.seeds import decode_seed
from msg_adapters.sync.frame_pairs import FramePairs
from msg_adapters.sync.partner import PartnerRule
from msg_adapters.topics import Topic, camera_info_topic, image_topic, seed_topic

_MAX_PROBLEMS = 64
# What the method may raise on a pair: also numbers on which the mathematics fails, which must not end the stream.
_METHOD_ERRORS = (LassoMotionError, ValueError, ArithmeticError, np.linalg.LinAlgError, cv2.error)


class TrackingPipeline:
    """From messages to messages.

    The `add_…` methods may be called from one thread and `process` from another.

    Args:
        config: parameters of tracker and stream.
        messages: makes the messages put out.
        tracker: the method; by default the one that `config` names.
        extrinsics: where the pose of a plain camera matrix comes from; without it such calibrations are refused.
    """

    def __init__(
        self,
        config: StreamConfig,
        messages: MessageFactory,
        tracker: Tracker | None = None,
        extrinsics: Extrinsics | None = None,
    ) -> None:
        if tracker is None:
            from lasso_motion_ros.stream.tracker_factory import create_tracker

            tracker = create_tracker(config)
        self._config = config
        self._messages = ResultMessages(messages, config.world_frame)
        self._tracker = tracker
        self._pairs = FramePairs(
            PartnerRule.from_seconds(config.sync.jitter_s, config.sync.plane_b_offset_s), extrinsics
        )
        self._clicked = ClickedPairs(config.seed_buffer_pairs)
        # A pair may wait for the tracker beside those that wait for clicks.
        self._heartbeat = HeartbeatSeparation(config.heartbeat, remembered=2 * config.seed_buffer_pairs + 64)
        self._intake, self._tracking, self._reporting = threading.Lock(), threading.Lock(), threading.Lock()
        self._state, self._reason = TrackerState.WAITING_FOR_CALIBRATION, "no calibration yet"
        self._has_model = False
        self._indispensable: deque[PairTask] = deque()
        self._forgotten_seeds = 0  # seeds up to this number were clicked before a reset
        self._said_calibrated = False
        self._problems: deque[Problem] = deque(maxlen=_MAX_PROBLEMS)
        self._problem_counts: Counter[str] = Counter()
        # All keys from the start: `statistics` goes through them while the tracker counts.
        self._states: Counter[TrackerState] = Counter(dict.fromkeys(TrackerState, 0))
        # State of the last pairs by stamp, since a pair may be answered again when its clicks come late.
        self._answers: dict[int, TrackerState] = {}
        self._half_pairs = 0
        self._last_pose_ns: int | None = None
        self.last_refusal = ""
        self.last_pair: FramePair | None = None
        self.last_result: TrackResult | None = None

    # What comes in.

    def add_image(self, plane: Plane, message: Any) -> list[PairTask]:
        """Take an Image (or CompressedImage) of one plane; give back the pairs whose turn it is."""
        with self._intake:
            return self._issued(self._pairs.add_image(plane, message), plane, image_topic(plane))

    def add_camera_info(self, plane: Plane, message: Any, *, latched: bool = False) -> list[PairTask]:
        """Take a CameraInfo of one plane, from a publisher that latches or not; give back the pairs now due."""
        with self._intake:
            pairs = self._pairs.add_camera_info(plane, message, latched=latched)
            return self._issued(pairs, plane, camera_info_topic(plane))

    def add_seed(self, plane: Plane, message: Any) -> list[PairTask]:
        """Take the clicks in one plane; give back the pairs to go through (again), see `ClickedPairs`."""
        with self._intake:
            try:
                points = decode_seed(message)
            except LassoMotionError as error:
                self._report(seed_topic(plane).name, str(error))
                return []
            ready = self._clicked.add_clicks(
                plane, stamp_to_ns(message.header.stamp), points, hold=self._pairs.pairing.restarting
            )
            self._report_clicks()
            return [] if ready is None else self._registered([ready])

    def freeze(self) -> FramePair:
        """Hold the last pair with both planes for clicks, however many pairs come after it.

        Raises:
            TrackingError: there has been none.
        """
        with self._intake:
            pair = self._clicked.hold()
        if pair is None:
            raise TrackingError("there is no pair with calibrated images of both planes to hold")
        return pair

    def release(self) -> None:
        """Hold no pair any more."""
        with self._intake:
            self._clicked.release()

    def seed_frozen(self, seed: Seed) -> list[PairTask]:
        """Take clicks on the pair that is held; give back what is to be gone through.

        Raises:
            TrackingError: none is held.
        """
        with self._intake:
            ready = self._clicked.seed_held(seed)
            if ready is None:
                raise TrackingError("no pair is held: call ~/freeze, and click on the picture")
            return self._registered([ready])

    def add_r_peak(self, message: Any) -> list[PairTask]:
        """Take the stamp of an R peak; it brings no pair."""
        with self._intake:
            self._heartbeat.add_r_peak(stamp_to_ns(message.stamp))
        return []

    def flush(self) -> list[PairTask]:
        """The pairs that are left when nothing more will come."""
        with self._intake:
            pairs = self._pairs.flush()
            for plane in PLANES:
                self._report_frames(plane, image_topic(plane))
            return self._given_out(pairs)

    def _issued(self, pairs: list[FramePair], plane: Plane, topic: Topic) -> list[PairTask]:
        self._report_frames(plane, topic)
        return self._given_out(pairs)

    def _given_out(self, pairs: list[FramePair]) -> list[PairTask]:
        ready: list[PairTask] = []
        for place, pair in enumerate(pairs, start=1):
            self._heartbeat.add_pair(pair.stamp_ns, new_run=pair.new_run)
            hold = self._pairs.pairing.restarting or any(later.new_run for later in pairs[place:])
            ready += self._clicked.add_pair(pair, hold)
        self._report_clicks()
        return self._registered(ready)

    def _registered(self, ready: list[PairTask]) -> list[PairTask]:
        """Remember those that must not be lost, though a busy node may skip pairs: seeds and new runs."""
        self._indispensable.extend(one for one in ready if one.seed is not None or one.begins_run)
        return ready

    def _report_frames(self, plane: Plane, topic: Topic) -> None:
        for complaint in self._pairs.frames[plane].take_complaints():
            self._report(topic.name, complaint)

    def _report_clicks(self) -> None:
        for plane, reason in self._clicked.take_complaints():
            self._report(seed_topic(plane).name, reason)

    def _report(self, topic: str, text: str) -> None:
        with self._reporting:
            self._problems.append(Problem(topic, text))
            self._problem_counts[topic] += 1

    # What goes out.

    def initial_outputs(self) -> list[Output]:
        """What is published on start: the state. A model from before it is LOST till a pair comes."""
        with self._tracking:
            if not self._has_model:
                return [self._state_output(0)]
            self._set_state(TrackerState.LOST, "no pair since activation")
            self.last_result = None
            return [self._state_output(0), *self._messages.take_catheter_away(0)]

    def pending_outputs(self) -> list[Output]:
        """State changes that no pair brings: the calibration of both planes has come."""
        if self._said_calibrated or not all(self._pairs.frames[plane].calibrated for plane in PLANES):
            return []
        self._said_calibrated = True
        with self._tracking:
            if self._state is not TrackerState.WAITING_FOR_CALIBRATION:
                return []
            self._set_state(TrackerState.WAITING_FOR_SEED, "no seed yet")
            return [self._state_output(0)]

    def process(self, ready: PairTask) -> list[Output]:
        """Answer one pair: reference (where it changes), state, poses, catheter, in this order.

        Pairs may be left out when there is no time for them, but not come out of order. A seed or a new run that
        was left out is made up for with the next pair.
        """
        with self._tracking:
            outputs: list[Output] = []
            while self._indispensable and self._indispensable[0].number <= ready.number:
                due = self._indispensable.popleft()
                if due.number < ready.number:
                    outputs += self._answer(due)
            return outputs + self._answer(ready)

    def reset(self) -> list[Output]:
        """Forget model, motion and clicks: WAITING_FOR_SEED. Returns what is to be published."""
        with self._intake:
            self._clicked.clear()
            forgotten = self._clicked.number
        with self._tracking:
            self._forgotten_seeds = forgotten
            self._indispensable.clear()
            return [*self._forget(0), self._state_output(0)]

    def set_reference(self) -> None:
        """Make the present phase the reference; published with the next pair.

        In DISPLACED it says that the lasso is now where it belongs.

        Raises:
            TrackingError: the lasso is not tracked: the state is neither TRACKING nor DISPLACED.
        """
        with self._tracking:
            if self._state not in (TrackerState.TRACKING, TrackerState.DISPLACED):
                raise TrackingError(
                    f"the reference can be set in TRACKING and DISPLACED only, the state is {self._state.value}"
                )
            self._tracker.set_reference()

    def reconfigure(self, config: StreamConfig) -> None:
        """Go on with other tuning parameters; what is read-only must be as it was."""
        with self._tracking:
            self._config = config
            self._tracker.reconfigure(config)

    def take_problems(self) -> list[Problem]:
        """Problems since the last call (the last few, if there were many)."""
        with self._reporting:
            problems = list(self._problems)
            self._problems.clear()
            return problems

    @property
    def calibrated(self) -> tuple[Plane, ...]:
        """The planes whose last calibration is valid."""
        return tuple(plane for plane in PLANES if self._pairs.frames[plane].calibrated)

    def statistics(self) -> PipelineStatistics:
        """Counts since the start; never waits for the tracker."""
        result, pair = self.last_result, self.last_pair
        with self._reporting:
            return PipelineStatistics(
                state=self._state,
                reason=self._reason,
                pairs=sum(self._states.values()),
                half_pairs=self._half_pairs,
                poses=sum(count for state, count in self._states.items() if state.has_pose),
                states={state: count for state, count in dict(self._states).items() if count},
                problems=dict(self._problem_counts),
                frames={plane: dataclasses.replace(self._pairs.frames[plane].counts) for plane in PLANES},
                pairing={plane: dataclasses.replace(self._pairs.pairing.counts[plane]) for plane in PLANES},
                last_pair_ns=None if pair is None else pair.stamp_ns,
                last_pose_ns=self._last_pose_ns,
                residual_px={} if result is None else dict(result.residual_px),
                ring=None if result is None else result.ring,
                heartbeat=self._heartbeat.status,
                offset_ns=self._pairs.pairing.offset_ns,
                calibrated=self.calibrated,
            )

    def _answer(self, ready: PairTask) -> list[Output]:
        outputs: list[Output] = []
        if ready.begins_run:
            self._report("", "the stamps of both planes went back: a new run, which needs a seed of its own")
            outputs += self._forget(ready.pair.stamp_ns)
        seed = ready.seed if ready.number > self._forgotten_seeds else None
        result = None if seed is None else self._initialised(ready.pair, seed)
        if result is not None:
            outputs += self._result_outputs(ready.pair, result, is_new=True)
            for pair in ready.later:
                outputs += self._result_outputs(pair, self._tracked(pair))
        elif ready.answered:
            pass  # refused clicks change nothing, and this pair has its answer already
        elif self._has_model:
            outputs += self._result_outputs(ready.pair, self._tracked(ready.pair))
        else:
            self._set_state(TrackerState.WAITING_FOR_SEED, self.last_refusal or "no seed yet")
            self._count(ready.pair, None)
            outputs.append(self._state_output(ready.pair.stamp_ns))
        return outputs

    def _initialised(self, pair: FramePair, seed: Seed) -> TrackResult | None:
        """The tracker's answer to clicks; None where it refuses them."""
        try:
            result = self._tracker.initialise(pair, seed)
        except _METHOD_ERRORS as error:
            self.last_refusal = _words(error)
            self._report("seed", self.last_refusal)
            return None
        self.last_refusal = ""
        self._has_model = True
        return result

    def _tracked(self, pair: FramePair) -> TrackResult:
        """The tracker's answer to the next pair; a pair that it cannot work with is one where the lasso is lost."""
        try:
            return self._tracker.track(pair)
        except _METHOD_ERRORS as error:
            self._report("", _words(error))
            known = self._messages.reference_ns
            reference = known if known is not None else pair.stamp_ns
            return TrackResult(pair.stamp_ns, TrackerState.LOST, _words(error), None, None, None, reference)

    def _count(self, pair: FramePair, result: TrackResult | None) -> None:
        self.last_pair, self.last_result = pair, result
        if result is not None:
            self._set_state(result.state, result.reason)
        before = self._answers.pop(pair.stamp_ns, None)
        if before is not None:
            self._states[before] -= 1
        else:
            self._half_pairs += not pair.is_whole
        self._states[self._state] += 1
        self._answers[pair.stamp_ns] = self._state
        while len(self._answers) > self._config.seed_buffer_pairs:
            del self._answers[next(iter(self._answers))]

    def _result_outputs(self, pair: FramePair, result: TrackResult, *, is_new: bool = False) -> list[Output]:
        self._count(pair, result)
        published = None
        if result.state.has_pose and result.motion is not None:
            published = self._heartbeat.publish(result, is_new=is_new)
            self._last_pose_ns = result.stamp_ns
        return self._messages.of_result(result, published, is_new=is_new)

    def _forget(self, stamp_ns: int) -> list[Output]:
        self._tracker.reset()
        self._heartbeat.reset()
        self._has_model = False
        self._messages.reference_ns = None
        self._answers.clear()
        self.last_result = None
        self.last_refusal = ""
        if self._state is not TrackerState.WAITING_FOR_CALIBRATION:
            self._set_state(TrackerState.WAITING_FOR_SEED, "the model was forgotten")
        return self._messages.take_catheter_away(stamp_ns)

    def _set_state(self, state: TrackerState, reason: str) -> None:
        self._state, self._reason = state, reason

    def _state_output(self, stamp_ns: int) -> Output:
        return self._messages.of_state(self._state, stamp_ns)


def _words(error: Exception) -> str:
    """One line on an error; where it is none of the package's, its type says what kind."""
    text = " ".join(str(error).split())
    return text if isinstance(error, LassoMotionError) else f"{type(error).__name__}: {text}"
