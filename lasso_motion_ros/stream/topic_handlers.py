"""Which method of the intake takes the messages of which recorded topic."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.stream.intake import MessageIntake
from lasso_motion_ros.stream.pair_task import PairTask
from msg_adapters.recordings.tracking_topics import recorded_image_topic
from msg_adapters.topics import R_PEAK, camera_info_topic, seed_topic


def topic_handlers(
    intake: MessageIntake, topics: Mapping[str, str], *, seeds: bool = True, calibrations: bool = True
) -> dict[str, Callable[[Any], list[PairTask]]]:
    """Recorded topic → what takes its messages and gives back the tasks that are due.

    Args:
        intake: what is to be fed.
        topics: types of the topics that the recording has; a plane without raw images is fed with compressed ones.
        seeds: False leaves its clicks out.
        calibrations: False leaves its calibrations out.
    """
    handlers: dict[str, Callable[[Any], list[PairTask]]] = {}
    for plane in PLANES:
        handlers[recorded_image_topic(plane, topics).recorded_name] = partial(intake.add_image, plane)
        if calibrations:
            handlers[camera_info_topic(plane).recorded_name] = partial(intake.add_camera_info, plane)
        if seeds:
            handlers[seed_topic(plane).recorded_name] = partial(intake.add_seed, plane)
    handlers[R_PEAK.recorded_name] = intake.add_r_peak
    return handlers
