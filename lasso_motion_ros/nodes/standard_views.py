"""What other tools draw with: /tf, and each plane's film with a plain camera."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt
from rclpy.node import Node
from rclpy.publisher import Publisher

from lasso_motion_ros.core.errors import MessageError
from lasso_motion_ros.geometry.frames import PLANES, Frame, Plane
from lasso_motion_ros.geometry.standard_camera import standard_camera
from lasso_motion_ros.geometry.transforms import inverse
from lasso_motion_ros.nodes.qos import topic_publisher
from lasso_motion_ros.nodes.worker import Worker
from msg_adapters.calibrations import encode_plain_camera
from msg_adapters.images import encode_image
from msg_adapters.messages import MessageFactory, header_fields
from msg_adapters.poses import encode_transform_stamped
from msg_adapters.topics import TF, standard_camera_info_topic, standard_image_topic

Array = npt.NDArray[np.float64]


def optical_frame(plane: Plane) -> str:
    """The frame of a plane's plain camera: +x right, +y down, +z from the source to the detector."""
    return f"plane_{plane}_standard_optical"


class TransformPublisher:
    """Publishes on /tf, where `tf2_msgs` is installed; else it says so once and does nothing.

    Args:
        node: the node.
        messages: makes the messages.
        wanted: whether /tf is to be published.
    """

    def __init__(self, node: Node, messages: MessageFactory, wanted: bool) -> None:
        self._messages = messages
        self._publisher: Publisher | None = None
        if wanted:
            try:
                self._publisher = topic_publisher(node, messages, TF)
            except MessageError:
                node.get_logger().info("tf2_msgs is not installed: nothing is published on /tf")

    @property
    def is_active(self) -> bool:
        """Whether anything is published."""
        return self._publisher is not None

    def publish(self, stamp_ns: int, parent: str, child: str, transform: Array) -> None:
        """Say where a frame is: x_parent = T · x_child, (4, 4), metres."""
        if self._publisher is not None:
            fields = encode_transform_stamped(transform, header_fields(stamp_ns, parent), child)
            self._publisher.publish(self._messages.make(TF.type_name, {"transforms": [fields]}))


class StandardViews:
    """Publishes each plane's film with a plain camera, while somebody subscribes, in a thread of its own.

    Args:
        node: the node.
        messages: makes the messages.
        transforms: takes the cameras' frames.
        world_frame: in which they are.
        on_error: takes what went wrong.
    """

    def __init__(
        self,
        node: Node,
        messages: MessageFactory,
        transforms: TransformPublisher,
        world_frame: str,
        on_error: Callable[[Exception], None],
    ) -> None:
        self._messages, self._transforms, self._world_frame = messages, transforms, world_frame
        self._images = {plane: topic_publisher(node, messages, standard_image_topic(plane)) for plane in PLANES}
        self._infos = {plane: topic_publisher(node, messages, standard_camera_info_topic(plane)) for plane in PLANES}
        self._worker: Worker[Mapping[Plane, Frame]] = Worker(
            self._publish, capacity=1, burst_capacity=1, takes_long=lambda _: False, on_error=on_error, name="standard"
        )

    def show(self, frames: Mapping[Plane, Frame]) -> None:
        """Have a pair published, if somebody looks; does not wait."""
        if any(self._watched(plane) for plane in frames):
            self._worker.put([frames])

    def close(self) -> None:
        """End the thread."""
        self._worker.stop()

    def _watched(self, plane: Plane) -> bool:
        publishers = (self._images[plane], self._infos[plane])
        return any(publisher.get_subscription_count() > 0 for publisher in publishers)

    def _publish(self, frames: Mapping[Plane, Frame]) -> None:
        for plane, frame in frames.items():
            if not self._watched(plane):
                continue
            camera, name = standard_camera(frame.projection), optical_frame(plane)
            # The frame first: whoever draws looks it up when the image has come.
            self._transforms.publish(frame.stamp_ns, self._world_frame, name, inverse(camera.pose))
            header = header_fields(frame.stamp_ns, name)
            topic = standard_camera_info_topic(plane)
            fields = encode_plain_camera(camera.k, frame.projection.width, frame.projection.height, header)
            self._infos[plane].publish(self._messages.make(topic.type_name, fields))
            if self._images[plane].get_subscription_count() > 0:
                image = encode_image(camera.image(frame.pixels), header)
                self._images[plane].publish(self._messages.make(standard_image_topic(plane).type_name, image))
