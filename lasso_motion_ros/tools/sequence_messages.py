"""The messages of a rendered sequence: images with calibration, clicks, and the truth, each under its stamp."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane
from lasso_motion_ros.geometry.projection import Projection
from msg_adapters import topics
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.images import encode_image
from msg_adapters.markers import encode_line_strip, encode_points
from msg_adapters.messages import header_fields
from msg_adapters.poses import encode_pose_stamped
from msg_adapters.recordings.writer import RecordingWriter
from msg_adapters.seeds import encode_polygon

Array = npt.NDArray[np.float64]
StampedMessage = tuple[int, topics.Topic, dict[str, Any]]
"""Stamp in nanoseconds, topic, fields."""

WORLD_FRAME = "patient_table"


def image_messages(pair: FramePair) -> list[StampedMessage]:
    """Calibration and image of each plane that is there."""
    messages: list[StampedMessage] = []
    for plane, frame in pair.frames.items():
        # The calibration first: whoever takes messages in order then has it with the image.
        messages.append(calibration_message(plane, frame.stamp_ns, frame.projection))
        header = header_fields(frame.stamp_ns, f"plane_{plane}")
        messages.append((frame.stamp_ns, topics.image_topic(plane), encode_image(frame.pixels, header)))
    return messages


def calibration_message(plane: Plane, stamp_ns: int, projection: Projection) -> StampedMessage:
    """The calibration of one image."""
    header = header_fields(stamp_ns, f"plane_{plane}")
    return stamp_ns, topics.camera_info_topic(plane), encode_camera_info(projection, header)


def seed_messages(clicks: Mapping[Plane, Array], stamps_ns: Mapping[Plane, int]) -> list[StampedMessage]:
    """Clicks (N, 2) in each plane's image, under that image's stamp."""
    return [
        (
            stamps_ns[plane],
            topics.seed_topic(plane),
            encode_polygon(clicks[plane], header_fields(stamps_ns[plane], f"plane_{plane}")),
        )
        for plane in PLANES
    ]


def r_peak_messages(peaks_ns: Iterable[int]) -> list[StampedMessage]:
    """R peaks of the ECG."""
    return [(peak, topics.R_PEAK, header_fields(peak, "ecg")) for peak in peaks_ns]


def truth_messages(
    stamp_ns: int, motion: Array, respiratory: Array, centrelines: Mapping[Plane, Array]
) -> list[StampedMessage]:
    """The truth of one pair.

    Args:
        stamp_ns: plane A's exposure.
        motion: (4, 4) the atrium's motion, metres.
        respiratory: (4, 4) of breathing alone.
        centrelines: plane → (N, 2) pixels.
    """
    world = header_fields(stamp_ns, WORLD_FRAME)
    messages: list[StampedMessage] = [
        (stamp_ns, topics.TRUE_MOTION, encode_pose_stamped(motion, world)),
        (stamp_ns, topics.TRUE_RESPIRATORY_MOTION, encode_pose_stamped(respiratory, world)),
    ]
    for plane, line in centrelines.items():
        header = header_fields(stamp_ns, f"plane_{plane}")
        messages.append((stamp_ns, topics.true_centreline_topic(plane), encode_polygon(line, header)))
    return messages


def reference_truth_messages(stamp_ns: int, loop: Array, targets: Array) -> list[StampedMessage]:
    """The truth that does not change: loop (N, 3) and targets (M, 3) at the reference, world metres."""
    world = header_fields(stamp_ns, WORLD_FRAME)
    return [
        (stamp_ns, topics.TRUE_CATHETER, encode_line_strip(loop, world, "catheter")),
        (stamp_ns, topics.TRUE_TARGETS, encode_points(targets, world, "targets")),
    ]


def write_messages(writer: RecordingWriter, messages: Iterable[StampedMessage]) -> None:
    """Write messages in the order of their stamps; those of one stamp as they come."""
    for stamp_ns, topic, fields in sorted(messages, key=lambda message: message[0]):
        writer.write(topic.recorded_name, topic.type_name, fields, stamp_ns, latched=topic.latched)
