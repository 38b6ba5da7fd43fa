"""The overlay node: images and motion in, pictures with the moved surface out."""

from __future__ import annotations

import dataclasses
import os
import threading
import time
from typing import Any

import numpy as np
import numpy.typing as npt
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import String
from visualization_msgs.msg import Marker

from lasso_motion_ros.config.overlay import OverlayConfig
from lasso_motion_ros.core.errors import MessageError
from lasso_motion_ros.geometry.frames import PLANES, Frame, Plane
from lasso_motion_ros.nodes.configured_node import ConfiguredNode
from lasso_motion_ros.nodes.parameters import LiveParameters
from lasso_motion_ros.nodes.plane_inputs import PlaneInputs
from lasso_motion_ros.nodes.qos import topic_publisher, topic_subscription
from lasso_motion_ros.nodes.running import guarded
from lasso_motion_ros.nodes.steady_timer import steady_timer
from lasso_motion_ros.overlay.motion_history import Choice, MotionHistory
from lasso_motion_ros.overlay.painter import OverlayPainter
from lasso_motion_ros.overlay.reference_anatomy import read_reference_anatomy
from lasso_motion_ros.overlay.style import overlay_style
from msg_adapters.images import encode_image
from msg_adapters.input_bytes import ReadCameraInfo, ReadImage
from msg_adapters.markers import DELETE, decode_points, encode_delete, encode_triangles
from msg_adapters.messages import header_fields, stamp_to_ns
from msg_adapters.poses import decode_covariance, decode_pose, encode_pose
from msg_adapters.sync.calibrated_frames import CalibratedFrames
from msg_adapters.sync.plane_source import plane_sources
from msg_adapters.topics import (
    CATHETER,
    IMAGE_TYPE,
    MOTION,
    MOTION_WITH_COVARIANCE,
    OVERLAY_SURFACE,
    STATE,
    STATE_VALID_S,
    overlay_drawn_topic,
    overlay_topic,
)

Array = npt.NDArray[np.float64]

SURFACE_PERIOD_S = 1.0
LOOK_PERIOD_S = 0.25
"""Between two looks whether the tracker still says something; two that lie four times as far apart were held up."""
SURFACE_NAMESPACE = "surface"


@dataclasses.dataclass(frozen=True)
class _UndrawnImage:
    """An image that waits for its motion, until `deadline` (steady clock, seconds)."""

    frame: Frame
    deadline: float


