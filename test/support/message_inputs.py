"""Messages of a small biplane stream, and a tracker that only says what it was given."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import SeedError
from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.frames import Frame, FramePair, Plane, Seed
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import rigid
from lasso_motion_ros.tracking.tracker import TrackerState, TrackResult
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.images import encode_image
from msg_adapters.messages import header_fields
from msg_adapters.recorded_messages import RecordedMessages
from msg_adapters.seeds import encode_polygon
from msg_adapters.topics import camera_info_topic, image_topic, seed_topic

MESSAGES = RecordedMessages()
START_NS = 1_760_000_000_000_000_000
PERIOD_NS = 333_333_333
SIDE = 32


def projection(plane: Plane) -> Projection:
    return carm_projection(
        np.deg2rad(-30.0 if plane == "a" else 60.0),
        0.0,
        source_detector_m=1.2,
        source_object_m=0.785,
        pixel_size_m=0.2e-3 * 1024 / SIDE,
        width=SIDE,
        height=SIDE,
    )


def stamp(index: int, offset_ns: int = 0) -> int:
    return START_NS + index * PERIOD_NS + offset_ns


def image(stamp_ns: int, value: int | None = None, side: int = SIDE) -> Any:
    """A picture of one grey value; unless that is given, another one at each stamp, as no exposure is as the last."""
    grey = 50 + (stamp_ns - START_NS) // 1_000 % 151 if value is None else value
    pixels = np.full((side, side), grey, np.uint8)
    return MESSAGES.make("sensor_msgs/msg/Image", encode_image(pixels, header_fields(stamp_ns, "xray")))


def camera_info(plane: Plane, stamp_ns: int = 0, **fields: Any) -> Any:
    encoded = encode_camera_info(projection(plane), header_fields(stamp_ns, "xray")) | fields
    return MESSAGES.make("sensor_msgs/msg/CameraInfo", encoded)


def seed(stamp_ns: int, count: int = 8) -> Any:
    angle = np.linspace(0.0, 5.5, count)
    points = 16.0 + 8.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    return MESSAGES.make("geometry_msgs/msg/PolygonStamped", encode_polygon(points, header_fields(stamp_ns)))


def stream(
    pairs: int, seeded: int | None = 0, offset_ns: int = 0, start: int = 0
) -> Iterator[tuple[str, str, Any, int]]:
    """(topic, type, message, log time) of a stream with per-frame calibration, seeded on one pair."""
    for index in range(start, start + pairs):
        for plane, shift in (("a", 0), ("b", offset_ns)):
            at = stamp(index, shift)
            info, picture, clicks = camera_info_topic(plane), image_topic(plane), seed_topic(plane)
            yield info.recorded_name, info.type_name, camera_info(plane, at), at  # type: ignore[arg-type]
            yield picture.recorded_name, picture.type_name, image(at, 50 + index), at + 1000
            if index == seeded:
                yield clicks.recorded_name, clicks.type_name, seed(at), at + 2000


class FakeTracker:
    """Moves 1 mm in x per pair since the seed; loses a pair whose plane is missing; refuses seeds when told."""

    def __init__(self, refuse: bool = False) -> None:
        self.refuse = refuse
        self.state = TrackerState.TRACKING
        self.calls: list[tuple[str, int]] = []
        self.reference_ns = 0
        self.count = 0

    def initialise(self, pair: FramePair, seed: Seed) -> TrackResult:
        self.calls.append(("initialise", pair.stamp_ns))
        if self.refuse:
            raise SeedError("no loop here")
        assert pair.a is not None
        assert pair.b is not None
        assert seed.points_a.shape[1] == seed.points_b.shape[1] == 2
        self.count, self.reference_ns = 0, pair.stamp_ns
        return self._result(pair)

    def track(self, pair: FramePair) -> TrackResult:
        self.calls.append(("track", pair.stamp_ns))
        self.count += 1
        return self._result(pair)

    def prepare(self, frame: Frame) -> None:
        self.calls.append(("prepare", frame.stamp_ns))

    def learn(self) -> None:
        pass

    def leave_out(self, pair: FramePair) -> None:
        self.calls.append(("leave_out", pair.stamp_ns))

    def reset(self) -> None:
        self.calls.append(("reset", 0))

    def reconfigure(self, config: TrackerConfig) -> None:
        self.calls.append(("reconfigure", config.search.candidates))

    def set_reference(self) -> None:
        self.calls.append(("set_reference", 0))

    def _result(self, pair: FramePair) -> TrackResult:
        if pair.a is None or pair.b is None:
            return TrackResult(
                pair.stamp_ns, TrackerState.LOST, "a plane is missing", None, None, None, self.reference_ns
            )
        angle = np.linspace(0.0, 2.0 * np.pi, 64)
        loop = 0.01 * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
        motion = rigid((0, 0, 0), (1e-3 * self.count, 0, 0))
        covariance = np.eye(6) * 1e-8
        return TrackResult(
            pair.stamp_ns,
            self.state,
            "",
            motion,
            covariance,
            loop,
            self.reference_ns,
            residual_px={"a": 0.5, "b": 0.4},
            temporal_filter={"a": 0.35},
        )
