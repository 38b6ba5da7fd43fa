"""A small recording with a drawn ring, its truth, and a tracker's answers that are off by known amounts."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from support.method_inputs import draw_curve

from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import apply, rigid
from msg_adapters import topics
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.images import encode_image
from msg_adapters.markers import encode_delete, encode_line_strip, encode_points
from msg_adapters.messages import header_fields
from msg_adapters.poses import encode_pose_stamped, encode_pose_with_covariance_stamped
from msg_adapters.recordings.writer import RecordingWriter
from msg_adapters.seeds import encode_polygon

START_NS = 1_760_000_000_000_000_000
PERIOD_NS = 250_000_000
WORLD = "patient_table"
SIDE = 512
TARGETS = np.array([[0.02, 0.0, 0.0], [-0.02, 0.0, 0.0]])


def stamp(pair: int) -> int:
    return START_NS + pair * PERIOD_NS


def shift(z_mm: float) -> np.ndarray:
    return rigid((0, 0, 0), (0, 0, z_mm * 1e-3))


def projections() -> dict[str, Projection]:
    return {
        plane: carm_projection(
            np.radians(angle),
            0.0,
            source_detector_m=1.2,
            source_object_m=0.785,
            pixel_size_m=0.4e-3,
            width=SIDE,
            height=SIDE,
        )
        for plane, angle in (("a", -30.0), ("b", 60.0))
    }


def loop() -> np.ndarray:
    """A ring of 10 mm radius that neither plane sees edge-on, (181, 3) metres."""
    angles = np.linspace(0.0, 2 * np.pi, 181)
    flat = 0.01 * np.column_stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)])
    return apply(rigid((0.9, 0.3, 0.2), (0, 0, 0)), flat)


@cache
def _film(plane: str, z_mm: float) -> np.ndarray:
    """A plane's picture without quanta; drawn once, since many pairs show the ring in the same place."""
    curve = projections()[plane].project(apply(shift(z_mm), loop()))
    return draw_curve(curve, (SIDE, SIDE), background=180.0)


def write_centrelines_only(path: Path, motions_mm: list[float]) -> Path:
    """As `write_input`, with centrelines as somebody draws them by hand, and no truth in space."""
    return write_input(path, motions_mm, in_space=False)


def write_input(
    path: Path, motions_mm: list[float], *, hidden: tuple[int, ...] = (), truth: bool = True, in_space: bool = True
) -> Path:
    """Images, calibration, clicks, and the truth, of a ring that moves along z."""
    quanta = np.random.default_rng(0)  # no exposure is as the last
    with RecordingWriter(path) as writer:

        def write(topic: topics.Topic, fields: dict[str, Any], pair: int) -> None:
            writer.write(topic.recorded_name, topic.type_name, fields, stamp(pair), latched=topic.latched)

        for pair, z_mm in enumerate(motions_mm):
            header = header_fields(stamp(pair), WORLD)
            for plane, projection in projections().items():
                curve = projection.project(apply(shift(z_mm), loop()))
                empty = np.full((SIDE, SIDE), 180, np.uint8)
                pixels = empty if pair in hidden else _film(plane, z_mm)
                pixels = pixels + quanta.integers(0, 2, pixels.shape, dtype=np.uint8)
                write(topics.camera_info_topic(plane), encode_camera_info(projection, header), pair)
                write(topics.image_topic(plane), encode_image(pixels, header), pair)
                if pair == 0:
                    write(topics.seed_topic(plane), encode_polygon(curve[:-1:18], header), pair)
                if truth and pair not in hidden:
                    write(topics.true_centreline_topic(plane), encode_polygon(curve, header), pair)
            if truth and in_space:
                write(topics.TRUE_MOTION, encode_pose_stamped(shift(z_mm), header), pair)
                write(topics.TRUE_RESPIRATORY_MOTION, encode_pose_stamped(shift(z_mm), header), pair)
                if pair == 0:
                    write(topics.TRUE_CATHETER, encode_line_strip(loop(), header, "catheter"), pair)
                    write(topics.TRUE_TARGETS, encode_points(TARGETS, header, "targets"), pair)
    return path


def write_result(path: Path, motions_mm: list[float | None], states: list[str]) -> Path:
    """What a tracker would have published: poses along z (None: no pose) in given states, 0.5 mm sure of each."""
    covariance = np.diag([0.25e-6] * 3 + [1e-6] * 3)
    with RecordingWriter(path) as writer:

        def write(topic: topics.Topic, fields: dict[str, Any], pair: int) -> None:
            writer.write(topic.recorded_name, topic.type_name, fields, stamp(pair), latched=topic.latched)

        write(topics.REFERENCE, header_fields(stamp(0), WORLD), 0)
        for pair, (z_mm, state) in enumerate(zip(motions_mm, states, strict=True)):
            header = header_fields(stamp(pair), WORLD)
            write(topics.STATE, {"data": state}, pair)
            if z_mm is None:
                write(topics.CATHETER, encode_delete(header, "catheter"), pair)
                continue
            pose = encode_pose_stamped(shift(z_mm), header)
            write(topics.MOTION, pose, pair)
            write(topics.MOTION_RAW, pose, pair)
            write(
                topics.MOTION_WITH_COVARIANCE,
                encode_pose_with_covariance_stamped(shift(z_mm), covariance, header),
                pair,
            )
            write(topics.CATHETER, encode_line_strip(apply(shift(z_mm), loop()), header, "catheter"), pair)
    return path
