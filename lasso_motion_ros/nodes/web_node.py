"""The node behind the page: listens to the contract's topics, publishes clicks, calls the tracker's services."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Header, String
from visualization_msgs.msg import Marker

from lasso_motion_ros.config.web import WebConfig
from lasso_motion_ros.core.errors import LassoMotionError, TrackingError
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.nodes.configured_node import ConfiguredNode
from lasso_motion_ros.nodes.page_services import DRAWINGS, TRIGGERS, PageServices
from lasso_motion_ros.nodes.plane_inputs import OverlayInputs, PlaneInputs
from lasso_motion_ros.nodes.qos import qos, topic_publisher, topic_subscription
from lasso_motion_ros.nodes.running import guarded
from lasso_motion_ros.nodes.steady_timer import steady_timer
from lasso_motion_ros.tracking.tracker import TrackerState
from lasso_motion_ros.web import protocol
from lasso_motion_ros.web.live_stream import LiveStream
from lasso_motion_ros.web.plain_words import in_plain_words
from lasso_motion_ros.web.recorded_rounds import recorded_stamp
from lasso_motion_ros.web.server import WebServer
from lasso_motion_ros.web.source import PageView, Picture, TracePoint
from msg_adapters.messages import header_fields, stamp_to_ns
from msg_adapters.seeds import MINIMUM_CLICKS, encode_polygon, encode_seeds_file
from msg_adapters.sync.plane_source import plane_sources
from msg_adapters.topics import (
    CATHETER,
    DIAGNOSTICS,
    MOTION,
    MOTION_WITH_COVARIANCE,
    PROPOSAL,
    STATE,
    overlay_topic,
    seed_topic,
    tracking_topic,
)

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Waits:
    """How long the page waits for the rest of the graph.

    Attributes:
        graph_s: between two looks at which nodes there are.
        hold_s: for the tracker's picture of the pair that it holds.
        held_after_seed_s: how long the tracker goes on holding the clicked pair; clicks travel on topics, and may come
            after the service call that lets the pair go.
        pairs_before_clicks: of a new run, before clicks are given again: by then the tracker knows of that run too, and
            does not take them for clicks on the last one.
        holder_idle_s: after this long without a click the page that holds a pair may lose it to another.
    """

    graph_s: float = 0.25
    hold_s: float = 1.5
    held_after_seed_s: float = 3.0
    pairs_before_clicks: int = 3
    holder_idle_s: float = 120.0


_WAITS = _Waits()
_GONE_BY = "is not among the last"  # of a recording over and over: the clicks count in its next round


class WebNode(ConfiguredNode[WebConfig]):
    """Wiring: callbacks fill the live stream, the server's threads read it and command.

    Raises:
        ConfigurationError: a parameter that is unknown, of the wrong type or out of range.
    """

    def __init__(self) -> None:
        super().__init__("lasso_web", WebConfig)
        config = self._config = self.declared
        self._sources = plane_sources(config)
        self._stream = LiveStream(
            config.sync, self._sources, config.tracker, config.world_frame, config.answer_wait_s, config.axes
        )
        names = tuple(config.allowed_hosts.replace(",", " ").split())
        self._server = WebServer(self, config.host, config.port, names)
        self._changed: Callable[[], None] = lambda: None
        self._seeds = {plane: topic_publisher(self, self.messages, seed_topic(plane)) for plane in PLANES}
        self._page_services = PageServices(self, config.tracker, config.overlay)
        self._overlays = OverlayInputs(self, self._on_overlay, self._on_drawn)
        self._graph: dict[str, Any] = {"overlay": False, "drawing": None}
        self._wanted: frozenset[PageView] = frozenset()
        self._open: frozenset[int] = frozenset()
        self._holder: int | None = None  # the page whose user clicks; there is one, since the tracker holds one pair
        self._holder_active_at = 0.0
        self._holding = threading.Lock()
        self._unfreeze_at: float | None = None
        self._sent: dict[Plane, tuple[int, Any]] = {}
        self._waits_for_answer = False
        self._taken = False
        self._again = False
        self._runs = 0

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
        steady_timer(self, _WAITS.graph_s, self._on_timer)
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
        holder = self._holder
        return {
            "mode": "live",
            **self._stream.status(),
            **self._graph,
            "held": holder == page,
            "held_elsewhere": holder not in (None, page),
            "sent": self._waits_for_answer,
            "taken": self._taken,
            "has_clicks": bool(self._sent),
            "clicks": MINIMUM_CLICKS,
        }

    def picture(self, view: PageView, page: int) -> Picture | None:
        """See `Source.picture`; who looks on sees the stream, while another clicks."""
        return self._stream.picture(view, held=self._holder == page)

    def trace(self, after: int) -> list[TracePoint]:
        """See `Source.trace`."""
        return self._stream.trace(after)

    def millimetres_per_pixel(self, page: int) -> Mapping[Plane, float]:
        """See `Source.millimetres_per_pixel`."""
        pair = self._stream.held
        if pair is None or self._holder != page:
            return {}
        self._holder_active_at = time.monotonic()
        return {plane: frame.projection.millimetres_per_pixel(np.zeros(3)) for plane, frame in pair.frames.items()}

    def clicks_file(self, body: Mapping[str, Any], page: int) -> str:
        """See `Source.clicks_file`."""
        pair = self._stream.held
        if pair is not None and self._holder == page:
            self._holder_active_at = time.monotonic()
            points = {plane: protocol.points(body, plane, fewest=MINIMUM_CLICKS) for plane in PLANES}
            clicks = {plane: (frame.stamp_ns, points[plane]) for plane, frame in pair.frames.items()}
        else:
            clicks = dict(self._sent)
        if len(clicks) < len(PLANES):
            raise TrackingError("There are no clicks yet: press S, and click along the loop in both planes.")
        rounds = self._config.rounds
        published = {plane: self._published(plane, *clicks[plane]) for plane in PLANES}
        return encode_seeds_file(
            {
                p: (recorded_stamp(at, rounds.first_ns, rounds.period_ns), points)
                for p, (at, points) in published.items()
            }
        )

    def _published(self, plane: Plane, stamp_ns: int, points: Array) -> tuple[int, Array]:
        """Clicks on a frame as those on the published picture: under its stamp, in its pixels."""
        source = self._sources[plane]
        return source.published_ns(stamp_ns), source.in_picture(points)

    def watch(self, on_change: Callable[[], None]) -> None:
        """See `Source.watch`."""
        self._changed = on_change

    def audience(self, views: Mapping[int, PageView]) -> None:
        """See `Source.audience`; a viewer who leaves must not leave the picture frozen."""
        self._wanted, self._open = frozenset(views.values()), frozenset(views)
        if self._holder is not None and self._holder not in views:
            self._let_go()

    def command(self, name: str, body: Mapping[str, Any], page: int) -> str:
        """See `Source.command`."""
        if name == "hold":
            return self._hold_for(page)
        if name == "release":
            if self._holder == page:
                self._let_go()
            return ""
        if name == "seed":
            return self._seed(body, page)
        if name == "style":
            return self._change_style(protocol.text("drawing", body, DRAWINGS))
        if name in TRIGGERS:
            return self._trigger(name)
        raise TrackingError(f"{name} belongs to the drawing of centrelines")

    def _hold_for(self, page: int) -> str:
        with self._holding:
            idle_s = time.monotonic() - self._holder_active_at
            if self._holder not in (None, page) and idle_s < _WAITS.holder_idle_s:
                raise TrackingError(
                    "Somebody is setting clicks in another window. Finish or cancel there; if nothing is clicked "
                    f"there, this window can in {_WAITS.holder_idle_s - idle_s:.0f} s."
                )
            try:
                self._hold()
            except LassoMotionError:
                if self._holder is None:  # the tracker may hold a pair all the same, and has only not said so in time
                    self._let_go()
                raise
            self._holder, self._holder_active_at = page, time.monotonic()
            if page not in self._open:  # closed meanwhile: nobody else would let the pair go
                self._let_go()
        return ""

    def _hold(self) -> None:
        """Hold a pair here, the one that the tracker holds if it can hold one."""
        self._unfreeze_at = None
        if not self._page_services.can_freeze:
            self._stream.hold(self._stream.whole_pairs())
            return
        stamps: dict[Plane, int] = {}
        complete = threading.Event()
        frozen = threading.Event()

        def take(plane: Plane, message: Image) -> None:
            if frozen.is_set():
                stamps[plane] = stamp_to_ns(message.header.stamp)
                if len(stamps) == len(PLANES):
                    complete.set()

        # Only the tracker's picture says which pair it holds.
        listening = [
            self.create_subscription(Image, tracking_topic(plane).name, partial(take, plane), qos(depth=1))
            for plane in PLANES
        ]
        before = self._stream.whole_pairs()
        try:
            is_held = self._page_services.freeze()
            frozen.set()
            pairs = list(dict.fromkeys([*before, *self._stream.whole_pairs()]))
            if is_held:
                complete.wait(_WAITS.hold_s)
            self._stream.hold(pairs, stamps if complete.is_set() else None)
        finally:
            for one in listening:
                self.destroy_subscription(one)

    def _let_go(self, unfreeze_after_s: float = 0.0) -> None:
        self._holder = None
        self._stream.release()
        self._unfreeze_at = time.monotonic() + unfreeze_after_s

    def _seed(self, body: Mapping[str, Any], page: int) -> str:
        """Send the clicks, and wait for the tracker's answer; where it refuses them, the pair stays held."""
        pair = self._stream.held
        if pair is None or self._holder != page:
            raise TrackingError("No picture is held in this window any more. Press S, and click again.")
        clicks = {plane: protocol.points(body, plane, fewest=MINIMUM_CLICKS) for plane in PLANES}
        self._holder_active_at = time.monotonic()
        sent_before = dict(self._sent)
        sent = {plane: (frame.stamp_ns, clicks[plane]) for plane, frame in pair.frames.items()}
        sent = self._sent = sent_before | sent
        before = self._stream.answers.counts
        self._waits_for_answer, self._again, self._taken = True, False, False
        self._publish_clicks()
        refusal = None if before is None else self._stream.answers.wait(before)
        if refusal and not (self._stream.new_runs and _GONE_BY in refusal):
            # The model before goes on, and with it the clicks that it is from, for every round of the recording.
            if self._sent is sent:  # else it was reset meanwhile, and stays so
                self._sent = sent_before
            self._waits_for_answer = False
            self._changed()
            raise TrackingError(f"{in_plain_words(refusal)} Your clicks are still there.")
        if self._holder == page:
            self._let_go(_WAITS.held_after_seed_s)
        if refusal == "":
            self._waits_for_answer = False
            return "The tracker has taken the clicks."
        if self._stream.new_runs:
            return "The clicked picture has gone by. The clicks count when it comes again."
        return "The clicks are sent; the tracker has not answered yet. If nothing follows, press S and click again."

    def _publish_clicks(self) -> None:
        for plane, (stamp_ns, clicks) in self._sent.items():
            at_ns, points = self._published(plane, stamp_ns, clicks)
            fields = encode_polygon(points, header_fields(at_ns))
            self._seeds[plane].publish(self.messages.make(seed_topic(plane).type_name, fields))

    def _trigger(self, name: str) -> str:
        if name == "reset":
            self._sent, self._again, self._waits_for_answer, self._taken = {}, False, False, False
        return self._page_services.trigger(name)

    def _change_style(self, drawing: str) -> str:
        self._page_services.set_drawing(drawing)
        self._show_drawing(drawing)
        return ""

    def _show_drawing(self, drawing: str) -> None:
        self._graph["drawing"] = drawing

    # What comes in.

    @guarded
    def _on_image(self, plane: Plane, message: Image | CompressedImage) -> None:
        self._complain(plane, self._stream.add_image(plane, message))
        if self._stream.new_runs != self._runs:
            self._runs = self._stream.new_runs
            # A recording played in a loop: clicks on one of its pairs hold for every round.
            self._again = bool(self._sent)
        waiting = self._stream.state == TrackerState.WAITING_FOR_SEED.value
        if self._again and waiting and self._stream.pairs_of_run >= _WAITS.pairs_before_clicks:
            self._again, self._waits_for_answer = False, True
            self._publish_clicks()
        self._changed()

    @guarded
    def _on_camera_info(self, plane: Plane, message: CameraInfo, latched: bool) -> None:
        self._complain(plane, self._stream.add_camera_info(plane, message, latched=latched))
        self._changed()

    @guarded
    def _on_state(self, message: String) -> None:
        self._stream.add_state(message.data)
        if self._stream.has_pose:
            self._waits_for_answer = False
            self._taken = bool(self._sent)
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
        if self._unfreeze_at is not None and time.monotonic() >= self._unfreeze_at and self._stream.held is None:
            self._unfreeze_at = None
            self._page_services.unfreeze()

    def _complain(self, plane: Plane, complaints: list[str]) -> None:
        for complaint in complaints:
            self.complaints.complain(f"plane_{plane}", complaint)
