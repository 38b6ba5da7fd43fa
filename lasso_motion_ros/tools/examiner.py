"""Looks at a live graph for a few seconds: who publishes what, how, and what comes."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.nodes.ros_start import ros_session
from lasso_motion_ros.tools.listened_topics import INSTEAD
from lasso_motion_ros.tools.raw_topics import DISCOVERY_PERIOD_S, heard_topics, offer_of
from msg_adapters.checks.examination import Examination
from msg_adapters.checks.graph_checks import Endpoint, TopicFacts
from msg_adapters.recorded_messages import jazzy_types
from msg_adapters.sync.plane_source import PlaneSource
from msg_adapters.topics import INPUTS, STATE

NODE = "lasso_check"
DISCOVERY_WAIT_S = 8.0
"""For the first publisher to be found; on a busy machine that takes seconds, and nothing is heard before."""


def examine(
    seconds: float,
    namespace: str,
    interrupted: threading.Event,
    sources: Mapping[Plane, PlaneSource] | None = None,
    *,
    offset: bool = False,
) -> tuple[Examination, dict[str, TopicFacts]]:
    """Listen to the tracker's inputs and its state.

    Args:
        seconds: how long, from the first publisher found on; an empty graph is one in which none is found at all.
        namespace: of the nodes, `/lab` or empty.
        interrupted: set it to end early.
        sources: per plane, which part of the pictures the tracker takes; None: all of them.
        offset: measure by how much one plane's pictures are later than the other's.

    Returns:
        The messages examined, and the facts of all topics under their contract names (without the namespace).
    """
    jazzy_types()  # takes a while the first time: not of the time to listen
    with ros_session():
        node = rclpy.create_node(NODE, enable_rosout=False, start_parameter_services=False)
        examination = Examination(live=True, sources=sources, offset=offset)
        raw_topics = heard_topics(
            node,
            [namespace + topic.recorded_name for topic in (*INPUTS, STATE)],
            lambda heard: examination.add(
                heard.topic.removeprefix(namespace), heard.type_name, heard.data, heard.received_ns
            ),
            {namespace + name: namespace + other for name, other in INSTEAD.items()},
        )
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        try:
            found, due = False, 0.0
            end = time.monotonic() + max(seconds, DISCOVERY_WAIT_S)
            while not interrupted.is_set() and time.monotonic() < end:
                if time.monotonic() >= due:
                    for topic in raw_topics:
                        topic.discover()
                    if not found and any(topic.offers for topic in raw_topics):
                        found, end = True, time.monotonic() + seconds
                    due = time.monotonic() + DISCOVERY_PERIOD_S
                executor.spin_once(timeout_sec=DISCOVERY_PERIOD_S)
            lost = {topic.name.removeprefix(namespace): topic.lost for topic in raw_topics}
            return examination, _facts(node, namespace, examination, lost)
        finally:
            executor.shutdown()
            node.destroy_node()


def _facts(node: Node, namespace: str, examination: Examination, lost: dict[str, int]) -> dict[str, TopicFacts]:
    facts = {}
    for full_name, types in node.get_topic_names_and_types():
        name = full_name.removeprefix(namespace) if full_name.startswith(f"{namespace}/") else full_name
        facts[name] = TopicFacts(
            types[0],
            tuple(_endpoint(one) for one in node.get_publishers_info_by_topic(full_name)),
            tuple(_endpoint(one) for one in node.get_subscriptions_info_by_topic(full_name) if one.node_name != NODE),
            examination.counts[name],
            lost.get(name, 0),
        )
    return facts


def _endpoint(information: object) -> Endpoint:
    offer = offer_of(information)
    return Endpoint(offer.node, offer.reliable, offer.latched)
