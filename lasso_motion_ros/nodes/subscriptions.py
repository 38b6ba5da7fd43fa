"""Subscriptions that hear whatever a publisher offers: reliable or best effort, latched or not."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.nodes.joint_inputs import JointInputs
from lasso_motion_ros.nodes.qos import offered_reliably, qos
from msg_adapters.input_bytes import READERS
from msg_adapters.topics import compressed_image_topic, image_topic

REMEMBERED = 32  # messages of which a second hearing is known as such; latched ones are few


class OfferedSubscription:
    """Subscribes as reliably as the publishers of the topic offer, once one is discovered.

    No fixed choice fits everybody: a reliable subscription never matches a best-effort publisher, and a best-effort one
    loses images of a reliable publisher. It subscribes anew when other publishers appear.

    Args:
        node: the node.
        message_type: class of the messages. Images and calibrations come as `ReadImage` and `ReadCameraInfo`.
        topic: name, relative or absolute, before remapping.
        callback: called with each message.
        reliability: `auto`, or `reliable` or `best_effort` to have it fixed and at once.
        depth: of the queue.
        instead: class and name of another topic with the same content, heard while nobody publishes on the first.
        inputs: those that this one belongs to.
    """

    def __init__(
        self,
        node: Node,
        message_type: type,
        topic: str,
        callback: Callable[[Any], None],
        *,
        reliability: str,
        depth: int,
        inputs: JointInputs,
        instead: tuple[type, str] | None = None,
    ) -> None:
        self._node, self._inputs = node, inputs
        self._types = {topic: message_type} | ({} if instead is None else {instead[1]: instead[0]})
        self._callback = callback
        self._depth = depth
        self._subscription: Subscription | None = None
        self._topic, self._reliable = topic, None if reliability == "auto" else reliability == "reliable"
        self._by_offer = reliability == "auto"
        self._said = ""
        if self._reliable is not None:
            self._subscribe(topic, self._reliable)
        if self._by_offer or instead is not None:
            inputs.look_for(self._discover)
            self._discover()

    @property
    def reliable(self) -> bool | None:
        """Whether it is subscribed reliably; None while no publisher is known."""
        return self._reliable

    def publishers(self) -> dict[str, bool]:
        """The nodes that publish on the topic that is heard, and whether reliably."""
        return {
            f"{offer.node_namespace.rstrip('/')}/{offer.node_name}": bool(offered_reliably([offer.qos_profile]))
            for offer in self._offers(self._topic)
        }

    def destroy(self) -> None:
        """Stop listening, once its publishers are not looked for any more."""
        self._unsubscribe()

    def _unsubscribe(self) -> None:
        if self._subscription is not None:
            self._inputs.remove(self._subscription)
            self._node.destroy_subscription(self._subscription)

    def _offers(self, topic: str) -> list[Any]:
        type_name = _type_name(self._types[topic])
        offers = self._node.get_publishers_info_by_topic(self._node.resolve_topic_name(topic))
        return [offer for offer in offers if offer.topic_type == type_name]

    def _discover(self) -> None:
        offered = {
            topic: reliable
            for topic in self._types
            if (reliable := offered_reliably(offer.qos_profile for offer in self._offers(topic))) is not None
        }
        if not offered:
            return
        topic, *others = offered
        reliable = offered[topic] if self._by_offer else bool(self._reliable)
        if (topic, reliable) != (self._topic, self._reliable) or self._subscription is None:
            self._subscribe(topic, reliable)
        self._say_which(topic, others)

    def _say_which(self, topic: str, others: list[str]) -> None:
        """Say once which of the topics is heard, where that goes without saying no more."""
        first = next(iter(self._types))
        said = f"heard, and not {others[0]}" if others else f"heard, since nobody publishes {first}"
        if (others or topic != first) and said != self._said:
            self._said = said
            self._node.get_logger().info(f"{topic} is {said}")

    def _subscribe(self, topic: str, reliable: bool) -> None:
        self._unsubscribe()
        self._topic, self._reliable = topic, reliable
        # What asks for what is offered is never told that it asks for too much: see `topic_publisher`.
        events = SubscriptionEventCallbacks(use_default_callbacks=not self._by_offer)
        profile, kind = qos(depth=self._depth, reliable=reliable), self._types[topic]
        self._subscription = _subscribed(self._node, kind, topic, self._callback, profile, events, self._inputs)


def _subscribed(
    node: Node,
    message_type: type,
    topic: str,
    callback: Callable[[Any], None],
    profile: QoSProfile,
    events: SubscriptionEventCallbacks,
    inputs: JointInputs | None,
) -> Subscription:
    """A subscription; images and calibrations are taken as bytes, and read without rclpy's copies."""
    read = READERS.get(_type_name(message_type))
    is_raw, is_calibration = read is not None, message_type is CameraInfo

    def take(message: Any) -> None:
        callback(message if read is None else read(message))
        if inputs is not None and not is_calibration:
            inputs.take_calibrations()

    subscription = node.create_subscription(message_type, topic, take, profile, event_callbacks=events, raw=is_raw)
    if inputs is not None and is_calibration:
        inputs.add_calibration(subscription, take)
    return subscription


