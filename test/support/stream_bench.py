"""The page's view of a live graph, fed with messages by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
from support.drawn_recording import SIDE, loop, projections, shift, stamp

from lasso_motion_ros.config.stream import SyncConfig
from lasso_motion_ros.config.web import WebConfig
from lasso_motion_ros.geometry.transforms import apply
from lasso_motion_ros.overlay.primitives import draw_banner
from lasso_motion_ros.web.live_stream import LiveStream
from msg_adapters import topics
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.images import encode_image
from msg_adapters.markers import encode_delete, encode_line_strip
from msg_adapters.messages import header_fields
from msg_adapters.poses import encode_pose_stamped
from msg_adapters.recorded_messages import RecordedMessages
from msg_adapters.sync.plane_source import plane_sources

WORLD = "patient_table"
MAKE = RecordedMessages().make


class StreamBench:
    """What the page shows of a live graph, with a clock that is set by hand."""

    def __init__(self, axes: str = "auto") -> None:
        self.now = 100.0
        self.stream = LiveStream(
            SyncConfig(), plane_sources(WebConfig()), "lasso_tracker", WORLD, 0.15, axes, clock=lambda: self.now
        )

    def image(self, plane: str, pair: int, calibration: str = "", shown: int | None = None) -> None:
        header = header_fields(stamp(pair), f"detector_{plane}")
        info = encode_camera_info(projections()[calibration or plane], header)
        assert self.stream.add_camera_info(plane, MAKE(topics.camera_info_topic(plane).type_name, info)) == []
        pixels = np.full((SIDE, SIDE), pair if shown is None else shown, np.uint8)
        assert self.stream.add_image(plane, MAKE(topics.IMAGE_TYPE, encode_image(pixels, header))) == []

    def pair(self, pair: int) -> None:
        self.image("a", pair)
        self.image("b", pair)

    def motion(self, pair: int, z_mm: float, frame: str = WORLD) -> None:
        fields = encode_pose_stamped(shift(z_mm), header_fields(stamp(pair), frame))
        self.stream.add_motion(MAKE(topics.MOTION.type_name, fields))

    def tracks(self) -> None:
        """A pose that belongs to no pair of the test."""
        self.stream.add_state("TRACKING")
        self.motion(1000, 0.0)

    def catheter(self, pair: int, z_mm: float | None, frame: str = WORLD) -> None:
        header = header_fields(stamp(pair), frame)
        points = apply(shift(z_mm or 0.0), loop())
        fields = encode_delete(header, "c") if z_mm is None else encode_line_strip(points, header, "c")
        self.stream.add_catheter(MAKE(topics.CATHETER.type_name, fields))

    def proposal(self, z_mm: float | None, frame: str = WORLD) -> None:
        header = header_fields(stamp(0), frame)
        points = apply(shift(z_mm or 0.0), loop())
        fields = encode_delete(header, "c") if z_mm is None else encode_line_strip(points, header, "c")
        self.stream.add_proposal(MAKE(topics.PROPOSAL.type_name, fields))

    def diagnostics(self, name: str, message: str, **values: str) -> None:
        entries = [{"key": key, "value": value} for key, value in values.items()]
        status = {"name": name, "message": message, "values": entries}
        self.stream.add_diagnostics(MAKE(topics.DIAGNOSTICS.type_name, {"status": [status]}))

    def overlay(self, plane: str, pair: int, **other: Any) -> None:
        fields = encode_image(np.full((SIDE, SIDE, 3), pair, np.uint8), header_fields(stamp(pair)))
        self.drawn(plane, pair, WORLD)
        self._overlay(plane, fields, **other)

    def static_overlay(self, plane: str, pair: int) -> None:
        """In grey words: a colour is not what tells it from the other."""
        picture = np.full((SIDE, SIDE, 3), pair, np.uint8)
        draw_banner(picture, "STATIC OVERLAY", (176, 176, 176))
        self._overlay(plane, encode_image(picture, header_fields(stamp(pair))))
        self.drawn(plane, pair, "")

    def drawn(self, plane: str, pair: int, frame: str) -> None:
        message = MAKE(topics.overlay_drawn_topic(plane).type_name, header_fields(stamp(pair), frame))
        self.stream.add_overlay_drawn(plane, message)

    def _overlay(self, plane: str, fields: dict[str, Any], **other: Any) -> None:
        self.stream.add_overlay(plane, MAKE(topics.IMAGE_TYPE, {**fields, **other}))

    def said(self) -> tuple[str, bool]:
        status = self.stream.status()
        return status["state"], status["has_pose"]

    def held(self) -> tuple[int, bool] | None:
        return self.shown(held=True)

    def shown(self, view: str = "film", *, held: bool = False) -> tuple[int, bool] | None:
        """Grey value of plane A's picture, which is its pair, and whether a loop is drawn."""
        picture = self.stream.picture(view, held=held)
        return (
            None if picture is None else (int(picture.planes["a"].pixels.flat[0]), picture.planes["a"].loop is not None)
        )
