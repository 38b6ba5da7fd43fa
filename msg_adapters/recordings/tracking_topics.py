"""Whether a recording has the topics that tracking needs."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.geometry.frames import PLANES, Plane
from msg_adapters.topics import Topic, camera_info_topic, compressed_image_topic, image_topic


def check_tracking_topics(recording: Path, topics: Mapping[str, str], calibrated: bool = False) -> None:
    """Check that a recording has what tracking needs in both planes: images and calibration.

    Args:
        recording: its path, for the error.
        topics: topic → type, as `RecordingReader.topics`.
        calibrated: the calibration comes from elsewhere.

    Raises:
        RecordingError: names what is missing, what has another type, and what is there instead.
    """
    missing: list[str] = []
    for plane in PLANES:
        image, compressed = image_topic(plane), compressed_image_topic(plane)
        if topics.get(compressed.recorded_name) != compressed.type_name:
            missing += _missing(topics, image.recorded_name, image.type_name)
        if not calibrated:
            info = camera_info_topic(plane)
            missing += _missing(topics, info.recorded_name, info.type_name)
    if missing:
        raise RecordingError(
            f"{recording} lacks {', '.join(missing)}{found_topics(topics)}; --remap a:=b renames topics"
        )


def recorded_image_topic(plane: Plane, topics: Mapping[str, str]) -> Topic:
    """The topic with a plane's images: raw where the recording has them, else compressed.

    Args:
        plane: `a` or `b`.
        topics: topic → type, as `RecordingReader.topics`.
    """
    raw = image_topic(plane)
    return raw if topics.get(raw.recorded_name) == raw.type_name else compressed_image_topic(plane)


def unused_compressed_topics(topics: Mapping[str, str]) -> list[tuple[str, str]]:
    """Name of the raw and of the compressed images of each plane that has both: the raw ones are taken."""
    both = [(image_topic(plane), compressed_image_topic(plane)) for plane in PLANES]
    return [
        (raw.name, compressed.name)
        for raw, compressed in both
        if all(topics.get(topic.recorded_name) == topic.type_name for topic in (raw, compressed))
    ]


def _missing(topics: Mapping[str, str], name: str, type_name: str) -> list[str]:
    found = topics.get(name)
    if found == type_name:
        return []
    return [f"{name} ({type_name})" if found is None else f"{name} as {type_name} (it is {found})"]


def found_topics(topics: Collection[str]) -> str:
    """What there is instead, to end an error's text with."""
    names = sorted(topics)
    shown = ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
    return f"; it has {shown}" if names else "; it has no topics"
