"""The clicks of the page's users: one window at a time holds a pair, and its clicks go to the tracker."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
from rclpy.event_handler import SubscriptionEventCallbacks
from sensor_msgs.msg import Image

from lasso_motion_ros.config.web import RoundsConfig, WebConfig
from lasso_motion_ros.core.errors import LassoMotionError, TrackingError
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.nodes.configured_node import ConfiguredNode
from lasso_motion_ros.nodes.page_services import PageServices
from lasso_motion_ros.nodes.qos import qos, topic_publisher
from lasso_motion_ros.tracking.tracker import TrackerState
from lasso_motion_ros.web import protocol
from lasso_motion_ros.web.live_stream import LiveStream
from lasso_motion_ros.web.plain_words import in_plain_words
from lasso_motion_ros.web.recorded_rounds import recorded_stamp
from msg_adapters.messages import header_fields, stamp_to_ns
from msg_adapters.seeds import MINIMUM_CLICKS, encode_polygon, encode_seeds_file
from msg_adapters.sync.plane_source import PlaneSource
from msg_adapters.topics import seed_topic, tracking_topic

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Waits:
    """How long the page waits for the rest of the graph.

    Attributes:
        hold_s: for the tracker's picture of the pair that it holds.
        held_after_seed_s: how long the tracker goes on holding the clicked pair; clicks travel on topics, and may come
            after the service call that lets the pair go.
        pairs_before_clicks: of a new run, before clicks are given again: by then the tracker knows of that run too, and
            does not take them for clicks on the last one.
        holder_idle_s: after this long without a click the page that holds a pair may lose it to another.
    """

    hold_s: float = 1.5
    held_after_seed_s: float = 3.0
    pairs_before_clicks: int = 3
    holder_idle_s: float = 120.0


_WAITS = _Waits()
_GONE_BY = "is not among the last"  # of a recording over and over: the clicks count in its next round


class PageClicks:
    """Who holds a pair, which clicks were sent, and whether the tracker has taken them.

    The server's threads ask and command; the executor's thread tells of runs and states.

    Args:
        node: the page's node.
        stream: what the page shows; holds the pair.
        services: the tracker's services.
        sources: how pictures become frames, by plane.
        rounds: of a recording that is played over and over.
        on_change: is called when there is news for the page that comes with no message.
    """

    def __init__(
        self,
        node: ConfiguredNode[WebConfig],
        stream: LiveStream,
        services: PageServices,
        sources: Mapping[Plane, PlaneSource],
        rounds: RoundsConfig,
        on_change: Callable[[], None],
    ) -> None:
        self._node, self._stream, self._services = node, stream, services
        self._sources, self._rounds, self._on_change = sources, rounds, on_change
        self._seeds = {plane: topic_publisher(node, node.messages, seed_topic(plane)) for plane in PLANES}
        self._open: frozenset[int] = frozenset()
        self._holder: int | None = None  # the page whose user clicks; there is one, since the tracker holds one pair
        self._holder_active_at = 0.0
        self._holding = threading.Lock()
        self._unfreeze_at: float | None = None
        self._sent: dict[Plane, tuple[int, Any]] = {}
        self._waits_for_answer = False
        self._taken = False
        self._taken_in_run = 0
        self._again = False
        self._runs = 0

    def status(self, page: int) -> dict[str, Any]:
        """What a page is told of the clicks."""
        holder = self._holder
        return {
            "held": holder == page,
            "held_elsewhere": holder not in (None, page),
            "sent": self._waits_for_answer,
            # Else a tracker that waits again has been restarted, or reset elsewhere: it knows nothing of the clicks.
            "hold_for_rounds": self._taken and self._stream.new_runs != self._taken_in_run,
            "has_clicks": bool(self._sent),
            "clicks": MINIMUM_CLICKS,
        }

    def is_held_by(self, page: int) -> bool:
        """Whether this page's user clicks."""
        return self._holder == page

    def millimetres_per_pixel(self, page: int) -> Mapping[Plane, float]:
        """Of the pair that this page holds."""
        pair = self._stream.held
        if pair is None or self._holder != page:
            return {}
        self._holder_active_at = time.monotonic()
        return {plane: frame.projection.millimetres_per_pixel(np.zeros(3)) for plane, frame in pair.frames.items()}

    def clicks_file(self, body: Mapping[str, Any], page: int) -> str:
        """The clicks that are being set in this page, or else were sent, as a seeds file.

        Raises:
            TrackingError: there are none.
        """
        pair = self._stream.held
        if pair is not None and self._holder == page:
            self._holder_active_at = time.monotonic()
            points = {plane: protocol.points(body, plane, fewest=MINIMUM_CLICKS) for plane in PLANES}
            clicks = {plane: (frame.stamp_ns, points[plane]) for plane, frame in pair.frames.items()}
        else:
            clicks = dict(self._sent)
        if len(clicks) < len(PLANES):
            raise TrackingError("There are no clicks yet: press S, and click along the loop in both planes.")
        rounds = self._rounds
        published = {plane: self._published(plane, *clicks[plane]) for plane in PLANES}
        return encode_seeds_file(
            {
                p: (recorded_stamp(at, rounds.first_ns, rounds.period_ns), points)
                for p, (at, points) in published.items()
            }
        )

    def audience(self, pages: Collection[int]) -> None:
        """The pages that are open; a viewer who leaves must not leave the picture frozen."""
        self._open = frozenset(pages)
        if self._holder is not None and self._holder not in pages:
            self._let_go()

    def hold(self, page: int) -> str:
        """Hold a pair for a page; returns what to tell its user.

        Raises:
            LassoMotionError: another page's user is clicking, or there is no pair to hold.
        """
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

    def release(self, page: int) -> str:
        """Let the pair go, if it is this page that holds it; returns what to tell its user."""
        if self._holder == page:
            self._let_go()
        return ""

    def seed(self, body: Mapping[str, Any], page: int) -> str:
        """Send the clicks, and wait for the tracker's answer; where it refuses them, the pair stays held.

        Raises:
            LassoMotionError: this page holds no pair, there are too few clicks, or the tracker refuses them.
        """
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
            self._on_change()
            raise TrackingError(f"{in_plain_words(refusal)} Your clicks are still there.")
        if self._holder == page:
            self._let_go(_WAITS.held_after_seed_s)
        if refusal == "":
            self._waits_for_answer = False
            return "The tracker has taken the clicks."
        if self._stream.new_runs:
            return "The clicked picture has gone by. The clicks count when it comes again."
        return "The clicks are sent; the tracker has not answered yet. If nothing follows, press S and click again."

    def forget(self) -> None:
        """The tracker forgets its model, and with it the clicks that were sent."""
        self._sent, self._again, self._waits_for_answer, self._taken = {}, False, False, False

    def look_at_run(self) -> None:
        """After each image: of a recording played in a loop, clicks on one of its pairs hold for every round."""
        if self._stream.new_runs != self._runs:
            self._runs = self._stream.new_runs
            self._again = bool(self._sent)
        waiting = self._stream.state == TrackerState.WAITING_FOR_SEED.value
        if self._again and waiting and self._stream.pairs_of_run >= _WAITS.pairs_before_clicks:
            self._again, self._waits_for_answer = False, True
            self._publish_clicks()

    def answered(self) -> None:
        """The tracker has a pose: clicks that were sent are taken."""
        self._waits_for_answer = False
        if not self._taken:
            self._taken, self._taken_in_run = bool(self._sent), self._stream.new_runs

    def look(self) -> None:
        """Now and then: have the tracker let its pair go, once clicks are no longer on their way."""
        if self._unfreeze_at is not None and time.monotonic() >= self._unfreeze_at and self._stream.held is None:
            self._unfreeze_at = None
            self._services.unfreeze()

    def _hold(self) -> None:
        """Hold a pair here, the one that the tracker holds if it can hold one."""
        self._unfreeze_at = None
        if not self._services.can_freeze:
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

        # Only the tracker's picture says which pair it holds. No event is watched: the executor would stumble over that
        # of a subscription that goes again while it waits.
        unwatched = SubscriptionEventCallbacks(use_default_callbacks=False)
        listening = [
            self._node.create_subscription(
                Image, tracking_topic(plane).name, partial(take, plane), qos(depth=1), event_callbacks=unwatched
            )
            for plane in PLANES
        ]
        before = self._stream.whole_pairs()
        try:
            is_held = self._services.freeze()
            frozen.set()
            pairs = list(dict.fromkeys([*before, *self._stream.whole_pairs()]))
            if is_held:
                complete.wait(_WAITS.hold_s)
            self._stream.hold(pairs, stamps if complete.is_set() else None)
        finally:
            for one in listening:
                self._node.destroy_subscription(one)

    def _let_go(self, unfreeze_after_s: float = 0.0) -> None:
        self._holder = None
        self._stream.release()
        self._unfreeze_at = time.monotonic() + unfreeze_after_s

    def _publish_clicks(self) -> None:
        for plane, (stamp_ns, clicks) in self._sent.items():
            at_ns, points = self._published(plane, stamp_ns, clicks)
            fields = encode_polygon(points, header_fields(at_ns))
            self._seeds[plane].publish(self._node.messages.make(seed_topic(plane).type_name, fields))

    def _published(self, plane: Plane, stamp_ns: int, points: Array) -> tuple[int, Array]:
        """Clicks on a frame as those on the published picture: under its stamp, in its pixels."""
        source = self._sources[plane]
        return source.published_ns(stamp_ns), source.in_picture(points)
