"""What the tracker node listens to, while it is active."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from geometry_msgs.msg import Point, PolygonStamped
from rclpy.node import Node
from rclpy.subscription import Subscription
from sensor_msgs.msg import CameraInfo, CompressedImage
from std_msgs.msg import Header

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.nodes.joint_inputs import JointInputs
from lasso_motion_ros.nodes.qos import qos
from lasso_motion_ros.nodes.subscriptions import CalibrationSubscription, SeedSubscription, image_subscription
from lasso_motion_ros.nodes.watch import Offer
from msg_adapters.input_bytes import ReadCameraInfo, ReadImage
from msg_adapters.topics import R_PEAK, camera_info_topic, click_topic, seed_topic

CALIBRATION_DEPTH = 32


@dataclass(frozen=True)
class InputCallbacks:
    """What is called with each message; all but `r_peak` get the plane first, `camera_info` whether it is latched."""

    image: Callable[[Plane, ReadImage | CompressedImage], None]
    camera_info: Callable[[Plane, ReadCameraInfo, bool], None]
    seed: Callable[[Plane, PolygonStamped], None]
    click: Callable[[Plane, Point], None]
    r_peak: Callable[[Header], None]


class TrackerInputs:
    """The subscriptions of an active tracker.

    Args:
        node: the node.
        config: how to subscribe.
        callbacks: what is called.
    """

    def __init__(self, node: Node, config: StreamConfig, callbacks: InputCallbacks) -> None:
        self._node = node
        self._joint = JointInputs(node)
        self._images = {
            plane: image_subscription(
                node,
                plane,
                partial(callbacks.image, plane),
                reliability=config.image_reliability,
                depth=config.image_depth,
                inputs=self._joint,
            )
            for plane in PLANES
        }
        self._infos = {
            plane: CalibrationSubscription(
                node,
                CameraInfo,
                camera_info_topic(plane).name,
                partial(callbacks.camera_info, plane),
                CALIBRATION_DEPTH,
                self._joint,
            )
            for plane in PLANES
        }
        self._others: list[Subscription] = [
            node.create_subscription(Header, R_PEAK.name, callbacks.r_peak, qos(depth=R_PEAK.depth, reliable=False))
        ]
        for plane in PLANES:
            click = click_topic(plane)
            profile = qos(depth=click.depth)
            self._others.append(node.create_subscription(Point, click.name, partial(callbacks.click, plane), profile))
        self._seeds = [
            SeedSubscription(node, PolygonStamped, topic.name, partial(callbacks.seed, plane), topic.depth)
            for plane in PLANES
            for topic in (seed_topic(plane),)
        ]

    def destroy(self) -> None:
        """Stop listening."""
        self._joint.destroy()
        for images in self._images.values():
            images.destroy()
        for infos in self._infos.values():
            infos.destroy()
        for seeds in self._seeds:
            seeds.destroy()
        for subscription in self._others:
            self._node.destroy_subscription(subscription)

    def reliable(self, plane: Plane) -> bool | None:
        """Whether a plane's images are subscribed reliably; None while nobody publishes them."""
        return self._images[plane].reliable if self._images[plane].publishers() else None

    def offers(self) -> dict[Plane, Offer]:
        """What is published on images and calibrations now."""
        return {plane: self._offer(plane) for plane in PLANES}

    def _offer(self, plane: Plane) -> Offer:
        publishers = self._images[plane].publishers()
        return Offer(
            image_publishers=tuple(sorted(publishers)),
            best_effort=tuple(sorted(name for name, reliable in publishers.items() if not reliable)),
            calibration_publishers=self._node.count_publishers(
                self._node.resolve_topic_name(camera_info_topic(plane).name)
            ),
            subscribed_reliably=self._images[plane].reliable,
        )
