"""Quality of service of the contract's topics, as rclpy profiles, and what publishes and hears with it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile, QoSReliabilityPolicy
from rclpy.subscription import Subscription

from msg_adapters.messages import MessageFactory
from msg_adapters.topics import Topic

IMAGE_DEPTH = 10


def qos(*, depth: int, latched: bool = False, reliable: bool = True) -> QoSProfile:
    """Keep the last `depth`; latched means that a late subscriber still gets the last one (transient local)."""
    return QoSProfile(
        history=QoSHistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=QoSReliabilityPolicy.RELIABLE if reliable else QoSReliabilityPolicy.BEST_EFFORT,
        durability=QoSDurabilityPolicy.TRANSIENT_LOCAL if latched else QoSDurabilityPolicy.VOLATILE,
    )


def topic_publisher(node: Node, messages: MessageFactory, topic: Topic) -> Publisher:
    """A publisher of one of the contract's topics.

    Args:
        node: the node.
        messages: knows the classes of messages.
        topic: name, type, whether it is latched, and depth.
    """
    message_class = type(messages.make(topic.type_name, {}))
    # rclpy has the executor watch two events of each publisher, to warn where a subscriber asks for more than is
    # offered; that subscriber's own log says so, too. To watch a dozen publishers is a third of what each wait for the
    # next image costs, during which the tracker waits for Python's lock.
    unwatched = PublisherEventCallbacks(use_default_callbacks=False)
    profile = qos(depth=topic.depth, latched=topic.latched)
    return node.create_publisher(message_class, topic.name, profile, event_callbacks=unwatched)


def topic_subscription(
    node: Node, messages: MessageFactory, topic: Topic, callback: Callable[[Any], None]
) -> Subscription:
    """A subscription to one of the contract's topics; the arguments as those of `topic_publisher`."""
    message_class = type(messages.make(topic.type_name, {}))
    profile = qos(depth=topic.depth, latched=topic.latched)
    return node.create_subscription(message_class, topic.name, callback, profile)


def offered_reliably(offers: Iterable[QoSProfile]) -> bool | None:
    """Whether a subscriber that wants to hear all these publishers may ask for reliable delivery.

    A reliable subscription never matches a best-effort publisher; a best-effort one matches both.

    Args:
        offers: what each publisher of a topic offers.

    Returns:
        True if all are reliable, False if one is best effort, None if there is no publisher yet.
    """
    reliabilities = [offer.reliability for offer in offers]
    if not reliabilities:
        return None
    return QoSReliabilityPolicy.BEST_EFFORT not in reliabilities
