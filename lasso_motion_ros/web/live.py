"""The live view: what has come on the topics, as the page shows it. Takes messages, knows no node and no server."""

from __future__ import annotations

import statistics
import threading
import time
from collections import OrderedDict, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.stream import SyncConfig
from lasso_motion_ros.core.errors import MessageError
from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane
from lasso_motion_ros.geometry.transforms import apply
from lasso_motion_ros.overlay.tracking_picture import STATE_COLOURS
from lasso_motion_ros.tracking.tracker import TrackerState
from lasso_motion_ros.web.source import PageView, Picture, PlanePicture, TracePoint
from msg_adapters.markers import DELETE, decode_points
from msg_adapters.messages import stamp_to_ns
from msg_adapters.poses import decode_pose
from msg_adapters.sync.frame_pairs import FramePairs
from msg_adapters.sync.partner import PartnerRule

Array = npt.NDArray[np.float64]

TRACE_S = 30.0
TRACE_POINTS = 4000
PAIRS_KEPT = 12
"""Pairs whose pixels are kept: the tracker may hold one that is not the newest."""
ANSWERS_KEPT = 64
OVERLAYS_KEPT = 4
LATENCIES_KEPT = 64
STOPPED_S = 1.5
STOPPED_PERIODS = 4.0
LATENCY_KEY = "latency of the last pair (ms)"


@dataclass(frozen=True, eq=False)
class _Seen:
    """A pair and when (steady clock, seconds) its last image came."""

    pair: FramePair
    number: int
    at_s: float


