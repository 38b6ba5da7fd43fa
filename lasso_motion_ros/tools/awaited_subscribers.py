"""Whose subscriptions a player waits for before its first message."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from rclpy.node import Node, NodeNameNonExistentError
from rclpy.publisher import Publisher

from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.tools.raw_topics import offer_of
from msg_adapters.topics import (
    COMPRESSED_IMAGE_TYPE,
    IMAGE_TYPE,
    INPUTS,
    camera_info_topic,
    compressed_image_topic,
    image_topic,
    seed_topic,
)

_CLICKED_NAMES = frozenset(seed_topic(plane).recorded_name for plane in PLANES)
# Message types that every node publishes, and that `ros2 bag record` does of itself.
_SAID_BY_LISTENERS = frozenset({"Log", "ParameterEvent", "WriteSplitEvent"})
_NEEDED_WITH_CLICKS = frozenset(
    make(plane).recorded_name for make in (image_topic, compressed_image_topic, camera_info_topic) for plane in PLANES
)


class AwaitedSubscribers:
    """Tells on which of the tracker's inputs somebody is still missing.

    A node that takes clicks needs the clicked images, too. It may subscribe to them later than to the clicks: once it
    has discovered how they are offered. Meanwhile another node's subscription must not pass for its own, nor ever that
    of one that only listens, as a recorder does.

    Args:
        node: the node that publishes.
        publishers: by topic; those of topics that are no input are not looked at.
        latched: the topics of these that are latched.
        on_images: how many subscribers each image topic must have; every other input one.
    """

    def __init__(
        self, node: Node, publishers: Mapping[str, Publisher], latched: Collection[str], on_images: int
    ) -> None:
        self._node = node
        self._latched = latched
        # Compressed images are heard where there are no raw ones.
        stand_ins = [compressed_image_topic(p) for p in PLANES if image_topic(p).recorded_name not in publishers]
        inputs = [topic for topic in (*INPUTS, *stand_ins) if topic.recorded_name in publishers]
        self._publishers = {topic.recorded_name: publishers[topic.recorded_name] for topic in inputs}
        self._wanted = {
            topic.recorded_name: on_images if topic.type_name in (IMAGE_TYPE, COMPRESSED_IMAGE_TYPE) else 1
            for topic in inputs
        }

    def missing(self) -> list[str]:
        """The topics that have too few subscribers now."""
        clicked = {name: self._that_answer(self._nodes_on(name)) for name in _CLICKED_NAMES & self._wanted.keys()}
        take_clicks: set[str] = set().union(*clicked.values())
        return [
            name
            for name, wanted in self._wanted.items()
            if self._publishers[name].get_subscription_count() < wanted
            or not clicked.get(name, True)
            or (name in _NEEDED_WITH_CLICKS and not take_clicks <= self._nodes_on(name))
        ]

    def _nodes_on(self, name: str) -> set[str]:
        """The nodes with a subscription that hears what is published on a topic."""
        subscriptions = self._node.get_subscriptions_info_by_topic(self._publishers[name].topic_name)
        return {one.node for one in map(offer_of, subscriptions) if name in self._latched or not one.latched}

    def _that_answer(self, nodes: set[str]) -> set[str]:
        """Those of some nodes that publish something of their own."""
        return {node for node in nodes if not self._said_by(node) <= _SAID_BY_LISTENERS}

    def _said_by(self, node: str) -> set[str]:
        """The message types that a node publishes; none where it has just gone, or its name is not known yet."""
        namespace, _, name = node.rpartition("/")
        if namespace and not namespace.startswith("/"):
            return set()
        try:
            said = self._node.get_publisher_names_and_types_by_node(name, namespace or "/")
        except NodeNameNonExistentError:
            return set()
        return {kind.rpartition("/")[2] for _, kinds in said for kind in kinds}
