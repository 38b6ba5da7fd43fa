"""Topics that are missing, misnamed, of another type, or offered with a QoS that nobody can receive."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from lasso_motion_ros.geometry.frames import PLANES, Plane
from msg_adapters.checks.issue import Issue
from msg_adapters.topics import (
    CATHETER,
    COMPRESSED_IMAGE_TYPE,
    GROUND_TRUTH,
    IMAGE_TYPE,
    INPUTS,
    MOTION,
    OUTPUTS,
    Topic,
    camera_info_topic,
    compressed_image_topic,
    image_topic,
    overlay_topic,
    seed_topic,
    tracking_topic,
)

PROFILE = "config/fastdds.xml"
_OURS = frozenset(
    topic.recorded_name
    for topic in (
        *INPUTS,
        *OUTPUTS,
        *GROUND_TRUTH,
        *(make(plane) for plane in PLANES for make in (tracking_topic, overlay_topic, compressed_image_topic)),
    )
)
# What people call the planes.
_PLANE_WORDS = {
    "a": frozenset({"a", "1", "frontal", "front", "ap", "planea", "primary", "rao"}),
    "b": frozenset({"b", "2", "lateral", "lat", "planeb", "secondary", "lao"}),
}
_SIMILAR = 0.5


@dataclass(frozen=True)
class Endpoint:
    """One publisher or subscription.

    Attributes:
        node: full name of its node.
        reliable: offers (or asks for) reliable delivery.
        latched: offers (or asks for) transient-local durability.
    """

    node: str
    reliable: bool
    latched: bool


@dataclass(frozen=True)
class TopicFacts:
    """What is known of one topic, under its name in the contract.

    Attributes:
        type_name: `package/msg/Name`.
        publishers: of a live graph; of a recording none is known.
        subscriptions: likewise.
        messages: how many came.
        lost: how many were published and did not come.
    """

    type_name: str
    publishers: tuple[Endpoint, ...] = ()
    subscriptions: tuple[Endpoint, ...] = ()
    messages: int = 0
    lost: int = 0


def check_graph(topics: Mapping[str, TopicFacts], *, live: bool) -> Iterator[Issue]:
    """Names, types and quality of service.

    Args:
        topics: contract name (absolute) → facts; all topics, also those that are not the contract's.
        live: a running graph, not a recording.
    """
    for plane in PLANES:
        yield from _check_images(plane, topics, live=live)
        yield from _check_needed(camera_info_topic(plane), topics, plane, live=live)
        yield from _check_type(seed_topic(plane), topics)
    if live:
        for topic in INPUTS:
            facts = topics.get(topic.recorded_name)
            if facts is not None:
                yield from _check_publishers(topic, facts)
        yield from _check_trackers(topics)
        for topic in (*INPUTS, MOTION, CATHETER):
            facts = topics.get(topic.recorded_name)
            if facts is not None:
                yield from _check_subscriptions(topic, facts)


def _check_images(plane: Plane, topics: Mapping[str, TopicFacts], *, live: bool) -> Iterator[Issue]:
    """The plane's images, raw or compressed; where there are both, the raw ones are taken."""
    raw, compressed = image_topic(plane), compressed_image_topic(plane)
    stand_in = topics.get(compressed.recorded_name)
    if stand_in is None or stand_in.type_name != compressed.type_name or (live and not stand_in.publishers):
        yield from _check_needed(raw, topics, plane, live=live)
        return
    facts = topics.get(raw.recorded_name)
    if facts is None or facts.type_name != raw.type_name or (live and not facts.publishers):
        yield from _check_needed(compressed, topics, plane, live=live)
        return
    yield from _check_needed(raw, topics, plane, live=live)
    taken = f"{compressed.recorded_name} is there too; these are taken"
    yield Issue("note", raw.recorded_name, taken, "as it should be: nothing has been lost in them")


def _check_needed(topic: Topic, topics: Mapping[str, TopicFacts], plane: Plane, *, live: bool) -> Iterator[Issue]:
    name = topic.recorded_name
    facts = topics.get(name)
    if facts is not None and (not live or facts.publishers):
        if topic.type_name == IMAGE_TYPE and facts.type_name == COMPRESSED_IMAGE_TYPE:
            yield Issue("error", name, "it carries compressed images", _compressed_cure(name, plane, live=live))
            return
        yield from _check_type(topic, topics)
        if facts.type_name == topic.type_name and facts.messages == 0:
            yield Issue("error", name, "nothing was heard on it", "see that its publisher sends, and that it is one")
        return
    candidate = _near_match(topic, topics, plane)
    compressed = _compressed_match(topics, plane) if candidate is None and topic.type_name == IMAGE_TYPE else None
    if compressed is not None:
        yield Issue(
            "error",
            name,
            f"{'nobody publishes it' if live else 'it is missing'}; {compressed} carries compressed images",
            _compressed_cure(compressed, plane, live=live),
        )
    elif candidate is None:
        wanted = f"publish {topic.type_name} there"
        yield Issue("error", name, "nobody publishes it" if live else "it is missing", wanted)
    elif candidate.endswith(name):
        yield Issue(
            "error",
            name,
            f"it is in the namespace {candidate.removesuffix(name)}",
            _namespace_cure(candidate.removesuffix(name), candidate, name, live=live),
        )
    else:
        cure = (
            f"start the node with --ros-args -r {topic.name}:={candidate}" if live else f"--remap {candidate}:={name}"
        )
        yield Issue("error", name, f"{'nobody publishes it' if live else 'it is missing'}; {candidate} may be it", cure)


