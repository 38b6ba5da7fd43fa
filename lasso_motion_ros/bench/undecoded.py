"""The tracker's inputs in a recording, as the bytes that came over the wire."""

from __future__ import annotations

from pathlib import Path

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.geometry.frames import PLANES
from msg_adapters.recordings.reader import RawMessage, RecordingReader
from msg_adapters.topics import camera_info_topic, image_topic, seed_topic


def read_undecoded(recording: Path) -> list[RawMessage]:
    """The tracker's inputs in a recording, as bytes, in the order they were logged.

    Raises:
        RecordingError: it cannot be read or has no images.
    """
    inputs = [topic(plane).recorded_name for plane in PLANES for topic in (camera_info_topic, seed_topic, image_topic)]
    messages = list(RecordingReader(recording).raw_messages(inputs))
    if not any("image_raw" in message.topic for message in messages):
        raise RecordingError(f"{recording}: no images on {image_topic('a').recorded_name}")
    return messages
