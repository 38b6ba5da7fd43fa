"""The topics that `record` listens to, and the names they are recorded under."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.geometry.frames import PLANES
from msg_adapters.topics import (
    DIAGNOSTICS,
    GROUND_TRUTH,
    INPUTS,
    OUTPUTS,
    camera_info_topic,
    click_topic,
    compressed_image_topic,
    image_topic,
)

INSTEAD = {compressed_image_topic(plane).recorded_name: image_topic(plane).recorded_name for plane in PLANES}
"""What stands in for another topic, where nobody publishes on that."""
RECORDED = (
    *INPUTS,
    *(make(plane) for plane in PLANES for make in (click_topic, compressed_image_topic)),
    *OUTPUTS,
    DIAGNOSTICS,
    *GROUND_TRUTH,
)


def lacking_topics(heard: Collection[str]) -> list[str]:
    """Names in a recording of what tracking needs and has not been heard."""
    compressed = {name for stand_in, name in INSTEAD.items() if stand_in in heard}
    names = [make(plane).recorded_name for plane in PLANES for make in (image_topic, camera_info_topic)]
    return [name for name in names if name not in heard and name not in compressed]


def stand_ins(topics: Mapping[str, str], more: Sequence[str]) -> dict[str, str]:
    """Of `live_topics`, full name of what is recorded only where nobody publishes on another → that other.

    Args:
        topics: as `live_topics` gives them.
        more: topics that the user names, and which are recorded in any case.
    """
    live = {recorded: name for name, recorded in topics.items()}
    asked = {name.strip("/") for name in more}
    return {
        live[stand_in]: live[name]
        for stand_in, name in INSTEAD.items()
        if not {stand_in.strip("/"), live[stand_in].strip("/")} & asked
    }


def live_topics(namespace: str, more: Sequence[str]) -> dict[str, str]:
    """Full name of each live topic → the name it is recorded under (without the namespace).

    Raises:
        LassoMotionError: two topics would get one name.
    """
    prefix = f"/{namespace.strip('/')}" if namespace.strip("/") else ""
    names = {topic.recorded_name if topic.name.startswith("/") else prefix + topic.recorded_name for topic in RECORDED}
    names |= {name if name.startswith("/") else f"{prefix}/{name}" for name in more}
    topics = {name: name.removeprefix(prefix) if name.startswith(f"{prefix}/") else name for name in sorted(names)}
    if len(set(topics.values())) != len(topics):
        raise LassoMotionError("--topics: two topics would be recorded under one name")
    return topics
