"""The node behind the page: listens to the contract's topics, publishes clicks, calls the tracker's services."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header, String
from visualization_msgs.msg import Marker

from lasso_motion_ros.config.web import WebConfig
from lasso_motion_ros.core.errors import TrackingError
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.nodes.configured_node import ConfiguredNode
from lasso_motion_ros.nodes.page_clicks import PageClicks
from lasso_motion_ros.nodes.page_services import DRAWINGS, TRIGGERS, PageServices
from lasso_motion_ros.nodes.plane_inputs import OverlayInputs, PlaneInputs
from lasso_motion_ros.nodes.qos import qos, topic_subscription
from lasso_motion_ros.nodes.running import guarded
from lasso_motion_ros.nodes.steady_timer import steady_timer
from lasso_motion_ros.web import protocol
from lasso_motion_ros.web.live_stream import LiveStream
from lasso_motion_ros.web.server import WebServer
from lasso_motion_ros.web.source import PageView, Picture, TracePoint
from msg_adapters.input_bytes import ReadCameraInfo, ReadImage
from msg_adapters.sync.plane_source import plane_sources
from msg_adapters.topics import (
    CATHETER,
    DIAGNOSTICS,
    MOTION,
    MOTION_WITH_COVARIANCE,
    PROPOSAL,
    STATE,
    overlay_topic,
)

GRAPH_S = 0.25  # between two looks at which nodes there are


class WebNode(ConfiguredNode[WebConfig]):
    """Wiring: callbacks fill the live stream, the server's threads read it and command.

    Raises:
        ConfigurationError: a parameter that is unknown, of the wrong type or out of range.
    """

    def __init__(self) -> None:
        super().__init__("lasso_web", WebConfig)
        config = self._config = self.declared
        sources = plane_sources(config)
        self._stream = LiveStream(
            config.sync, sources, config.tracker, config.world_frame, config.answer_wait_s, config.axes
        )
        names = tuple(config.allowed_hosts.replace(",", " ").split())
        self._server = WebServer(self, config.host, config.port, names)
        self._changed: Callable[[], None] = lambda: None
        self._page_services = PageServices(self, config.tracker, config.overlay)
        self._clicks = PageClicks(self, self._stream, self._page_services, sources, config.rounds, self._tell_change)
        self._overlays = OverlayInputs(self, self._on_overlay, self._on_drawn)
        self._graph: dict[str, Any] = {"overlay": False, "drawing": None}
        self._wanted: frozenset[PageView] = frozenset()

    def start(self) -> None:
        """Listen on the topics and for browsers.

        Raises:
            LassoMotionError: the port cannot be had.
        """
        for topic, callback in (
            (STATE, self._on_state),
            (MOTION, self._on_motion),
            (MOTION_WITH_COVARIANCE, self._on_covariance),
            (CATHETER, self._on_catheter),
            (PROPOSAL, self._on_proposal),
        ):
            topic_subscription(self, self.messages, topic, callback)
        self.create_subscription(
            DiagnosticArray, DIAGNOSTICS.name, self._on_diagnostics, qos(depth=DIAGNOSTICS.depth, reliable=False)
        )
        self._inputs = PlaneInputs(self, self._on_image, self._on_camera_info)
        steady_timer(self, GRAPH_S, self._on_timer)
        self._server.start()
        self.get_logger().info(f"the page is at {self._server.url}")
        if not self._server.is_local:
            self.get_logger().warning(
                f"listening on {self._config.host}: whoever reaches port {self._config.port} can seed and reset the "
                "tracker; there is no login"
            )

    def close(self) -> None:
        """End the server."""
        self._server.stop()

    # What the server asks (see `Source`).

    def status(self, page: int) -> dict[str, Any]:
        """See `Source.status`."""
        return {"mode": "live", **self._stream.status(), **self._graph, **self._clicks.status(page)}

    def picture(self, view: PageView, page: int) -> Picture | None:
        """See `Source.picture`; who looks on sees the stream, while another clicks."""
        return self._stream.picture(view, held=self._clicks.is_held_by(page))

    def trace(self, after: int) -> list[TracePoint]:
        """See `Source.trace`."""
        return self._stream.trace(after)

    def millimetres_per_pixel(self, page: int) -> Mapping[Plane, float]:
        """See `Source.millimetres_per_pixel`."""
        return self._clicks.millimetres_per_pixel(page)

    def clicks_file(self, body: Mapping[str, Any], page: int) -> str:
        """See `Source.clicks_file`."""
        return self._clicks.clicks_file(body, page)

    def watch(self, on_change: Callable[[], None]) -> None:
        """See `Source.watch`."""
        self._changed = on_change

    def audience(self, views: Mapping[int, PageView]) -> None:
        """See `Source.audience`; a viewer who leaves must not leave the picture frozen."""
        self._wanted = frozenset(views.values())
        self._clicks.audience(views)

    def command(self, name: str, body: Mapping[str, Any], page: int) -> str:
        """See `Source.command`."""
        if name == "hold":
            return self._clicks.hold(page)
        if name == "release":
            return self._clicks.release(page)
        if name == "seed":
            return self._clicks.seed(body, page)
        if name == "style":
            return self._change_style(protocol.text("drawing", body, DRAWINGS))
        if name in TRIGGERS:
            return self._trigger(name)
        raise TrackingError(f"{name} belongs to the drawing of centrelines")

    def _trigger(self, name: str) -> str:
        if name == "reset":
            self._clicks.forget()
        return self._page_services.trigger(name)

    def _change_style(self, drawing: str) -> str:
        self._page_services.set_drawing(drawing)
        self._show_drawing(drawing)
        return ""

    def _show_drawing(self, drawing: str) -> None:
        self._graph["drawing"] = drawing

    def _tell_change(self) -> None:
        self._changed()

    # What comes in.

    @guarded
    def _on_image(self, plane: Plane, message: ReadImage | CompressedImage) -> None:
        self._complain(plane, self._stream.add_image(plane, message))
        self._clicks.look_at_run()
        self._changed()

    @guarded
    def _on_camera_info(self, plane: Plane, message: ReadCameraInfo, latched: bool) -> None:
        self._complain(plane, self._stream.add_camera_info(plane, message, latched=latched))
        self._changed()

    @guarded
    def _on_state(self, message: String) -> None:
        self._stream.add_state(message.data)
        if self._stream.has_pose:
            self._clicks.answered()
        self._changed()

    @guarded
    def _on_motion(self, message: PoseStamped) -> None:
        self._stream.add_motion(message)
        self._changed()

    @guarded
    def _on_covariance(self, message: PoseWithCovarianceStamped) -> None:
        self._stream.add_motion_with_covariance(message)

    @guarded
    def _on_catheter(self, message: Marker) -> None:
        self._stream.add_catheter(message)
        self._changed()

    @guarded
    def _on_proposal(self, message: Marker) -> None:
        self._stream.add_proposal(message)
        self._changed()

    @guarded
    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self._stream.add_diagnostics(message)
        self._changed()

    @guarded
    def _on_overlay(self, plane: Plane, message: Image) -> None:
        self._stream.add_overlay(plane, message)
        self._changed()

    @guarded
    def _on_drawn(self, plane: Plane, message: Header) -> None:
        self._stream.add_overlay_drawn(plane, message)
        self._changed()

    @guarded
    def _on_timer(self) -> None:
        self._stream.tracker_is_present(self.count_publishers(STATE.name) > 0)
        self._graph["overlay"] = all(self.count_publishers(overlay_topic(plane).name) for plane in PLANES)
        if not self._graph["overlay"]:
            self._graph["drawing"] = None
        elif self._graph["drawing"] is None:
            self._page_services.ask_drawing(self._show_drawing)
        self._overlays.listen("overlay" in self._wanted and self._graph["overlay"])
        self._clicks.look()

    def _complain(self, plane: Plane, complaints: list[str]) -> None:
        for complaint in complaints:
            self.complaints.complain(f"plane_{plane}", complaint)
