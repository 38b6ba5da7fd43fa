"""Both planes' images, calibrations and overlays, for the nodes that only watch."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.subscription import Subscription
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.nodes.joint_inputs import JointInputs
from lasso_motion_ros.nodes.qos import IMAGE_DEPTH, qos
from lasso_motion_ros.nodes.subscriptions import CalibrationSubscription, image_subscription
from msg_adapters.topics import camera_info_topic, overlay_drawn_topic, overlay_topic

CALIBRATION_DEPTH = 32
DRAWN_DEPTH = 10


class PlaneInputs:
    """The subscriptions, as reliable as what is offered; keep the object as long as the node listens.

    Args:
        node: the node.
        on_image: called with each plane's images.
        on_camera_info: called with each plane's calibrations, and whether they are known to be latched.
    """

    def __init__(
        self, node: Node, on_image: Callable[[Plane, Any], None], on_camera_info: Callable[[Plane, Any, bool], None]
    ) -> None:
        inputs = JointInputs(node)
        self._infos = [
            CalibrationSubscription(
                node,
                CameraInfo,
                camera_info_topic(plane).name,
                partial(on_camera_info, plane),
                CALIBRATION_DEPTH,
                inputs,
            )
            for plane in PLANES
        ]
        self._images = [
            image_subscription(
                node, plane, partial(on_image, plane), reliability="auto", depth=IMAGE_DEPTH, inputs=inputs
            )
            for plane in PLANES
        ]


class OverlayInputs:
    """Both planes' overlays, listened to only while somebody looks: the overlay node draws for listeners alone.

    Args:
        node: the node.
        on_overlay: called with each plane's pictures.
        on_drawn: called with what each of them is.
    """

    def __init__(
        self, node: Node, on_overlay: Callable[[Plane, Any], None], on_drawn: Callable[[Plane, Any], None]
    ) -> None:
        self._node, self._on_overlay, self._on_drawn = node, on_overlay, on_drawn
        self._subscriptions: list[Subscription] = []

    def listen(self, wanted: bool) -> None:
        """Begin to listen, or end it."""
        if wanted and not self._subscriptions:
            create = self._node.create_subscription
            for plane in PLANES:
                drawn, name = partial(self._on_drawn, plane), overlay_drawn_topic(plane).name
                self._subscriptions.append(create(Header, name, drawn, qos(depth=DRAWN_DEPTH)))
                picture, name = partial(self._on_overlay, plane), overlay_topic(plane).name
                self._subscriptions.append(create(Image, name, picture, qos(depth=1)))
        elif not wanted:
            for one in self._subscriptions:
                self._node.destroy_subscription(one)
            self._subscriptions = []
