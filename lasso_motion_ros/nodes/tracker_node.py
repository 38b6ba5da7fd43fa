"""The tracker node: images, calibrations and clicks in, breathing motion out."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import PolygonStamped
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.publisher import Publisher
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from lasso_motion_ros.configuration import ProductConfig
from lasso_motion_ros.errors import ConfigurationError, LassoMotionError
from lasso_motion_ros.frames import PLANES, Plane
from lasso_motion_ros.nodes.parameters import current_configuration, declare_configuration
from lasso_motion_ros.nodes.qos import qos
from lasso_motion_ros.nodes.running import guarded
from lasso_motion_ros.nodes.subscriptions import CalibrationSubscription, OfferedSubscription
from lasso_motion_ros.nodes.worker import Worker
from lasso_motion_ros.pipeline import ReadyPair, TrackingPipeline
from lasso_motion_ros.tracker import TrackerState
from msg_adapters.messages import RosMessages
from msg_adapters.topics import (
    DIAGNOSTICS,
    OUTPUTS,
    R_PEAK,
    camera_info_topic,
    image_topic,
    seed_topic,
    tracking_topic,
)

WAITING_PAIRS = 8
"""Pairs that may wait for the tracker: half a second at 15 pairs/s, about what building the model takes."""
DIAGNOSTICS_PERIOD_S = 1.0
CALIBRATION_DEPTH = 32


class TrackerNode(LifecycleNode):  # type: ignore[misc]
    """Wiring only: callbacks store and pair, one worker thread tracks the pairs and publishes.

    State and reference come from ordinary publishers that live as long as the node, so that INACTIVE is seen too.

    Raises:
        ConfigurationError: a parameter that is unknown, of the wrong type or out of range.
    """

    def __init__(self) -> None:
        super().__init__("lasso_tracker", automatically_declare_parameters_from_overrides=True)
        self._config = declare_configuration(self, ProductConfig)
        self._messages = RosMessages()
        self._outlets: dict[str, Publisher] = {
            topic.name: self._publisher(topic)
            for topic in (*OUTPUTS, DIAGNOSTICS, *(tracking_topic(plane) for plane in PLANES))
        }
        self._pipeline: TrackingPipeline | None = None
        self._worker: Worker[ReadyPair] | None = None
        self._images: dict[Plane, OfferedSubscription] = {}
        self._inputs: list[Any] = []
        self._lock = threading.Lock()
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
        assert pipeline is not None  # the life cycle configures before it activates
        self._worker = Worker(self._track, WAITING_PAIRS, self._on_worker_error, "tracker")
        self._publish(pipeline.initial_outputs())
        for plane in PLANES:
            calibration, image, seed = camera_info_topic(plane), image_topic(plane), seed_topic(plane)
            self._inputs.append(
                CalibrationSubscription(
                    self, CameraInfo, calibration.name, self._plane(self._on_camera_info, plane), CALIBRATION_DEPTH
                )
            )
            self._inputs.append(
                self.create_subscription(
                    PolygonStamped, seed.name, self._plane(self._on_seed, plane), qos(depth=seed.depth)
                )
            )
            self._images[plane] = OfferedSubscription(
                self,
                Image,
                image.name,
                self._plane(self._on_image, plane),
                config.image_reliability,
                config.image_depth,
            )
        self._inputs.append(
            self.create_subscription(Header, R_PEAK.name, self._on_r_peak, qos(depth=R_PEAK.depth, reliable=False))
        )

    def _deactivate(self) -> None:
        for plane_images in self._images.values():
            plane_images.destroy()
        for one in self._inputs:
            one.destroy()
        self._images.clear()
        self._inputs.clear()
        if self._worker is not None:
            self._worker.stop()
            self._worker = None
        self._say_state(TrackerState.INACTIVE)

    def _forget(self) -> None:
        self._deactivate()
        self._pipeline = None

    def _plane(self, callback: Callable[[Plane, Any], None], plane: Plane) -> Callable[[Any], None]:
        return lambda message: callback(plane, message)

    @guarded
    def _on_image(self, plane: Plane, message: Image) -> None:
        self._enqueue(self._require().add_image(plane, message))

    @guarded
    def _on_camera_info(self, plane: Plane, message: CameraInfo) -> None:
        self._enqueue(self._require().add_camera_info(plane, message))

    @guarded
    def _on_seed(self, plane: Plane, message: PolygonStamped) -> None:
        self._enqueue(self._require().add_seed(plane, message))

    @guarded
    def _on_r_peak(self, message: Header) -> None:
        self._require().add_r_peak(message)

    @guarded
    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return self._on_service(response, lambda pipeline: pipeline.reset())

    @guarded
    def _on_set_reference(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return self._on_service(response, lambda pipeline: pipeline.set_reference())
