"""The tracker node: images, calibrations and clicks in, breathing motion out."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from geometry_msgs.msg import Point, PolygonStamped
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Header

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.compiled import arithmetic
from lasso_motion_ros.core.errors import ConfigurationError, LassoMotionError, TrackingError
from lasso_motion_ros.geometry.frames import PLANES, Frame, Plane
from lasso_motion_ros.initialisation.proposal import Proposal
from lasso_motion_ros.nodes.clickless_start import ClicklessStart
from lasso_motion_ros.nodes.configured_node import ConfiguredNode
from lasso_motion_ros.nodes.describer import Describer
from lasso_motion_ros.nodes.diagnostics import heartbeat_status, plane_status, tracker_status
from lasso_motion_ros.nodes.kernels_aside import KernelsAside
from lasso_motion_ros.nodes.latency import Latencies
from lasso_motion_ros.nodes.parameters import LiveParameters
from lasso_motion_ros.nodes.running import guarded, kind_of
from lasso_motion_ros.nodes.state_watch import StateWatch
from lasso_motion_ros.nodes.steady_timer import steady_timer
from lasso_motion_ros.nodes.tf_extrinsics import tf_extrinsics
from lasso_motion_ros.nodes.tracker_inputs import InputCallbacks, TrackerInputs
from lasso_motion_ros.nodes.tracker_publishers import TrackerPublishers
from lasso_motion_ros.nodes.tracker_services import TrackerServices
from lasso_motion_ros.nodes.tracking_view import TrackingView
from lasso_motion_ros.nodes.watch import StreamWatch
from lasso_motion_ros.nodes.worker import Worker
from lasso_motion_ros.stream.outputs import Output, PipelineStatistics
from lasso_motion_ros.stream.pair_task import PairTask
from lasso_motion_ros.stream.pipeline import TrackingPipeline
from lasso_motion_ros.stream.warm_up import dry_run, warm_up
from lasso_motion_ros.tracking.tracker import TrackerState
from msg_adapters.input_bytes import ReadCameraInfo, ReadImage
from msg_adapters.messages import NANOSECONDS, stamp_to_ns
from msg_adapters.seeds import read_seeds_file
from msg_adapters.topics import DIAGNOSTICS, camera_info_topic, image_topic, seed_topic


@dataclass(frozen=True)
class _Tuning:
    """How the node keeps up, and how often it speaks.

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
        look_s: between two looks whether images still come and are answered.
        patience_s: how long anything but a pair waits for a pair that is being answered.
        diagnostics_s: between two messages on /diagnostics.
        stream_complaint_s: between two complaints about a stream as a whole.
    """

    waiting_pairs: int = 12
    behind_s: float = 2.0
    late_s: float = 0.5
    stand_back_s: float = 0.02
    rest_s: float = 0.01
    apart_s: float = 0.005
    look_s: float = 0.1
    patience_s: float = 5.0
    diagnostics_s: float = 1.0
    stream_complaint_s: float = 30.0


_TUNING = _Tuning()

_IMAGE_INPUTS = {make(plane).name for plane in PLANES for make in (image_topic, camera_info_topic)}


class TrackerNode(ConfiguredNode[StreamConfig], LifecycleNode):  # type: ignore[misc]
    """Wiring only: callbacks store and pair, one worker thread tracks the pairs and publishes.

    Raises:
        ConfigurationError: a parameter that is unknown, of the wrong type or out of range.
    """

    def __init__(self) -> None:
        super().__init__("lasso_tracker", StreamConfig)
        self._live = LiveParameters(self, self.declared, self._on_tuning)
        self._pipeline: TrackingPipeline | None = None
        self._worker: Worker[PairTask] | None = None
        self._inputs: TrackerInputs | None = None
        # Answers are published in the order in which they came about: nothing from before a reset comes after it.
        self._answering = threading.Lock()
        self._latencies, self._describer = Latencies(), Describer()
        self._warm, self._silence = False, ""
        self._begun: Frame | None = None  # the last one that was worked on before its pair was there
        self._tracker_publishers = TrackerPublishers(
            self, self.messages, self.complaints.error, self._on_state_change, self.declared
        )
        log = self.get_logger()
        self._kernels = KernelsAside(log.info, log.warning, lambda: dry_run(self._live.config, self.messages))
        self._state_watch = StateWatch(self._tracker_publishers, self.complaints, self._loss_outputs)
        self._tracker_publishers.publish_state(TrackerState.INACTIVE)
        self._tracker_services = TrackerServices(
            self, self._active, self._enqueue, self._reset, self._set_reference, self._show
        )
        self._view = TrackingView(self._tracker_publishers, self._state_watch, self._tracker_services.board)
        self._clickless = ClicklessStart(
            self, self._tracker_publishers.publish_proposals, self._start_with, self.complaints.error
        )
        steady_timer(self, _TUNING.diagnostics_s, self._on_timer)
        steady_timer(self, _TUNING.look_s, self._on_look)

    def start(self) -> None:
        """Configure and activate, if `autostart` says so.

        Raises:
            ConfigurationError: with these parameters the node cannot work.
        """
        if not self._live.config.autostart:
            return
        if self.trigger_configure() != TransitionCallbackReturn.SUCCESS:
            raise ConfigurationError("the node could not be configured")
        if self.trigger_activate() != TransitionCallbackReturn.SUCCESS:
            raise ConfigurationError("the node could not be activated")

    def close(self) -> None:
        """Stop the worker and say INACTIVE, while there still is a publisher to say it."""
        self._kernels.close()
        self._deactivate()
        self._tracker_publishers.close()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Build the tracker from the parameters as they stand now."""
        return self._transition(self._configure)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Listen, and start the worker."""
        return self._transition(self._activate)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop listening and working; the model is kept, and is LOST until the first pair after the next activation."""
        return self._transition(self._deactivate)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget the tracker."""
        return self._transition(self._forget)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop and forget."""
        return self._transition(self._forget)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop and forget; the node is unconfigured again and can be configured anew."""
        return self._transition(self._forget)

    def _transition(self, change: Callable[[], None]) -> TransitionCallbackReturn:
        try:
            change()
        except LassoMotionError as error:
            self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        except Exception as error:
            self.get_logger().error(f"{type(error).__name__}: {error}")
            return TransitionCallbackReturn.ERROR
        return TransitionCallbackReturn.SUCCESS

    def _configure(self) -> None:
        config = self._live.config
        self._seeds = read_seeds_file(config.seeds_file) if config.seeds_file else {}
        if not self._warm:
            self._kernels.begin()
            self.get_logger().info(f"arithmetic: {arithmetic()}")
            warm_up(config, self.messages)
            self._warm = True
        self._pipeline = TrackingPipeline(config, extrinsics=tf_extrinsics(self, config.world_frame))

    def _activate(self) -> None:
        pipeline, config = self._pipeline, self._live.config
        if pipeline is None:
            raise TrackingError("the node must be configured before it is activated")
        self._worker = Worker(
            self._track,
            capacity=_TUNING.waiting_pairs,
            # While a model is built and the pairs since the clicked one are answered again, new ones arrive.
            burst_capacity=config.seed_buffer_pairs,
            takes_long=lambda task: task.seed is not None,
            on_error=self.complaints.error,
            name="tracker",
            idle=self._use_rest,
            behind_s=_TUNING.behind_s,
            late_s=_TUNING.late_s,
            may_skip=PairTask.is_followed_by,
            is_whole=lambda task: task.is_whole,
            left_out=self._leave_out,
        )
        session = pipeline.session
        self._clickless.begin(config, lambda: session.state)
        self._watch = StreamWatch(time.monotonic())
        self._state_watch.begin(config.stream_timeout_s)
        self._by_arrival = config.stamp_source == "arrival"
        self._tracker_publishers.publish(pipeline.session.initial_outputs())
        for plane in PLANES:
            if plane in self._seeds:
                self._on_seed(plane, self.messages.make(seed_topic(plane).type_name, self._seeds[plane]))
        callbacks = InputCallbacks(self._on_image, self._on_camera_info, self._on_seed, self._on_click, self._on_r_peak)
        self._inputs = TrackerInputs(self, config, callbacks)

    def _deactivate(self) -> None:
        if self._inputs is not None:
            self._inputs.destroy()
            self._inputs = None
        self._clickless.end(_TUNING.patience_s)
        if self._worker is not None:
            if not self._worker.stop(_TUNING.patience_s):
                self.get_logger().error("the tracker hangs in a pair and is left behind: configure the node anew")
                self._pipeline, self._answering = None, threading.Lock()
            self._worker = None
        self._state_watch.end()
        if self._pipeline is not None:
            self._pipeline.intake.release()
        self._tracker_services.give_up("the node is not active")
        self._tracker_publishers.publish_state(TrackerState.INACTIVE)

    def _forget(self) -> None:
        self._deactivate()
        self._pipeline = None

    @guarded
    def _on_image(self, plane: Plane, message: ReadImage | CompressedImage) -> None:
        self._view.name_frame(plane, message.header.frame_id)
        if self._by_arrival:
            message.header.stamp = self.get_clock().now().to_msg()
        pipeline = self._active()
        tasks = pipeline.intake.add_image(plane, message)
        if plane in pipeline.intake.held:
            self._watch.add_held(plane, time.monotonic_ns())
            self._state_watch.timeout.add_held(time.monotonic())
        else:
            stamp = pipeline.intake.sources[plane].exposure_ns(stamp_to_ns(message.header.stamp))
            self._watch.add_image(plane, stamp, time.monotonic_ns())
            self._state_watch.timeout.add_image(plane, time.monotonic())
        self._enqueue(tasks)
        self._view.add_image(pipeline, plane, message)

    @guarded
    def _on_camera_info(self, plane: Plane, message: ReadCameraInfo, latched: bool) -> None:
        if self._by_arrival:
            message.header.stamp.sec = message.header.stamp.nanosec = 0  # holds until the next
        pipeline = self._active()
        self._enqueue(pipeline.intake.add_camera_info(plane, message, latched=latched))
        if self._tracker_publishers.state == TrackerState.WAITING_FOR_CALIBRATION.value:
            with self._between_answers():
                self._tracker_publishers.publish(pipeline.pending_outputs())

    @guarded
    def _on_seed(self, plane: Plane, message: PolygonStamped) -> None:
        self._enqueue(self._active().intake.add_seed(plane, message))

    @guarded
    def _on_click(self, plane: Plane, message: Point) -> None:
        self._tracker_services.board.click(plane, message.x, message.y)
        self._show()

    @guarded
    def _on_r_peak(self, message: Header) -> None:
        self._active().intake.add_r_peak(message)

    def _on_tuning(self, config: StreamConfig) -> None:
        if self._pipeline is not None:
            with self._between_answers():
                self._pipeline.session.reconfigure(config)
        self._state_watch.timeout.reconfigure(config.stream_timeout_s)
        self._clickless.reconfigure(config)

    def _start_with(self, ring: Proposal) -> None:
        self._enqueue([self._active().intake.seed_pair(ring.pair, ring.seed)])

    def _start_unasked(self) -> None:
        """Start with a ring that was found, while no pair is being answered; here, where pairs are numbered."""
        is_free = self._worker is not None and not self._worker.waiting
        if self._clickless.is_due and is_free and self._answering.acquire(blocking=False):  # else at the next look
            try:
                self._clickless.start_unasked()
            finally:
                self._answering.release()

    def _reset(self) -> None:
        pipeline = self._active()
        with self._between_answers():
            self._clickless.reset()
            if self._worker is not None:
                self._worker.clear()
            self._state_watch.timeout.forget()
            self._tracker_publishers.publish(pipeline.reset())

    def _set_reference(self) -> None:
        session = self._active().session
        with self._between_answers():
            told = self._told()
            if told.state is not session.state:
                raise TrackingError(f"there is no present phase to refer to: {told.reason}")
            session.set_reference()

    @contextlib.contextmanager
    def _between_answers(self) -> Iterator[None]:
        """While no pair is being answered; does not wait for a tracker that hangs.

        Raises:
            TrackingError: it has not answered in time.
        """
        if not self._answering.acquire(timeout=_TUNING.patience_s):
            raise TrackingError(f"the tracker hangs: it has not answered a pair for {_TUNING.patience_s:g} s or more")
        try:
            yield
        finally:
            self._answering.release()

    def _loss_outputs(self) -> list[Output]:
        return self._active().session.loss_outputs()

    def _told(self) -> PipelineStatistics:
        """The pipeline's counts, with the state as published."""
        return self._state_watch.told(self._active().statistics())

    def _active(self) -> TrackingPipeline:
        if self._pipeline is None or self._worker is None:
            raise TrackingError("the node is not active")
        return self._pipeline

    def _enqueue(self, tasks: Sequence[PairTask]) -> None:
        if tasks and self._worker is not None:
            for task in tasks:
                if not task.answered:  # else it waited for clicks, not for us
                    self._latencies.begin(task.number, time.monotonic())
            self._state_watch.timeout.asked(tasks[-1].number, time.monotonic())
            if any(task.seed is not None for task in tasks):
                self._clickless.overtake()
            self._worker.put(tasks)
            if not any(task.seed is not None for task in tasks):
                self._worker.stand_back(_TUNING.stand_back_s, _TUNING.rest_s)
        elif self._worker is not None and self._unbegun() is not None:
            self._worker.rouse()
        self._complain()

    def _track(self, task: PairTask) -> None:
        pipeline, worker = self._active(), self._worker
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
                self._tracker_services.seeded(task, refusal)
                if task.seed is not None:
                    self._publish_diagnostics()  # whoever clicked waits for the answer
        if self._worker is not worker:
            return
        age_s = (self.get_clock().now().nanoseconds - task.pair.stamp_ns) / NANOSECONDS
        self._latencies.end(task.number, time.monotonic(), age_s)
        self._complain()
        if task.seed is None:  # else its pair is one of the past
            self._clickless.add(task.pair)
        self._show()
        self._tracker_publishers.show_standard(pipeline.session.last_pair)

    def _leave_out(self, tasks: Sequence[PairTask]) -> None:
        with self._answering:
            self._active().session.leave_out(tasks)

    def _use_rest(self) -> bool:
        """While no pair waits; whether there is more to do."""
        pipeline = self._pipeline
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
        if self._pipeline is None or self._pipeline.intake.offset_ns < _TUNING.apart_s * NANOSECONDS:
            return None
        frame = self._pipeline.intake.waiting_a
        return None if frame is self._begun else frame

    def _show(self) -> None:
        if self._pipeline is not None:
            self._view.show(self._pipeline)

    def _complain(self) -> None:
        if self._pipeline is not None:
            for problem in self._pipeline.problems.take():
                self.complaints.complain(problem.topic or "stream", problem.text, kind=kind_of(problem.text))
                if problem.topic in _IMAGE_INPUTS:
                    self._state_watch.timeout.add_problem(f"{problem.topic}: {problem.text}")
            for remark in self._pipeline.problems.take_remarks():
                self.complaints.inform(remark.topic, remark.text)

    @guarded
    def _on_look(self) -> None:
        pipeline = self._pipeline
        state = TrackerState.INACTIVE if pipeline is None or self._worker is None else pipeline.session.state
        self._start_unasked()
        before, self._silence = self._silence, self._state_watch.look(state)
        if kind_of(before) != kind_of(self._silence):
            self._on_state_change()

    def _on_state_change(self) -> None:
        if self._pipeline is not None and self._worker is not None:
            self._state_watch.log_change(self._told())
        self._publish_diagnostics()

    @guarded
    def _on_timer(self) -> None:
        self._publish_diagnostics()
        if self._tracker_services.board.pair is not None or self._silence:
            self._show()  # for viewers that come later, and with the time that has passed
        if self._pipeline is None or self._inputs is None or self._worker is None:
            return
        statistics = self._pipeline.statistics()
        complaints = self._watch.complaints(
            time.monotonic(),
            self._inputs.offers(),
            statistics.calibrated,
            statistics.pairing["a"].paired,
            statistics.waiting_clicks,
            self._worker.dropped,
        )
        for subject, text in complaints:
            self.complaints.complain(subject, text, kind=kind_of(text), period_s=_TUNING.stream_complaint_s)

    @guarded
    def _publish_diagnostics(self) -> None:
        name = self.get_fully_qualified_name()
        pipeline, worker, inputs = self._pipeline, self._worker, self._inputs
        if pipeline is None or worker is None or inputs is None:
            statuses = [tracker_status(name, TrackerState.INACTIVE)]
        else:
            statistics = self._told()
            age_s, posture = self._state_watch.pose_age_s, self._live.config.posture
            latencies = self._latencies.words()
            statuses = [tracker_status(name, statistics.state, statistics, worker.dropped, latencies, age_s, posture)]
            statuses += [plane_status(name, plane, statistics, inputs.reliable(plane), self._watch) for plane in PLANES]
            statuses += heartbeat_status(name, statistics)
        fields = {"header": {"stamp": self.get_clock().now().to_msg()}, "status": statuses}
        self._tracker_publishers.publish_fields(DIAGNOSTICS, fields)
