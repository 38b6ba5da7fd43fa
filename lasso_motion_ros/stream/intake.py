"""Which of the pipeline's methods takes the messages of which recorded topic."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.stream.clicked_pairs import PairTask
from lasso_motion_ros.stream.pipeline import TrackingPipeline
from msg_adapters.topics import R_PEAK, camera_info_topic, compressed_image_topic, image_topic, seed_topic


def recorded_intake(
    pipeline: TrackingPipeline, topics: Mapping[str, str], *, seeds: bool = True, calibrations: bool = True
) -> dict[str, Callable[[Any], list[PairTask]]]:
    """Recorded topic → what takes its messages and gives back the pairs whose turn it is.

    Args:
        pipeline: what is to be fed.
        topics: types of the topics that the recording has; a plane without raw images is fed with compressed ones.
        seeds: False leaves its clicks out.
        calibrations: False leaves its calibrations out.
    """
    intake: dict[str, Callable[[Any], list[PairTask]]] = {}
    for plane in PLANES:
        raw, compressed = image_topic(plane), compressed_image_topic(plane)
        images = raw if topics.get(raw.recorded_name) == raw.type_name else compressed
        intake[images.recorded_name] = partial(pipeline.add_image, plane)
        if calibrations:
            intake[camera_info_topic(plane).recorded_name] = partial(pipeline.add_camera_info, plane)
        if seeds:
            intake[seed_topic(plane).recorded_name] = partial(pipeline.add_seed, plane)
    intake[R_PEAK.recorded_name] = pipeline.add_r_peak
    return intake
