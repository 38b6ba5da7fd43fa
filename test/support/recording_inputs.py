"""Recordings to read and spoil, and what they hold."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from support.message_inputs import image, stamp, stream

from msg_adapters.recorded_messages import jazzy_types
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.recordings.writer import RecordingWriter


def write(path: Path, pairs: int = 6, compression: str = "zstd", offset_ns: int = 0) -> Path:
    with RecordingWriter(path, compression) as writer:
        for topic, type_name, message, at in stream(pairs, offset_ns=offset_ns):
            writer.write(topic, type_name, message, at)
    return path


def write_noise(path: Path, images: int, compression: str = "zstd") -> Path:
    """Images that do not compress, so that the file has many chunks."""
    random = np.random.default_rng(0)
    with RecordingWriter(path, compression) as writer:
        for index in range(images):
            message = image(stamp(index), side=512)
            message.data = random.integers(0, 255, 512 * 512, dtype=np.uint8)
            writer.write("/plane_a/image_raw", "sensor_msgs/msg/Image", message, stamp(index))
    return path


def content(path: Path, **options: Any) -> list[tuple[str, int, bytes]]:
    return [(m.topic, m.log_time_ns, m.data) for m in RecordingReader(path, **options).raw_messages()]


def expected(pairs: int, offset_ns: int = 0) -> list[tuple[str, int, bytes]]:
    types = jazzy_types()
    entries = [
        (topic, at, bytes(types.serialize_cdr(m, name))) for topic, name, m, at in stream(pairs, None, offset_ns)
    ]
    clicks = [
        (topic, at, bytes(types.serialize_cdr(m, name)))
        for topic, name, m, at in stream(pairs, 0, offset_ns)
        if topic.endswith("seed")
    ]
    return sorted(entries + clicks, key=lambda entry: entry[1])