def _namespace_cure(namespace: str, candidate: str, name: str, *, live: bool) -> str:
    if live:
        return f"start the nodes with --ros-args -r __ns:={namespace}, and this command with --namespace {namespace}"
    return f"--remap {candidate}:={name}"


def _compressed_match(topics: Mapping[str, TopicFacts], plane: Plane) -> str | None:
    """The topic with the plane's compressed images, or None."""
    topic = compressed_image_topic(plane)
    facts = topics.get(topic.recorded_name)
    if facts is not None and facts.type_name == COMPRESSED_IMAGE_TYPE:
        return topic.recorded_name
    return _near_match(topic, topics, plane)


def _compressed_cure(found: str, plane: Plane, *, live: bool) -> str:
    topic = compressed_image_topic(plane)
    if not live:
        return f"--remap {found}:={topic.recorded_name}"
    return f"start the nodes with --ros-args -r {topic.name}:={found}"


def _check_trackers(topics: Mapping[str, TopicFacts]) -> Iterator[Issue]:
    """More than one tracker at work: consumers would get the one's motion and the other's in turn."""
    facts = topics.get(MOTION.recorded_name)
    if facts is not None and len(facts.publishers) > 1:
        nodes = ", ".join(sorted(publisher.node for publisher in facts.publishers))
        yield Issue(
            "error",
            MOTION.recorded_name,
            f"{len(facts.publishers)} publishers ({nodes})",
            "leave one running, or give each a namespace of its own (--ros-args -r __ns:=/lab)",
        )


def _near_match(topic: Topic, topics: Mapping[str, TopicFacts], plane: str) -> str | None:
    """The topic of the same type whose name is nearest and not the other plane's, or None."""
    scores: dict[str, float] = {}
    for name, facts in topics.items():
        if name in _OURS or facts.type_name != topic.type_name:
            continue
        if name.endswith(topic.recorded_name):
            return name
        words = {word for word in re.split(r"[^a-z0-9]+", name.lower()) if word}
        mine, other = words & _PLANE_WORDS[plane], words & _PLANE_WORDS["b" if plane == "a" else "a"]
        likeness = difflib.SequenceMatcher(None, name, topic.recorded_name).ratio()
        if mine and not other:
            scores[name] = 1.0 + likeness
        elif not other and likeness > _SIMILAR:
            scores[name] = likeness
    return max(scores, key=lambda name: scores[name]) if scores else None


def _check_type(topic: Topic, topics: Mapping[str, TopicFacts]) -> Iterator[Issue]:
    facts = topics.get(topic.recorded_name)
    if facts is not None and facts.type_name != topic.type_name:
        yield Issue(
            "error",
            topic.recorded_name,
            f"its type is {facts.type_name}, expected {topic.type_name}",
            f"publish {topic.type_name}",
        )


def _check_publishers(topic: Topic, facts: TopicFacts) -> Iterator[Issue]:
    name = topic.recorded_name
    nodes = sorted({publisher.node for publisher in facts.publishers})
    best_effort = sorted({publisher.node for publisher in facts.publishers if not publisher.reliable})
    if len(facts.publishers) > 1 and topic.type_name == IMAGE_TYPE:
        yield Issue("error", name, f"{len(facts.publishers)} publishers ({', '.join(nodes)})", "leave one running")
    if best_effort and topic.name in {seed_topic(plane).name for plane in PLANES}:
        yield Issue("error", name, f"{', '.join(best_effort)} publishes best effort: not heard", "publish reliably")
    if facts.lost and best_effort:
        share = facts.lost / (facts.lost + facts.messages)
        yield Issue(
            "warning" if share < 0.2 else "error",
            name,
            f"{facts.lost} of {facts.lost + facts.messages} messages were lost; {', '.join(best_effort)} publishes best"
            " effort, and its shared memory is likely too small for images",
            f"start it with FASTRTPS_DEFAULT_PROFILES_FILE=…/{PROFILE}, or publish reliably",
        )
    elif facts.lost:
        yield Issue(
            "warning",
            name,
            f"{facts.lost} of {facts.lost + facts.messages} messages were lost on the way",
            "give the publisher a deeper queue (10) and this machine time",
        )


def _check_subscriptions(topic: Topic, facts: TopicFacts) -> Iterator[Issue]:
    """Subscriptions that no publisher matches, of nodes that have no other one that does."""
    heard = {
        subscription.node
        for subscription in facts.subscriptions
        if any(_match(publisher, subscription) for publisher in facts.publishers)
    }
    if not facts.publishers:
        return
    for subscription in facts.subscriptions:
        if subscription.node in heard:
            continue
        heard.add(subscription.node)
        asked = "reliable delivery" if subscription.reliable else "latched messages"
        yield Issue(
            "warning",
            topic.recorded_name,
            f"{subscription.node} asks for {asked}, which no publisher offers: it hears nothing",
            "let it subscribe best effort and volatile, or the publisher offer more",
        )


def _match(publisher: Endpoint, subscription: Endpoint) -> bool:
    return (publisher.reliable or not subscription.reliable) and (publisher.latched or not subscription.latched)
