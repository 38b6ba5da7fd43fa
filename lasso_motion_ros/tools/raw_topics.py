"""Topics heard as bytes, whatever their publishers offer: for the recorder and for the check of a live graph."""

from __future__ import annotations

import importlib
import zlib
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy, QoSReliabilityPolicy
from rclpy.subscription import Subscription

from lasso_motion_ros.nodes.qos import qos
from msg_adapters.recorded_messages import jazzy_types

DISCOVERY_PERIOD_S = 0.1
DEPTH = 64
_REMEMBERED = 256


class Offer(NamedTuple):
    """What one publisher offers.

    Attributes:
        node: full name of its node.
        type_name: `package/msg/Name`.
        reliable: reliable, not best effort.
        latched: transient local, not volatile.
    """

    node: str
    type_name: str
    reliable: bool
    latched: bool


@dataclass(frozen=True)
class HeardMessage:
    """One message as it came.

    Attributes:
        topic: the topic's full name.
        type_name: `package/msg/Name`.
        data: CDR bytes.
        published_ns: when it was published (the publisher's clock), nanoseconds since 1970.
        received_ns: when it came (this machine's clock).
        reliable: offered reliably.
        latched: offered as latched.
    """

    topic: str
    type_name: str
    data: bytes
    published_ns: int
    received_ns: int
    reliable: bool
    latched: bool


class RawTopic:
    """Subscribes to one topic once for each kind of offer that its publishers make, as they are discovered.

    One subscription cannot hear everything: a reliable one never matches a best-effort publisher, a volatile one
    misses what was latched, a best-effort one loses large messages of a reliable publisher. What two subscriptions
    hear is handed on once.

    Args:
        node: the node.
        name: the topic's full name.
        hear: called with each message, in the executor's thread.
        unless: a topic with the same content: this one is heard only while nobody publishes on that.

    Attributes:
        offers: what its publishers offer now.
        type_name: of the first publisher; others are not heard.
        unknown_type: the type's class or definition is not installed here: nothing is heard.
        lost: messages known to have been published and not heard.
    """

    def __init__(
        self, node: Node, name: str, hear: Callable[[HeardMessage], None], unless: RawTopic | None = None
    ) -> None:
        self.name = name
        self._unless = unless
        self.offers: tuple[Offer, ...] = ()
        self.type_name: str | None = None
        self.unknown_type = False
        self.lost = 0
        self._node = node
        self._hear = hear
        self._subscriptions: dict[tuple[bool, bool], Subscription] = {}
        self._recent: deque[tuple[int, int]] = deque(maxlen=_REMEMBERED)
        self._last_number: int | None = None

    def discover(self) -> None:
        """Look at who publishes, and subscribe to what is offered anew."""
        if self._unless is not None and self._unless.offers:
            for subscription in self._subscriptions.values():
                self._node.destroy_subscription(subscription)
            self._subscriptions.clear()
            self.offers = ()
            return
        self.offers = tuple(offer_of(information) for information in self._node.get_publishers_info_by_topic(self.name))
        for offer in self.offers:
            kind = (offer.reliable, offer.latched)
            self.type_name = self.type_name or offer.type_name
            if kind not in self._subscriptions and offer.type_name == self.type_name:
                self._subscribe(*kind)

    def _subscribe(self, reliable: bool, latched: bool) -> None:
        message_class = message_class_of(self.type_name or "")
        if message_class is None or self.type_name not in jazzy_types().fielddefs:
            self.unknown_type = True
            return
        self._subscriptions[reliable, latched] = self._node.create_subscription(
            message_class,
            self.name,
            lambda data, information: self._on_message(data, information, reliable, latched),
            qos(depth=DEPTH, reliable=reliable, latched=latched),
            raw=True,
            # That it does not match every publisher is as meant: no warning about it.
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )

    def _on_message(self, data: bytes, information: dict[str, Any], reliable: bool, latched: bool) -> None:
        published_ns, received_ns = int(information["source_timestamp"]), int(information["received_timestamp"])
        if len(self._subscriptions) > 1:
            mark = (published_ns, zlib.crc32(data))
            if mark in self._recent:
                return
            self._recent.append(mark)
        self._count_lost(information.get("publication_sequence_number"))
        self._hear(HeardMessage(self.name, self.type_name or "", data, published_ns, received_ns, reliable, latched))

    def _count_lost(self, number: int | None) -> None:
        """Count gaps in a publisher's numbers; with several publishers nothing tells whose number it is."""
        if number is None or len(self.offers) != 1 or len(self._subscriptions) != 1:
            self._last_number = None
            return
        if self._last_number is not None and number > self._last_number:
            self.lost += number - self._last_number - 1
        self._last_number = number


def heard_topics(
    node: Node, names: Iterable[str], hear: Callable[[HeardMessage], None], instead: Mapping[str, str]
) -> list[RawTopic]:
    """Topics to be discovered and heard.

    Args:
        node: the node.
        names: their full names.
        hear: called with each message, in the executor's thread.
        instead: further topics, each heard only while nobody publishes on the one of `names` that it stands in for.
    """
    topics = {name: RawTopic(node, name, hear) for name in names}
    return [*topics.values(), *(RawTopic(node, name, hear, topics[other]) for name, other in instead.items())]


def message_class_of(type_name: str) -> Any:
    """The class of a message type (`package/msg/Name`), or None where it is not installed."""
    package, _, name = type_name.partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError, ValueError):
        return None


def offer_of(information: Any) -> Offer:
    """What an endpoint, publisher or subscription, offers or asks for."""
    profile = information.qos_profile
    return Offer(
        node=f"{information.node_namespace.rstrip('/')}/{information.node_name}",
        type_name=information.topic_type,
        reliable=profile.reliability != QoSReliabilityPolicy.BEST_EFFORT,
        latched=profile.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL,
    )
