"""Subscriptions that hear whatever a publisher offers: reliable or best effort, latched or not."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.subscription import Subscription

from lasso_motion_ros.nodes.qos import offered_reliably, qos
from lasso_motion_ros.nodes.steady_timer import steady_timer

DISCOVERY_PERIOD_S = 0.1
REMEMBERED = 32  # messages of which a second hearing is known as such; latched ones are few


class OfferedSubscription:
    """Subscribes as reliably as the publishers of the topic offer, once one is discovered.

    No fixed choice fits everybody: a reliable subscription never matches a best-effort publisher, and a best-effort one
    loses images of a reliable publisher. It subscribes anew when other publishers appear.

    Args:
        node: the node.
        message_type: class of the messages.
        topic: name, relative or absolute, before remapping.
        callback: called with each message.
        reliability: `auto`, or `reliable` or `best_effort` to have it fixed and at once.
        depth: of the queue.
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
    ) -> None:
        self._node = node
        self._message_type = message_type
        self._topic = topic
        self._callback = callback
        self._depth = depth
        self._subscription: Subscription | None = None
        self._reliable: bool | None = None
        self._timer = None
        if reliability == "auto":
            self._timer = steady_timer(node, DISCOVERY_PERIOD_S, self._discover)
            self._discover()
        else:
            self._subscribe(reliability == "reliable")

    @property
    def reliable(self) -> bool | None:
        """Whether it is subscribed reliably; None while no publisher is known."""
        return self._reliable

    def publishers(self) -> dict[str, bool]:
        """The nodes that publish on the topic, and whether reliably."""
        offers = self._node.get_publishers_info_by_topic(self._node.resolve_topic_name(self._topic))
        return {
            f"{offer.node_namespace.rstrip('/')}/{offer.node_name}": bool(offered_reliably([offer.qos_profile]))
            for offer in offers
        }

    def destroy(self) -> None:
        """Stop listening."""
        if self._timer is not None:
            self._node.destroy_timer(self._timer)
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)

    def _discover(self) -> None:
        offers = self._node.get_publishers_info_by_topic(self._node.resolve_topic_name(self._topic))
        reliable = offered_reliably(offer.qos_profile for offer in offers)
        if reliable is not None and reliable != self._reliable:
            self._subscribe(reliable)

    def _subscribe(self, reliable: bool) -> None:
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
        self._reliable = reliable
        self._subscription = self._node.create_subscription(
            self._message_type, self._topic, self._callback, qos(depth=self._depth, reliable=reliable)
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
    """

    def __init__(
        self, node: Node, message_type: type, topic: str, callback: Callable[[Any, bool], None], depth: int
    ) -> None:
        self._node = node
        self._per_frame = OfferedSubscription(
            node, message_type, topic, lambda message: callback(message, False), reliability="auto", depth=depth
        )
        # It is meant not to match a volatile publisher: no warning about that.
        self._latched = node.create_subscription(
            message_type,
            topic,
            lambda message: callback(message, True),
            qos(depth=depth, latched=True),
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
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
