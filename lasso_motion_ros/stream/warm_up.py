"""A dry run before the first pair: what libraries and caches cost at first use is paid before anybody waits."""

from __future__ import annotations

import gc
from dataclasses import dataclass

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


@dataclass(frozen=True)
class _DryRun:
    """The stream of the dry run.

    Attributes:
        side_px: of the images: as large as a detector's, so that buffers have their final size.
        pairs: the seed pair, and enough after it to go through every stage.
        period_ns: between pairs, 15 pairs/s.
        start_ns: stamp of the first pair.
    """

    side_px: int = 1024
    pairs: int = 4
    period_ns: int = 66_666_667
    start_ns: int = 1_000_000_000


DRY_RUN = _DryRun()


def warm_up(config: StreamConfig, messages: MessageFactory) -> list[Output]:
    """A dry run, after which the garbage collector ignores all objects that exist by then.

    So it does not scan them while pairs wait. Arguments and result as those of `dry_run`.
    """
    outputs = dry_run(config, messages)
    gc.collect()
    gc.freeze()
    return outputs


def dry_run(config: StreamConfig, messages: MessageFactory) -> list[Output]:
    """Track a drawn ring through a pipeline of its own, from messages to messages, and discard it.

    Args:
        config: the parameters that will be tracked with.
        messages: makes the messages that come in.

    Returns:
        What would have been published, for a test to look at.
    """
    pipeline = TrackingPipeline(config)
    generator = np.random.default_rng(0)
    seed = ring_seed(DRY_RUN.side_px)
    outputs: list[Output] = []
    for number in range(DRY_RUN.pairs):
        header = header_fields(DRY_RUN.start_ns + number * DRY_RUN.period_ns)
        tasks = []
        for plane in PLANES:
            info = encode_camera_info(ring_projection(plane, DRY_RUN.side_px), header)
            pixels = ring_image(plane, DRY_RUN.side_px, breath_mm(number * DRY_RUN.period_ns * 1e-9), generator)
            tasks += pipeline.intake.add_camera_info(plane, messages.make(camera_info_topic(plane).type_name, info))
            tasks += pipeline.intake.add_image(plane, messages.make(IMAGE_TYPE, encode_image(pixels, header)))
            if number == 0:
                clicks = encode_polygon(seed.points(plane), header)
                tasks += pipeline.intake.add_seed(plane, messages.make(seed_topic(plane).type_name, clicks))
        if number == DRY_RUN.pairs - 1:
            tasks += pipeline.intake.flush()
        for task in tasks:
            outputs += pipeline.session.process(task)
    return outputs
