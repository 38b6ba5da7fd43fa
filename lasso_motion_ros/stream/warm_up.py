"""A dry run before the first pair: what libraries and caches cost at their first use is paid before anybody waits."""

from __future__ import annotations

import gc

import numpy as np

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.stream.drawn_ring import breath_mm, ring_image, ring_projection, ring_seed
from lasso_motion_ros.stream.outputs import Output
from lasso_motion_ros.stream.pipeline import TrackingPipeline
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.images import encode_image
from msg_adapters.messages import MessageFactory, header_fields
from msg_adapters.seeds import encode_polygon
from msg_adapters.topics import IMAGE_TYPE, camera_info_topic, seed_topic

SIDE_PX = 1024
PAIRS = 4
PERIOD_NS = 66_666_667
START_NS = 1_000_000_000


def warm_up(config: StreamConfig, messages: MessageFactory) -> list[Output]:
    """Track a drawn ring through a pipeline of its own, from messages to messages; nothing of it remains.

    All that stands by then is taken out of the garbage collector's sight: it will not go through it again while
    pairs wait.

    Args:
        config: the parameters that will be tracked with.
        messages: makes the messages.

    Returns:
        What would have been published, for a test to look at.
    """
    pipeline = TrackingPipeline(config, messages)
    generator = np.random.default_rng(0)
    seed = ring_seed(SIDE_PX)
    outputs: list[Output] = []
    for number in range(PAIRS):
        header = header_fields(START_NS + number * PERIOD_NS)
        tasks = []
        for plane in PLANES:
            info = encode_camera_info(ring_projection(plane, SIDE_PX), header)
            pixels = ring_image(plane, SIDE_PX, breath_mm(number * PERIOD_NS * 1e-9), generator)
            tasks += pipeline.intake.add_camera_info(plane, messages.make(camera_info_topic(plane).type_name, info))
            tasks += pipeline.intake.add_image(plane, messages.make(IMAGE_TYPE, encode_image(pixels, header)))
            if number == 0:
                clicks = encode_polygon(seed.points(plane), header)
                tasks += pipeline.intake.add_seed(plane, messages.make(seed_topic(plane).type_name, clicks))
        if number == PAIRS - 1:
            tasks += pipeline.intake.flush()
        for task in tasks:
            outputs += pipeline.session.process(task)
    gc.collect()
    gc.freeze()
    return outputs
