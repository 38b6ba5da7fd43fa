"""Both planes' images and calibrations, for the nodes that only watch."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, Image

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.nodes.qos import IMAGE_DEPTH
from lasso_motion_ros.nodes.subscriptions import CalibrationSubscription, OfferedSubscription
from msg_adapters.topics import camera_info_topic, image_topic

CALIBRATION_DEPTH = 32


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
        self._infos = [
            CalibrationSubscription(
                node, CameraInfo, camera_info_topic(plane).name, partial(on_camera_info, plane), CALIBRATION_DEPTH
            )
            for plane in PLANES
        ]
        self._images = [
            OfferedSubscription(
                node, Image, image_topic(plane).name, partial(on_image, plane), reliability="auto", depth=IMAGE_DEPTH
            )
            for plane in PLANES
        ]
