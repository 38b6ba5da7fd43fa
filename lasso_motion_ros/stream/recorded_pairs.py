"""The biplane pairs of a recording, one after another, by the rule by which the node pairs them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from lasso_motion_ros.configuration import ProductConfig
from lasso_motion_ros.frames import PLANES, FramePair
from lasso_motion_ros.stream.clicked_pairs import ReadyPair
from lasso_motion_ros.stream.pipeline import TrackingPipeline
from msg_adapters.messages import RecordedMessages
from msg_adapters.recording_reader import RecordingReader
from msg_adapters.topics import camera_info_topic, compressed_image_topic, image_topic


def recorded_pairs(reader: RecordingReader, config: ProductConfig) -> Iterator[FramePair]:
    """Read a recording's images and calibrations into pairs; only those under way are held in memory.

    Args:
        reader: the recording; its `damage` is known once the last pair was given.
        config: how pairs are made (`sync`); nothing is tracked.
    """
    pipeline = TrackingPipeline(config, RecordedMessages())
    intake = {}
    for plane in PLANES:
        raw, compressed = image_topic(plane), compressed_image_topic(plane)
        images = raw if reader.topics.get(raw.recorded_name) == raw.type_name else compressed
        intake[images.recorded_name] = partial(pipeline.add_image, plane)
        intake[camera_info_topic(plane).recorded_name] = partial(pipeline.add_camera_info, plane)
    ready: list[ReadyPair]
    for recorded in reader.messages(intake):
        ready = intake[recorded.topic](recorded.message)
        yield from (one.pair for one in ready)
    yield from (one.pair for one in pipeline.flush())
