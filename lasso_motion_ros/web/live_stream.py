"""The live page's data: messages of a running graph go in, what the page shows comes out. Free of node and server."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.stream import SyncConfig
from lasso_motion_ros.config.web import AUTO_AXES
from lasso_motion_ros.core.errors import MessageError
from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane
from lasso_motion_ros.tracking.tracker import TrackerState
from lasso_motion_ros.web.click_answers import ClickAnswers
from lasso_motion_ros.web.headline import TrackerWord
from lasso_motion_ros.web.motion_trace import MotionTrace
from lasso_motion_ros.web.patient_view import PatientView
from lasso_motion_ros.web.plain_words import in_plain_words
from lasso_motion_ros.web.shown_pairs import ShownPairs
from lasso_motion_ros.web.source import PageView, Picture, TracePoint
from lasso_motion_ros.web.stream_health import StreamHealth
from msg_adapters.markers import DELETE, decode_points
from msg_adapters.messages import stamp_to_ns
from msg_adapters.poses import decode_covariance, decode_pose
from msg_adapters.sync.frame_pairs import FramePairs
from msg_adapters.sync.partner import PartnerRule
from msg_adapters.sync.plane_source import PlaneSource
from msg_adapters.topics import LAST_LATENCY_KEY, LAST_POSE_WORDS, POSTURE_KEY

Array = npt.NDArray[np.float64]

_NEEDING_A_RING = {state.value for state in TrackerState if state is TrackerState.WAITING_FOR_SEED or state.is_alarm}


class LiveStream:
    """Everything the page shows of a live graph; may be used from several threads.

    Args:
        sync: how images are paired.
        sources: per plane, which part of the pictures is taken, and how late their stamps are.
        tracker: the tracker node's name without its namespace, as in its diagnostics.
        world_frame: frame of motion and loop.
        answer_wait_s: how long a pair waits for the tracker's answer.
        axes: where the world's axes point in the patient, as in `PatientView`.
        clock: steady clock, seconds.

    Attributes:
        answers: what the tracker says to clicks.
        new_runs: how many times both planes' stamps have gone back.
        pairs_of_run: pairs since then.

    Raises:
        ConfigurationError: axes that are none.
    """

    def __init__(
        self,
        sync: SyncConfig,
        sources: Mapping[Plane, PlaneSource],
        tracker: str,
        world_frame: str,
        answer_wait_s: float,
        axes: str = AUTO_AXES,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._sources = sources
        self._tracker, self._world_frame = tracker, world_frame
        self._lock = threading.RLock()
        self._intake = FramePairs(PartnerRule.from_seconds(sync.jitter_s, sync.plane_b_offset_s), sources=sources)
        self._health = StreamHealth(clock)
        self._trace = MotionTrace(clock)
        self._patient = PatientView(axes)
        self._shown = ShownPairs(answer_wait_s, clock)
        self._word = TrackerWord(clock, self._health)
        self._had_pose = False
        self._proposals: dict[int, Array] = {}
        self._tracker_latency_ms: float | None = None
        self.answers = ClickAnswers()
        self.new_runs = 0
        self.pairs_of_run = 0

    # What comes in.

    def add_image(self, plane: Plane, message: Any) -> list[str]:
        """Take an image; returns complaints."""
        with self._lock:
            pairs = self._intake.add_image(plane, message)
            if self._intake.frames[plane].held:
                self._health.add_held(plane)
            else:
                stamp = self._sources[plane].exposure_ns(stamp_to_ns(message.header.stamp))
                self._health.add_image(plane, stamp, answer_expected=self.has_pose)
            self._take_pairs(pairs)
            return self._intake.frames[plane].take_complaints()

    def add_camera_info(self, plane: Plane, message: Any, *, latched: bool = False) -> list[str]:
        """Take a calibration, latched or not; returns complaints."""
        with self._lock:
            self._take_pairs(self._intake.add_camera_info(plane, message, latched=latched))
            return self._intake.frames[plane].take_complaints()

    def _take_pairs(self, pairs: list[FramePair]) -> None:
        for pair in pairs:
            if pair.new_run:
                self.new_runs += 1
                self.pairs_of_run = 0
            self.pairs_of_run += 1
            self._shown.add_pair(pair)
            for plane, frame in pair.frames.items():
                self._patient.take(plane, frame.projection)

    def add_state(self, state: str) -> None:
        """Take a `state`."""
        with self._lock:
            self._word.take_state(state)
            self._look()

    def add_motion(self, message: Any) -> None:
        """Take a `motion`: a point of the trace, and a latency.

        Raises:
            MessageError: another frame, or no pose.
        """
        self._check_frame("motion", message)
        motion = decode_pose(message)
        stamp_ns = stamp_to_ns(message.header.stamp)
        with self._lock:
            self._word.take_pose()
            self._had_pose = True
            self._trace.add_motion(stamp_ns, motion, self._health.add_answer(stamp_ns))

    def add_motion_with_covariance(self, message: Any) -> None:
        """Take a `motion_with_covariance`: how well the loop's place is known.

        Raises:
            MessageError: another frame, no pose, or no covariance.
        """
        self._check_frame("motion_with_covariance", message)
        motion, covariance = decode_pose(message), decode_covariance(message)
        if covariance is not None:
            with self._lock:
                self._trace.add_covariance(stamp_to_ns(message.header.stamp), motion, covariance)

    def add_catheter(self, message: Any) -> None:
        """Take a `catheter`: the loop of the pair with its stamp, or that there is none.

        Raises:
            MessageError: another frame, or points that are none.
        """
        stamp_ns = stamp_to_ns(message.header.stamp)
        loop: Array | None = None
        if message.action != DELETE:
            self._check_frame("catheter", message)
            loop = decode_points(message)
            if not np.isfinite(loop).all():
                raise MessageError("catheter: a point is not finite")
        with self._lock:
            self._shown.add_loop(stamp_ns, loop)
            if loop is not None:
                self._trace.add_loop(stamp_ns, loop)

    def add_proposal(self, message: Any) -> None:
        """Take a `proposal`: a ring that was found without clicks, by its rank, or that there is none of that rank.

        Raises:
            MessageError: another frame, or points that are none.
        """
        if message.action == DELETE:
            with self._lock:
                self._proposals.pop(message.id, None)
            return
        self._check_frame("proposal", message)
        ring = decode_points(message)
        if not np.isfinite(ring).all():
            raise MessageError("proposal: a point is not finite")
        with self._lock:
            self._proposals[message.id] = ring

    @property
    def _best_proposal(self) -> Array | None:
        """The ring that the tracker would accept; None where it has a pose, or none is proposed."""
        is_needed = self.state in _NEEDING_A_RING
        return self._proposals[min(self._proposals)] if is_needed and self._proposals else None

    def _check_frame(self, what: str, message: Any) -> None:
        if message.header.frame_id != self._world_frame:
            raise MessageError(f"{what} is in frame {message.header.frame_id!r}, expected {self._world_frame!r}")

    def add_diagnostics(self, message: Any) -> None:
        """Take `/diagnostics`: the tracker's reason and latency."""
        for status in message.status:
            node, _, part = status.name.rpartition(": ")
            if part != "tracker" or node.rpartition("/")[2] != self._tracker:
                continue
            values = {entry.key: entry.value for entry in status.values}
            self.answers.take(values)
            with self._lock:
                self._patient.posture = values.get(POSTURE_KEY, self._patient.posture)
                state, _, reason = status.message.partition(": ")
                # The page counts on from the last pose by itself.
                self._word.take_reason(state, in_plain_words(reason.partition(LAST_POSE_WORDS)[0]))
                try:
                    self._tracker_latency_ms = float(values[LAST_LATENCY_KEY])
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
            drawn = data.reshape(message.height, message.width, 3)
            self._shown.add_overlay(plane, stamp_to_ns(message.header.stamp), drawn)

    def add_overlay_drawn(self, plane: Plane, message: Any) -> None:
        """Take a `plane_x/overlay/drawn`: whether the overlay of that stamp is compensated."""
        with self._lock:
            self._shown.add_overlay_drawn(plane, stamp_to_ns(message.stamp), compensated=bool(message.frame_id))

    # Holding a pair to click in.

    def whole_pairs(self) -> list[FramePair]:
        """The last pairs with images of both planes, oldest first."""
        with self._lock:
            return self._shown.whole_pairs()

    def hold(self, pairs: Sequence[FramePair], stamps: Mapping[Plane, int] | None = None) -> None:
        """Keep one of some pairs on show: the one with these stamps, if it is there, else the last.

        Raises:
            MessageError: there is no pair.
        """
        with self._lock:
            self._shown.hold(pairs, stamps)

    def release(self) -> None:
        """Show what is new again."""
        with self._lock:
            self._shown.release()

    @property
    def held(self) -> FramePair | None:
        """The pair that is held."""
        return self._shown.held

    # What goes out.

    @property
    def has_pose(self) -> bool:
        """Whether the tracker says that there is a pose, and one has just come."""
        return self._word.has_pose

    @property
    def state(self) -> str:
        """The last state received; empty before the first."""
        return self._word.said

    def tracker_is_present(self, present: bool) -> None:
        """Learn whether anybody publishes `state`."""
        with self._lock:
            self._word.present = present

    def _look(self) -> None:
        """Note in the trace where the poses end: nothing that is received says so when the tracker has died."""
        if self._had_pose and not self.has_pose:
            self._had_pose = False
            self._trace.interrupt()

    def status(self) -> dict[str, Any]:
        """The page's numbers and words, ready for JSON."""
        with self._lock:
            self._look()
            headline, age = self._word.headline(), self._word.pose_age_s
            silence = {plane: self._health.silence_s(plane) for plane in PLANES}
            sigma_mm = self._trace.sigma_mm if headline.has_pose else None
            latency, worst = self._health.latency_ms, self._health.worst_latency_ms
            return {
                **asdict(headline),
                **self._patient.words(),
                "proposed": 0 if self._best_proposal is None else len(self._proposals),
                "sigma_mm": None if sigma_mm is None else round(sigma_mm, 2),
                "pose_age_s": None if age is None else round(age, 1 if age < 1.0 else None),
                "stopped_s": {plane: None if age is None else round(age) for plane, age in silence.items()},
                "held_pictures": {plane: self._health.is_held(plane) for plane in PLANES},
                "seen": {plane: self._health.has_seen(plane) for plane in PLANES},
                "calibrated": {plane: self._intake.frames[plane].calibrated for plane in PLANES},
                "tracker_latency_ms": self._tracker_latency_ms,
                "latency_ms": None if latency is None else round(latency, 1),
                "worst_latency_ms": None if worst is None else round(worst, 1),
            }

    def trace(self, after: int) -> list[TracePoint]:
        """Points of the last 30 s with a number above `after`."""
        with self._lock:
            return self._trace.points(after)

    def picture(self, view: PageView, *, held: bool = False) -> Picture | None:
        """The newest picture that may be shown, or of the pair that is held."""
        with self._lock:
            return self._shown.picture(view, has_pose=self.has_pose, held=held, proposed=self._best_proposal)
