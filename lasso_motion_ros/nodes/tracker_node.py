"""The tracker node: images, calibrations and clicks in, breathing motion out."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from geometry_msgs.msg import Point, PolygonStamped
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Header

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.compiled import arithmetic
from lasso_motion_ros.core.errors import ConfigurationError, LassoMotionError, TrackingError
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.initialisation.proposal import Proposal
from lasso_motion_ros.nodes.answering import TUNING, Answering
from lasso_motion_ros.nodes.clickless_start import ClicklessStart
from lasso_motion_ros.nodes.configured_node import ConfiguredNode
from lasso_motion_ros.nodes.kernels_aside import KernelsAside
from lasso_motion_ros.nodes.parameters import LiveParameters
from lasso_motion_ros.nodes.running import guarded
from lasso_motion_ros.nodes.state_watch import StateWatch
from lasso_motion_ros.nodes.steady_timer import steady_timer
from lasso_motion_ros.nodes.tf_extrinsics import tf_extrinsics
from lasso_motion_ros.nodes.tracker_inputs import InputCallbacks, TrackerInputs
from lasso_motion_ros.nodes.tracker_publishers import TrackerPublishers
from lasso_motion_ros.nodes.tracker_report import TrackerReport
from lasso_motion_ros.nodes.tracker_services import TrackerServices
from lasso_motion_ros.nodes.tracking_view import TrackingView
from lasso_motion_ros.stream.outputs import Output
from lasso_motion_ros.stream.pair_task import PairTask
from lasso_motion_ros.stream.pipeline import TrackingPipeline
from lasso_motion_ros.stream.warm_up import dry_run, warm_up
from lasso_motion_ros.tracking.tracker import TrackerState
from msg_adapters.input_bytes import ReadCameraInfo, ReadImage
from msg_adapters.messages import stamp_to_ns
from msg_adapters.seeds import read_seeds_file
from msg_adapters.topics import seed_topic

_LOOK_S = 0.1  # between two looks whether images still come and are answered
_DIAGNOSTICS_S = 1.0  # between two messages on /diagnostics


class TrackerNode(ConfiguredNode[StreamConfig], LifecycleNode):  # type: ignore[misc]
    """Wiring only: callbacks store and pair, one worker thread tracks the pairs and publishes.

    Raises:
        ConfigurationError: a parameter that is unknown, of the wrong type or out of range.
    """

    def __init__(self) -> None:
        super().__init__("lasso_tracker", StreamConfig)
        self._live = LiveParameters(self, self.declared, self._on_tuning)
        self._inputs: TrackerInputs | None = None
        self._warm = False
        self._tracker_publishers = TrackerPublishers(
            self, self.messages, self.complaints.error, self._on_state_change, self.declared
        )
        log = self.get_logger()
        self._kernels = KernelsAside(log.info, log.warning, lambda: dry_run(self._live.config, self.messages))
        self._state_watch = StateWatch(self._tracker_publishers, self.complaints, self._loss_outputs)
        self._answering = Answering(
            self._state_watch,
            lambda: int(self.get_clock().now().nanoseconds),
            self.complaints.error,
            self._on_worked,
            self._on_answered,
        )
        self._report = TrackerReport(
            self, self._answering, self._state_watch, self._tracker_publishers, lambda: self._live.config
        )
        self._tracker_publishers.publish_state(TrackerState.INACTIVE)
        self._tracker_services = TrackerServices(
            self, self._answering.active, self._enqueue, self._reset, self._set_reference, self._show
        )
        self._view = TrackingView(self._tracker_publishers, self._state_watch, self._tracker_services.board)
        self._clickless = ClicklessStart(
            self, self._tracker_publishers.publish_proposals, self._start_with, self.complaints.error
        )
        steady_timer(self, _DIAGNOSTICS_S, self._on_timer)
        steady_timer(self, _LOOK_S, self._on_look)

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
        self._answering.pipeline = TrackingPipeline(config, extrinsics=tf_extrinsics(self, config.world_frame))

    def _activate(self) -> None:
        pipeline, config = self._answering.pipeline, self._live.config
        if pipeline is None:
            raise TrackingError("the node must be configured before it is activated")
        self._answering.begin(config.seed_buffer_pairs)
        session = pipeline.session
        self._clickless.begin(config, lambda: session.state)
        self._report.begin()
        self._state_watch.begin(config.stream_timeout_s)
        self._by_arrival = config.stamp_source == "arrival"
        self._tracker_publishers.publish(pipeline.session.initial_outputs())
        for plane in PLANES:
            if plane in self._seeds:
                self._on_seed(plane, self.messages.make(seed_topic(plane).type_name, self._seeds[plane]))
        callbacks = InputCallbacks(self._on_image, self._on_camera_info, self._on_seed, self._on_click, self._on_r_peak)
        self._inputs = self._report.inputs = TrackerInputs(self, config, callbacks)

    def _deactivate(self) -> None:
        if self._inputs is not None:
            self._inputs.destroy()
            self._inputs = self._report.inputs = None
        self._clickless.end(TUNING.patience_s)
        if not self._answering.end():
            self.get_logger().error("the tracker hangs in a pair and is left behind: configure the node anew")
        self._state_watch.end()
        if self._answering.pipeline is not None:
            self._answering.pipeline.intake.release()
        self._tracker_services.give_up("the node is not active")
        self._tracker_publishers.publish_state(TrackerState.INACTIVE)

    def _forget(self) -> None:
        self._deactivate()
        self._answering.pipeline = None

    @guarded
    def _on_image(self, plane: Plane, message: ReadImage | CompressedImage) -> None:
        self._view.name_frame(plane, message.header.frame_id)
        if self._by_arrival:
            message.header.stamp = self.get_clock().now().to_msg()
        pipeline = self._answering.active()
        tasks = pipeline.intake.add_image(plane, message)
        if plane in pipeline.intake.held:
            self._report.watch.add_held(plane, time.monotonic_ns())
            self._state_watch.timeout.add_held(time.monotonic())
        else:
            stamp = pipeline.intake.sources[plane].exposure_ns(stamp_to_ns(message.header.stamp))
            self._report.watch.add_image(plane, stamp, time.monotonic_ns())
            self._state_watch.timeout.add_image(plane, time.monotonic())
        self._enqueue(tasks)
        self._view.add_image(pipeline, plane, message)

    @guarded
    def _on_camera_info(self, plane: Plane, message: ReadCameraInfo, latched: bool) -> None:
        if self._by_arrival:
            message.header.stamp.sec = message.header.stamp.nanosec = 0  # holds until the next
        pipeline = self._answering.active()
        self._enqueue(pipeline.intake.add_camera_info(plane, message, latched=latched))
        if self._tracker_publishers.state == TrackerState.WAITING_FOR_CALIBRATION.value:
            with self._answering.between_answers():
                self._tracker_publishers.publish(pipeline.pending_outputs())

    @guarded
    def _on_seed(self, plane: Plane, message: PolygonStamped) -> None:
        self._enqueue(self._answering.active().intake.add_seed(plane, message))

    @guarded
    def _on_click(self, plane: Plane, message: Point) -> None:
        self._tracker_services.board.click(plane, message.x, message.y)
        self._show()

    @guarded
    def _on_r_peak(self, message: Header) -> None:
        self._answering.active().intake.add_r_peak(message)

    def _on_tuning(self, config: StreamConfig) -> None:
        if (pipeline := self._answering.pipeline) is not None:
            with self._answering.between_answers():
                pipeline.session.reconfigure(config)
        self._state_watch.timeout.reconfigure(config.stream_timeout_s)
        self._clickless.reconfigure(config)

    def _start_with(self, ring: Proposal) -> None:
        self._enqueue([self._answering.active().intake.seed_pair(ring.pair, ring.seed)])

    def _reset(self) -> None:
        pipeline = self._answering.active()
        with self._answering.between_answers():
            self._clickless.reset()
            self._answering.clear()
            self._state_watch.timeout.forget()
            self._tracker_publishers.publish(pipeline.reset())

    def _set_reference(self) -> None:
        session = self._answering.active().session
        with self._answering.between_answers():
            told = self._report.told()
            if told.state is not session.state:
                raise TrackingError(f"there is no present phase to refer to: {told.reason}")
            session.set_reference()

    def _loss_outputs(self) -> list[Output]:
        return self._answering.active().session.loss_outputs()

    def _enqueue(self, tasks: Sequence[PairTask]) -> None:
        if any(task.seed is not None for task in tasks):
            self._clickless.overtake()
        self._answering.enqueue(tasks)
        self._report.complain()

    def _on_worked(self, task: PairTask, refusal: str) -> None:
        self._tracker_services.seeded(task, refusal)
        if task.seed is not None:
            self._report.publish()  # whoever clicked waits for the answer

    def _on_answered(self, task: PairTask) -> None:
        self._report.complain()
        if task.seed is None:  # else its pair is one of the past
            self._clickless.add(task.pair)
        self._show()
        if (pipeline := self._answering.pipeline) is not None:
            self._tracker_publishers.show_standard(pipeline.session.last_pair)

    def _on_state_change(self) -> None:
        self._report.tell_change()

    def _show(self) -> None:
        if (pipeline := self._answering.pipeline) is not None:
            self._view.show(pipeline)

    @guarded
    def _on_look(self) -> None:
        if self._clickless.is_due:  # started with here, where pairs are numbered; if not now, at the next look
            self._answering.if_free(self._clickless.start_unasked)
        self._report.look()

    @guarded
    def _on_timer(self) -> None:
        self._report.publish()
        if self._tracker_services.board.pair is not None or self._report.silence:
            self._show()  # for viewers that come later, and with the time that has passed
        self._report.complain_of_stream()