class OverlayNode(ConfiguredNode[OverlayConfig]):
    """Callbacks store, one thread draws; of each plane only the newest image is kept.

    Raises:
        ConfigurationError: a parameter that is unknown, of the wrong type or out of range.
        SurfaceError: a surface that cannot be read.
        VolumeError: a volume that cannot be read.
    """

    def __init__(self) -> None:
        super().__init__("lasso_overlay", OverlayConfig)
        self._config = self.declared
        shown = read_reference_anatomy(self._config)
        self.get_logger().info(shown.description)
        self._surface = shown.surface
        # Keeps the drawing of the static surface from image to image; only the drawing thread uses it.
        self._painter = OverlayPainter(shown.drawn, overlay_style(self._config.style))
        self._marker: Any = None
        self._surface_shown = False
        self._history = MotionHistory(self._config)
        self._frames: dict[Plane, CalibratedFrames] = {
            plane: CalibratedFrames(source=source) for plane, source in plane_sources(self._config).items()
        }
        self._frame_ids: dict[Plane, str] = {}
        self._undrawn: dict[Plane, _UndrawnImage] = {}
        self._compensated: dict[Plane, Frame] = {}  # what the last picture shows, where it is compensated
        self._heard_s: float | None = None
        self._looked_s = 0.0
        self._changed = threading.Condition()
        self._stopping = False
        self._pictures = {plane: topic_publisher(self, self.messages, overlay_topic(plane)) for plane in PLANES}
        self._drawn = {plane: topic_publisher(self, self.messages, overlay_drawn_topic(plane)) for plane in PLANES}
        self._surfaces = topic_publisher(self, self.messages, OVERLAY_SURFACE)
        self._thread = threading.Thread(target=self._draw_all, name="overlay", daemon=True)

    def start(self) -> None:
        """Listen and draw."""
        for topic, callback in (
            (STATE, self._on_state),
            (MOTION, self._on_motion),
            (MOTION_WITH_COVARIANCE, self._on_covariance),
            (CATHETER, self._on_catheter),
        ):
            topic_subscription(self, self.messages, topic, callback)
        self._inputs = PlaneInputs(self, self._on_image, self._on_camera_info)
        self._live = LiveParameters(self, self._config, self._on_tuning)
        # Viewers that come later, or get no images at all, must learn too that nothing is compensated.
        steady_timer(self, SURFACE_PERIOD_S, self._on_surface_timer)
        steady_timer(self, LOOK_PERIOD_S, self._on_look)
        self._thread.start()

    def close(self) -> None:
        """End the thread that draws."""
        with self._changed:
            self._stopping = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join()

    def _on_tuning(self, config: OverlayConfig) -> None:
        self._painter.style = overlay_style(config.style)

    @guarded
    def _on_state(self, message: String) -> None:
        self._heard_s = time.monotonic()
        self._take_state(message.data)

    @guarded
    def _on_look(self) -> None:
        """A tracker that says nothing any more may have been killed in the middle of TRACKING."""
        now, looked_s = time.monotonic(), self._looked_s
        self._looked_s = now
        if self._heard_s is None or now - looked_s > 4.0 * LOOK_PERIOD_S:
            return
        silent_s = now - self._heard_s
        if silent_s > STATE_VALID_S:
            self._take_state(f"tracker silent for {silent_s:.0f} s")

    def _take_state(self, state: str) -> None:
        with self._changed:
            self._history.add_state(state)
            compensated = self._history.has_pose
            if not compensated:
                # No new image may come: the last picture must not go on showing a compensated place.
                for plane, frame in self._compensated.items():
                    self._undrawn.setdefault(plane, _UndrawnImage(frame, time.monotonic()))
                self._compensated.clear()
            self._changed.notify()
        if not compensated and self._surface_shown:
            self._publish_surface(0, None)

    @guarded
    def _on_motion(self, message: PoseStamped) -> None:
        if message.header.frame_id != self._config.world_frame:
            raise MessageError(f"motion is in frame {message.header.frame_id!r}, expected {self._config.world_frame!r}")
        motion = decode_pose(message)
        self._heard_s = time.monotonic()
        with self._changed:
            self._history.add_motion(stamp_to_ns(message.header.stamp), motion)
            compensated = self._history.has_pose
            self._changed.notify()
        if compensated:
            self._publish_surface(stamp_to_ns(message.header.stamp), motion)

    @guarded
    def _on_covariance(self, message: PoseWithCovarianceStamped) -> None:
        covariance = decode_covariance(message)
        if covariance is None or message.header.frame_id != self._config.world_frame:
            return
        with self._changed:
            self._history.add_covariance(stamp_to_ns(message.header.stamp), covariance)
            self._changed.notify()

    @guarded
    def _on_catheter(self, message: Marker) -> None:
        if message.action == DELETE or message.header.frame_id != self._config.world_frame:
            return
        loop = decode_points(message)
        with self._changed:
            self._history.add_loop(stamp_to_ns(message.header.stamp), loop)
            self._changed.notify()

    @guarded
    def _on_camera_info(self, plane: Plane, message: ReadCameraInfo, latched: bool) -> None:
        self._take(plane, self._frames[plane].add_camera_info(message, latched=latched))

    @guarded
    def _on_image(self, plane: Plane, message: ReadImage | CompressedImage) -> None:
        self._frame_ids[plane] = message.header.frame_id
        self._take(plane, self._frames[plane].add_image(message))

    def _take(self, plane: Plane, frames: list[Frame]) -> None:
        deadline = time.monotonic() + self._config.motion_wait_s
        with self._changed:
            for frame in frames:
                self._history.add_image(plane, frame.stamp_ns)
                self._undrawn[plane] = _UndrawnImage(frame, deadline)
            self._changed.notify()
        for complaint in self._frames[plane].take_complaints():
            self.complaints.complain(f"plane_{plane}", complaint)

    def _draw_all(self) -> None:
        os.nice(self._config.niceness)  # on Linux this thread only: messages are still taken at once
        while True:
            with self._changed:
                while not (ready := self._take_ready()):
                    if self._stopping:
                        return
                    deadlines = [waiting.deadline for waiting in self._undrawn.values()]
                    self._changed.wait(max(0.0, min(deadlines) - time.monotonic()) if deadlines else None)
            for plane, frame in ready:
                try:
                    self._draw_newest(plane, frame)
                except Exception as error:
                    self.complaints.error(error)

    def _take_ready(self) -> list[tuple[Plane, Frame]]:
        """All that can be drawn now, the longest waiting first; nothing once the node ends.

        Both planes at once: where drawing is slower than the images, planes taken one after the other would always be
        of two pairs, and a viewer of both would never have both of one.
        """
        if self._stopping:
            return []
        now = time.monotonic()
        ready = [
            (plane, waiting.frame)
            for plane, waiting in sorted(self._undrawn.items(), key=lambda one: one[1].deadline)
            if waiting.deadline <= now or self._history.answered(plane, waiting.frame.stamp_ns)
        ]
        for plane, _ in ready:
            del self._undrawn[plane]
        return ready

    def _draw_newest(self, plane: Plane, frame: Frame) -> None:
        with self._changed:
            if self._stopping:
                return
            choice = self._history.choose(plane, frame.stamp_ns)
            self._compensated.pop(plane, None)
            if choice.motion is not None:
                self._compensated[plane] = frame
        if choice.motion is None and self._surface_shown:
            self._publish_surface(frame.stamp_ns, None)
        self._draw(plane, frame, choice)

    def _draw(self, plane: Plane, frame: Frame, choice: Choice) -> None:
        publisher = self._pictures[plane]
        if publisher.get_subscription_count() == 0:
            return
        picture = self._painter.draw(
            frame.pixels,
            frame.projection,
            choice.motion,
            choice.status,
            loop=choice.loop,
            covariance=choice.covariance,
        )
        drawn = header_fields(frame.stamp_ns, "" if choice.motion is None else self._config.world_frame)
        self._drawn[plane].publish(self.messages.make(overlay_drawn_topic(plane).type_name, drawn))
        header = header_fields(frame.stamp_ns, self._frame_ids[plane])
        publisher.publish(self.messages.make(IMAGE_TYPE, encode_image(picture, header)))

    @guarded
    def _on_surface_timer(self) -> None:
        with self._changed:
            compensated = self._history.has_pose
        if not compensated:
            self._publish_surface(0, None)

    def _publish_surface(self, stamp_ns: int, motion: Array | None) -> None:
        if self._surfaces.get_subscription_count() == 0:
            return
        header = header_fields(stamp_ns, self._config.world_frame)
        self._surface_shown = motion is not None
        if motion is None:
            fields = encode_delete(header, SURFACE_NAMESPACE)
            self._surfaces.publish(self.messages.make(OVERLAY_SURFACE.type_name, fields))
            return
        if self._marker is None:
            fields = encode_triangles(self._surface.vertices, self._surface.triangles, header, SURFACE_NAMESPACE)
            self._marker = self.messages.make(OVERLAY_SURFACE.type_name, fields)
        # The vertices stay: moving them by the marker's pose saves building tens of thousands of points per pair.
        placed = self.messages.make("visualization_msgs/msg/Marker", {"header": header, "pose": encode_pose(motion)})
        self._marker.header, self._marker.pose = placed.header, placed.pose
        self._surfaces.publish(self._marker)
