"""The tracker node: images, calibrations and clicks in, breathing motion out."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from geometry_msgs.msg import PolygonStamped
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.publisher import Publisher
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from lasso_motion_ros.configuration import ProductConfig
from lasso_motion_ros.errors import ConfigurationError, LassoMotionError, TrackingError
from lasso_motion_ros.frames import PLANES, Plane
from lasso_motion_ros.nodes.diagnostics import heartbeat_status, plane_status, tracker_status
from lasso_motion_ros.nodes.parameters import current_configuration, declare_configuration
from lasso_motion_ros.nodes.qos import qos
from lasso_motion_ros.nodes.running import ThrottledLog, guarded
from lasso_motion_ros.nodes.subscriptions import CalibrationSubscription, OfferedSubscription
from lasso_motion_ros.nodes.worker import Worker
from lasso_motion_ros.pipeline import Output, PipelineStatistics, ReadyPair, TrackingPipeline
from lasso_motion_ros.rendering.tracking_view import draw_tracking
from lasso_motion_ros.tracker import TrackerState
from msg_adapters.images import encode_image
from msg_adapters.messages import RosMessages, header_fields
from msg_adapters.topics import (
    DIAGNOSTICS,
    IMAGE_TYPE,
    OUTPUTS,
    R_PEAK,
    STATE,
    Topic,
    camera_info_topic,
    image_topic,
    seed_topic,
    tracking_topic,
)

WAITING_PAIRS = 8
"""Pairs that may wait for the tracker: half a second at 15 pairs/s."""
DIAGNOSTICS_PERIOD_S = 1.0
CALIBRATION_DEPTH = 32


@dataclass(frozen=True)
class _Received:
    """A pair, and when (steady clock, seconds) the last of its images had come."""

    ready: ReadyPair
    at_s: float


class TrackerNode(LifecycleNode):  # type: ignore[misc]
    """Wiring only: callbacks store and pair, one worker thread tracks the pairs and publishes.

    State and reference come from ordinary publishers that live as long as the node, so that INACTIVE is seen too.

    Raises:
        ConfigurationError: a parameter that is unknown, of the wrong type or out of range.
    """

    def __init__(self) -> None:
        super().__init__("lasso_tracker", automatically_declare_parameters_from_overrides=True)
        self.complaints = ThrottledLog(self.get_logger())
        self._config = declare_configuration(self, ProductConfig)
        self._messages = RosMessages()
        self._outlets: dict[str, Publisher] = {
            topic.name: self._publisher(topic)
            for topic in (*OUTPUTS, DIAGNOSTICS, *(tracking_topic(plane) for plane in PLANES))
        }
        self._pipeline: TrackingPipeline | None = None
        self._worker: Worker[_Received] | None = None
        self._images: dict[Plane, OfferedSubscription] = {}
        self._inputs: list[Any] = []
        self._frame_ids: dict[Plane, str] = {}
        self._latency_s: float | None = None
        self._state = ""
        self._say_state(TrackerState.INACTIVE)
        self.create_timer(DIAGNOSTICS_PERIOD_S, self._publish_diagnostics)
        self.create_service(Trigger, "~/reset", self._on_reset)
        self.create_service(Trigger, "~/set_reference", self._on_set_reference)

    def start(self) -> None:
        """Configure and activate, if `autostart` says so.

        Raises:
            ConfigurationError: with these parameters the node cannot work.
        """
        if not self._config.autostart:
            return
        if self.trigger_configure() != TransitionCallbackReturn.SUCCESS:
            raise ConfigurationError("the node could not be configured")
        if self.trigger_activate() != TransitionCallbackReturn.SUCCESS:
            raise ConfigurationError("the node could not be activated")

    def close(self) -> None:
        """Stop the worker and say INACTIVE, while there still is a publisher to say it."""
        self._deactivate()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Build the tracker from the parameters as they stand now."""
        return self._transition(self._configure)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Listen, and start the worker."""
        return self._transition(self._activate)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop listening and working; the model is kept."""
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
        self._config = current_configuration(self, ProductConfig)
        self._pipeline = TrackingPipeline(self._config, self._messages)

    def _activate(self) -> None:
        pipeline, config = self._pipeline, self._config
        if pipeline is None:
            raise TrackingError("the node must be configured before it is activated")
        self._worker = Worker(
            self._track,
            capacity=WAITING_PAIRS,
            # A model is built, all pairs since the clicked one are gone through, and new ones come meanwhile.
            burst_capacity=config.seed_buffer_pairs,
            takes_long=lambda received: received.ready.seed is not None,
            on_error=self.complaints.error,
            name="tracker",
        )
        self._publish(pipeline.initial_outputs())
        for plane in PLANES:
            info, image, seed = camera_info_topic(plane).name, image_topic(plane).name, seed_topic(plane)
            on_info, on_image, on_seed = (
                partial(callback, plane) for callback in (self._on_camera_info, self._on_image, self._on_seed)
            )
            self._images[plane] = OfferedSubscription(
                self, Image, image, on_image, reliability=config.image_reliability, depth=config.image_depth
            )
            self._inputs += [
                CalibrationSubscription(self, CameraInfo, info, on_info, CALIBRATION_DEPTH),
                self.create_subscription(PolygonStamped, seed.name, on_seed, qos(depth=seed.depth)),
            ]
        self._inputs.append(
            self.create_subscription(Header, R_PEAK.name, self._on_r_peak, qos(depth=R_PEAK.depth, reliable=False))
        )

    def _deactivate(self) -> None:
        for plane_images in self._images.values():
            plane_images.destroy()
        for one in self._inputs:
            if isinstance(one, CalibrationSubscription):
                one.destroy()
            else:
                self.destroy_subscription(one)
        self._images.clear()
        self._inputs.clear()
        if self._worker is not None:
            self._worker.stop()
            self._worker = None
        self._say_state(TrackerState.INACTIVE)

    def _forget(self) -> None:
        self._deactivate()
        self._pipeline = None

    @guarded
    def _on_image(self, plane: Plane, message: Image) -> None:
        self._frame_ids[plane] = message.header.frame_id
        self._enqueue(self._active().add_image(plane, message))

    @guarded
    def _on_camera_info(self, plane: Plane, message: CameraInfo) -> None:
        pipeline = self._active()
        self._enqueue(pipeline.add_camera_info(plane, message))
        if self._state == TrackerState.WAITING_FOR_CALIBRATION.value:
            self._publish(pipeline.pending_outputs())

    @guarded
    def _on_seed(self, plane: Plane, message: PolygonStamped) -> None:
        self._enqueue(self._active().add_seed(plane, message))

    @guarded
    def _on_r_peak(self, message: Header) -> None:
        self._active().add_r_peak(message)

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return self._answer(response, self._reset)

    def _on_set_reference(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return self._answer(response, lambda: self._active().set_reference())

    def _answer(self, response: Trigger.Response, action: Callable[[], None]) -> Trigger.Response:
        try:
            action()
            response.success = True
        except LassoMotionError as error:
            response.success, response.message = False, str(error)
        return response

    def _reset(self) -> None:
        pipeline = self._active()
        if self._worker is not None:
            self._worker.clear()
        self._publish(pipeline.reset())

    def _active(self) -> TrackingPipeline:
        if self._pipeline is None or self._worker is None:
            raise TrackingError("the node is not active")
        return self._pipeline

    def _enqueue(self, pairs: Sequence[ReadyPair]) -> None:
        if pairs and self._worker is not None:
            self._worker.put([_Received(pair, time.monotonic()) for pair in pairs])
        self._complain()

    def _track(self, received: _Received) -> None:
        pipeline = self._active()
        self._publish(pipeline.process(received.ready))
        self._latency_s = time.monotonic() - received.at_s
        self._complain()
        if not received.ready.answered and self._worker is not None and self._worker.waiting == 0:
            self._publish_pictures(pipeline, received.ready)

    def _publish(self, outputs: Iterable[Output]) -> None:
        changed = False
        for output in outputs:
            if output.topic is STATE:
                changed = changed or output.message.data != self._state
                self._state = output.message.data
            self._outlets[output.topic.name].publish(output.message)
        if changed:
            self._publish_diagnostics()

    def _publish_pictures(self, pipeline: TrackingPipeline, ready: ReadyPair) -> None:
        statistics: PipelineStatistics | None = None
        for plane in PLANES:
            outlet, frame = self._outlets[tracking_topic(plane).name], ready.pair.frame(plane)
            if frame is None or outlet.get_subscription_count() == 0:
                continue
            statistics = statistics or pipeline.statistics()
            loop = None if pipeline.last_result is None else pipeline.last_result.loop
            picture = draw_tracking(frame, loop, statistics.state, statistics.reason)
            fields = encode_image(picture, header_fields(frame.stamp_ns, self._frame_ids[plane]))
            outlet.publish(self._messages.make(IMAGE_TYPE, fields))

    def _complain(self) -> None:
        if self._pipeline is not None:
            for problem in self._pipeline.take_problems():
                self.complaints.complain(problem.topic or "stream", problem.text)

    def _say_state(self, state: TrackerState) -> None:
        if state.value != self._state:
            self._state = state.value
            self._outlets[STATE.name].publish(self._messages.make(STATE.type_name, {"data": state.value}))
            self._publish_diagnostics()

    @guarded
    def _publish_diagnostics(self) -> None:
        name = self.get_fully_qualified_name()
        statistics = None if self._pipeline is None or self._worker is None else self._pipeline.statistics()
        if statistics is None:
            statuses = [tracker_status(name, TrackerState.INACTIVE)]
        else:
            dropped = 0 if self._worker is None else self._worker.dropped
            statuses = [tracker_status(name, statistics.state, statistics, dropped, self._latency_s)]
            statuses += [
                plane_status(name, plane, statistics, self._images[plane].reliable)
                for plane in PLANES
                if plane in self._images
            ]
            statuses += heartbeat_status(name, statistics)
        fields = {"header": {"stamp": self.get_clock().now().to_msg()}, "status": statuses}
        self._outlets[DIAGNOSTICS.name].publish(self._messages.make(DIAGNOSTICS.type_name, fields))

    def _publisher(self, topic: Topic) -> Publisher:
        message_class = type(self._messages.make(topic.type_name, {}))
        return self.create_publisher(message_class, topic.name, qos(depth=topic.depth, latched=topic.latched))
