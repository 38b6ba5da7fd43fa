"""The topics that `record` listens to, and the names they are recorded under."""

from __future__ import annotations

from collections.abc import Sequence

from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.geometry.frames import PLANES
from msg_adapters.topics import (
    DIAGNOSTICS,
    GROUND_TRUTH,
    INPUTS,
    OUTPUTS,
    camera_info_topic,
    click_topic,
    image_topic,
)

RECORDED = (*INPUTS, *(click_topic(plane) for plane in PLANES), *OUTPUTS, DIAGNOSTICS, *GROUND_TRUTH)
NEEDED = tuple(make(plane) for plane in PLANES for make in (image_topic, camera_info_topic))


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