def _type_name(message_type: type) -> str:
    return f"{message_type.__module__.partition('.')[0]}/msg/{message_type.__name__}"


def image_subscription(
    node: Node,
    plane: Plane,
    callback: Callable[[Any], None],
    *,
    reliability: str,
    depth: int,
    inputs: JointInputs,
) -> OfferedSubscription:
    """Hears a plane's images, raw where they are published raw, else compressed as image_transport does it.

    Args:
        node: the node.
        plane: `a` or `b`.
        callback: called with each image, as `ReadImage` or CompressedImage.
        reliability: as for `OfferedSubscription`.
        depth: of the queue.
        inputs: likewise.
    """
    raw, compressed = image_topic(plane).name, compressed_image_topic(plane).name
    if node.resolve_topic_name(compressed) == node.resolve_topic_name(compressed, only_expand=True):
        # Not remapped itself: as in image_transport it then follows the raw topic, wherever that is remapped to.
        compressed = node.resolve_topic_name(raw) + compressed.removeprefix(raw)
    return OfferedSubscription(
        node,
        Image,
        raw,
        callback,
        reliability=reliability,
        depth=depth,
        instead=(CompressedImage, compressed),
        inputs=inputs,
    )


class CalibrationSubscription:
    """Hears a calibration that comes with every frame as well as one that is latched.

    A volatile subscription misses what was latched before it existed, and a latched one never matches a volatile
    publisher, so there are two. What both hear arrives twice, which does a calibration no harm.

    Args:
        node: the node.
        message_type: sensor_msgs/msg/CameraInfo.
        topic: name, relative or absolute, before remapping.
        callback: called with each message, and whether it is known to come from a publisher that latches.
        depth: of the queues.
        inputs: those that this one belongs to.
    """

    def __init__(
        self,
        node: Node,
        message_type: type,
        topic: str,
        callback: Callable[[Any, bool], None],
        depth: int,
        inputs: JointInputs,
    ) -> None:
        self._node = node
        self._per_frame = OfferedSubscription(
            node,
            message_type,
            topic,
            lambda message: callback(message, False),
            reliability="auto",
            depth=depth,
            inputs=inputs,
        )
        # It is meant not to match a volatile publisher: no warning about that.
        self._latched = _subscribed(
            node,
            message_type,
            topic,
            lambda message: callback(message, True),
            qos(depth=depth, latched=True),
            SubscriptionEventCallbacks(use_default_callbacks=False),
            None,  # it comes once, and is in no haste
        )

    def destroy(self) -> None:
        """Stop listening."""
        self._per_frame.destroy()
        self._node.destroy_subscription(self._latched)


class SeedSubscription:
    """Hears clicks from publishers that latch them and from those that do not, each message once.

    Two subscriptions, as `CalibrationSubscription` has; a seed that came twice would begin the track anew. Clicks
    without a stamp are for the next picture: latched ones from before this subscription are of one that has gone by.

    Args:
        node: the node.
        message_type: geometry_msgs/msg/PolygonStamped.
        topic: name, relative or absolute, before remapping.
        callback: called with each message.
        depth: of the queues.
    """

    def __init__(self, node: Node, message_type: type, topic: str, callback: Callable[[Any], None], depth: int) -> None:
        self._node = node
        self._callback = callback
        self._heard: deque[tuple[int, int]] = deque(maxlen=REMEMBERED)
        self._topic, self._since_ns = topic, time.time_ns()  # by the clock of the messages' source stamps
        quiet = SubscriptionEventCallbacks(use_default_callbacks=False)
        self._subscriptions = [
            node.create_subscription(
                message_type, topic, callback, qos(depth=depth, latched=latched), event_callbacks=events
            )
            for latched, callback, events in ((False, self._on_message, None), (True, self._on_latched, quiet))
        ]

    def destroy(self) -> None:
        """Stop listening."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)

    def _on_latched(self, message: Any, information: dict[str, Any]) -> None:
        stamp = message.header.stamp
        if stamp.sec or stamp.nanosec or int(information["source_timestamp"]) >= self._since_ns:
            self._on_message(message, information)
        else:
            text = f"{self._topic}: clicks without a stamp, latched before this node listened, are left out"
            self._node.get_logger().warning(text)

    def _on_message(self, message: Any, information: dict[str, Any]) -> None:
        mark = int(information["source_timestamp"]), int(information["publication_sequence_number"] or 0)
        if mark not in self._heard:
            self._heard.append(mark)
            self._callback(message)