class LiveView:
    """Everything the page shows of a live graph; may be used from several threads.

    A pair is shown once the tracker has answered it, so that picture and loop belong together, or when the answer
    is too long in coming; then without a loop, never with an older one.

    Args:
        sync: how images are paired.
        tracker: the tracker node's name, as its diagnostics have it at their end.
        world_frame: frame of motion and loop.
        answer_wait_s: how long a pair waits for the tracker's answer.
        clock: steady clock, seconds.

    Attributes:
        new_runs: how many times both planes' stamps have gone back.
        pairs_of_run: pairs since then.
    """

    def __init__(
        self,
        sync: SyncConfig,
        tracker: str,
        world_frame: str,
        answer_wait_s: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._tracker, self._world_frame, self._wait_s, self._clock = tracker, world_frame, answer_wait_s, clock
        self._lock = threading.RLock()
        self._intake = FramePairs(PartnerRule.from_seconds(sync.jitter_s, sync.plane_b_offset_s))
        self._pairs: deque[_Seen] = deque(maxlen=PAIRS_KEPT)
        self._held: _Seen | None = None
        self._loops: OrderedDict[int, Array | None] = OrderedDict()
        self._received: OrderedDict[int, tuple[float, bool]] = OrderedDict()
        self._arrivals: dict[Plane, deque[float]] = {plane: deque(maxlen=8) for plane in PLANES}
        self._overlays: dict[Plane, OrderedDict[int, tuple[int, npt.NDArray[np.uint8]]]] = {
            plane: OrderedDict() for plane in PLANES
        }
        self._overlay_number = 0
        self._state, self._reason = "", ""
        self._tracker_latency_ms: float | None = None
        self._latencies_ms: deque[float] = deque(maxlen=LATENCIES_KEPT)
        self._trace: deque[TracePoint] = deque(maxlen=TRACE_POINTS)
        self._number = 0
        self._centre: Array | None = None
        self._motion: tuple[int, Array] | None = None
        self.new_runs = 0
        self.pairs_of_run = 0

    # What comes in.

    def add_image(self, plane: Plane, message: Any) -> list[str]:
        """Take an image; returns complaints."""
        with self._lock:
            now = self._clock()
            self._arrivals[plane].append(now)
            stamp_ns = stamp_to_ns(message.header.stamp)
            if plane == "a":
                if self._received and stamp_ns < next(reversed(self._received)):
                    self._received.clear()  # another run: its stamps may be those of the last
                # A pair that waits for clicks is answered when they come: that says nothing about speed.
                _keep(self._received, stamp_ns, (now, self.has_pose))
            self._take_pairs(self._intake.add_image(plane, message))
            return self._intake.frames[plane].take_complaints()

    def add_camera_info(self, plane: Plane, message: Any, *, latched: bool = False) -> list[str]:
        """Take a calibration, from a publisher that latches or not; returns complaints."""
        with self._lock:
            self._take_pairs(self._intake.add_camera_info(plane, message, latched=latched))
            return self._intake.frames[plane].take_complaints()

    def _take_pairs(self, pairs: list[FramePair]) -> None:
        for pair in pairs:
            if pair.new_run:
                self.new_runs += 1
                self.pairs_of_run = 0
                self._loops.clear()
                self._pairs.clear()
            self._number += 1
            self.pairs_of_run += 1
            self._pairs.append(_Seen(pair, self._number, self._clock()))

    def add_state(self, state: str) -> None:
        """Take a `state`."""
        with self._lock:
            had_pose = self.has_pose
            if state != self._state:
                self._reason = ""  # it was the former state's; the diagnostics bring the new one's
            self._state = state
            if had_pose and not self.has_pose:
                self._add_point(None)

    def add_motion(self, message: Any) -> None:
        """Take a `motion`: a point of the trace, and a latency.

        Raises:
            MessageError: another frame, or no pose.
        """
        if message.header.frame_id != self._world_frame:
            raise MessageError(f"motion is in frame {message.header.frame_id!r}, expected {self._world_frame!r}")
        motion = decode_pose(message)
        stamp_ns = stamp_to_ns(message.header.stamp)
        with self._lock:
            self._motion = stamp_ns, motion
            # The pose may be here before the image, which is larger.
            at_s, expected = self._received.get(stamp_ns, (self._clock(), False))
            if expected:
                self._latencies_ms.append(1e3 * (self._clock() - at_s))
            # A rotation about the far origin moves the loop too: what counts is where the loop's centre goes.
            at = np.zeros(3) if self._centre is None else self._centre
            shift_mm = 1e3 * (apply(motion, at[None])[0] - at)
            self._add_point((float(shift_mm[0]), float(shift_mm[1]), float(shift_mm[2])), at_s)

    def add_catheter(self, message: Any) -> None:
        """Take a `catheter`: the loop of the pair with its stamp, or that there is none.

        Raises:
            MessageError: another frame, or points that are none.
        """
        stamp_ns = stamp_to_ns(message.header.stamp)
        loop: Array | None = None
        if message.action != DELETE:
            if message.header.frame_id != self._world_frame:
                raise MessageError(f"catheter is in frame {message.header.frame_id!r}, expected {self._world_frame!r}")
            loop = decode_points(message)
            if not np.isfinite(loop).all():
                raise MessageError("catheter: a point is not finite")
        with self._lock:
            _keep(self._loops, stamp_ns, loop)
            if loop is not None and len(loop) and self._motion is not None and self._motion[0] == stamp_ns:
                self._centre = apply(np.asarray(np.linalg.inv(self._motion[1])), loop.mean(axis=0)[None])[0]

    def add_diagnostics(self, message: Any) -> None:
        """Take `/diagnostics`: the tracker's reason and latency."""
        for status in message.status:
            node, _, part = status.name.rpartition(": ")
            if part != "tracker" or node.rpartition("/")[2] != self._tracker:
                continue
            values = {entry.key: entry.value for entry in status.values}
            with self._lock:
                state, _, reason = status.message.partition(": ")
                if state == self._state:
                    self._reason = reason
                try:
                    self._tracker_latency_ms = float(values[LATENCY_KEY])
                except (KeyError, ValueError):
                    self._tracker_latency_ms = None

    def add_overlay(self, plane: Plane, message: Any) -> None:
        """Take a `plane_x/overlay`.

        Raises:
            MessageError: not rgb8, or data that do not fit.
        """
        if message.encoding != "rgb8" or message.step != 3 * message.width:
            raise MessageError(f"overlay: expected rgb8 without padding, found {message.encoding!r}")
        data = np.frombuffer(message.data, np.uint8)
        if data.size != message.height * message.step or data.size == 0:
            raise MessageError(f"overlay: {data.size} bytes do not make {message.width}×{message.height} pixels")
        with self._lock:
            self._overlay_number += 1
            drawn = self._overlay_number, data.reshape(message.height, message.width, 3)
            _keep(self._overlays[plane], stamp_to_ns(message.header.stamp), drawn, OVERLAYS_KEPT)

    # Holding a pair to click in.

    def whole_pairs(self) -> list[FramePair]:
        """The last pairs with images of both planes, oldest first."""
        with self._lock:
            return [seen.pair for seen in self._pairs if seen.pair.is_whole]

    def hold(self, pairs: Sequence[FramePair], stamps: Mapping[Plane, int] | None = None) -> None:
        """Keep one of some pairs on show: the one with these stamps, if it is there, else the last.

        Raises:
            MessageError: there is no pair.
        """
        with self._lock:
            whole = list(pairs)
            if stamps:
                matching = [pair for pair in whole if all(_stamp(pair, plane) == stamps[plane] for plane in stamps)]
                whole = matching or whole
            if not whole:
                raise MessageError(
                    "there is no image pair to click in: both planes' images and calibrations are needed"
                )
            self._number += 1
            self._held = _Seen(whole[-1], self._number, self._clock())

    def release(self) -> None:
        """Show what is new again."""
        with self._lock:
            if self._held is not None:
                self._held = None
                self._number += 1
                if self._pairs:  # the pair on show may be the one before; it must count as another picture
                    self._pairs[-1] = replace(self._pairs[-1], number=self._number)

    @property
    def held(self) -> FramePair | None:
        """The pair that is held."""
        held = self._held
        return None if held is None else held.pair

    # What goes out.

    @property
    def has_pose(self) -> bool:
        """Whether the tracker says that there is a pose."""
        return self._state in (TrackerState.TRACKING.value, TrackerState.DEGRADED.value)

    @property
    def state(self) -> str:
        """The last state heard; empty before the first."""
        return self._state

    def status(self) -> dict[str, Any]:
        """The numbers and words of the page, ready for JSON."""
        with self._lock:
            stopped = {plane: self._silence(plane) for plane in PLANES}
            return {
                "state": self._state,
                "reason": self._reason,
                "colour": _colour(self._state),
                "has_pose": self.has_pose,
                "stopped_s": {plane: None if age is None else round(age) for plane, age in stopped.items()},
                "seen": {plane: bool(self._arrivals[plane]) for plane in PLANES},
                "calibrated": {plane: self._intake.frames[plane].calibrated for plane in PLANES},
                "tracker_latency_ms": self._tracker_latency_ms,
                "latency_ms": round(statistics.median(self._latencies_ms), 1) if self._latencies_ms else None,
                "worst_latency_ms": round(max(self._latencies_ms), 1) if self._latencies_ms else None,
                "held": self._held is not None,
            }

    def trace(self, after: int) -> list[TracePoint]:
        """Points of the last 30 s with a number above `after`."""
        with self._lock:
            begin = self._clock() - TRACE_S
            return [point for point in self._trace if point.number > after and point.time_s >= begin]

    def picture(self, view: PageView) -> Picture | None:
        """The newest picture that may be shown."""
        with self._lock:
            if self._held is not None:
                return self._film(self._held)
            if view == "overlay":
                drawn = self._drawn()
                if drawn is not None:
                    return drawn
            now = self._clock()
            for seen in reversed(self._pairs):
                if not self.has_pose or seen.pair.stamp_ns in self._loops or now - seen.at_s >= self._wait_s:
                    return self._film(seen)
            return None

    def _film(self, seen: _Seen) -> Picture:
        held = seen is self._held
        # The number tells apart the same pair before and after its loop has come.
        loop = None if held or not self.has_pose else self._loops.get(seen.pair.stamp_ns)
        planes = {
            plane: PlanePicture(frame.stamp_ns, frame.pixels, None if loop is None else frame.projection.project(loop))
            for plane, frame in seen.pair.frames.items()
        }
        return Picture(4 * seen.number + (loop is not None), held, planes)

    def _drawn(self) -> Picture | None:
        """The overlay node's pictures of the newest pair of which it has drawn all, while it keeps up."""
        for seen in reversed(self._pairs):
            if self._pairs[-1].pair.stamp_ns - seen.pair.stamp_ns > 1e9 * STOPPED_S:
                return None
            frames = seen.pair.frames
            if not all(frame.stamp_ns in self._overlays[plane] for plane, frame in frames.items()):
                continue
            loop = self._loops.get(seen.pair.stamp_ns) if self.has_pose else None
            planes = {
                plane: PlanePicture(
                    frame.stamp_ns,
                    self._overlays[plane][frame.stamp_ns][1],
                    None if loop is None else frame.projection.project(loop),
                )
                for plane, frame in frames.items()
            }
            # Drawn anew, it is another picture. Films' numbers are multiples of four and their successors.
            number = max(self._overlays[plane][frame.stamp_ns][0] for plane, frame in frames.items())
            return Picture(4 * (2 * number + (loop is not None)) + 2, False, planes)
        return None

    def _add_point(self, shift_mm: tuple[float, float, float] | None, at_s: float | None = None) -> None:
        number = self._trace[-1].number + 1 if self._trace else 1
        self._trace.append(TracePoint(number, self._clock() if at_s is None else at_s, shift_mm))

    def _silence(self, plane: Plane) -> float | None:
        """Seconds since the last image, if that is longer than the images' rate explains; else None."""
        arrivals = self._arrivals[plane]
        if not arrivals:
            return None
        age = self._clock() - arrivals[-1]
        periods = [later - earlier for earlier, later in pairwise(arrivals)]
        allowed = max(STOPPED_S, STOPPED_PERIODS * statistics.median(periods) if periods else 0.0)
        return age if age > min(allowed, 5.0) else None


def _stamp(pair: FramePair, plane: Plane) -> int | None:
    frame = pair.frame(plane)
    return None if frame is None else frame.stamp_ns


def _keep(store: OrderedDict[int, Any], key: int, value: Any, count: int = ANSWERS_KEPT) -> None:
    store[key] = value
    store.move_to_end(key)
    while len(store) > count:
        store.popitem(last=False)


def _colour(state: str) -> str:
    try:
        red, green, blue = STATE_COLOURS[TrackerState(state)]
    except ValueError:
        return "#aaaaaa"
    return f"#{red:02x}{green:02x}{blue:02x}"
