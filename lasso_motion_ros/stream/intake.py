"""What comes in: messages become pairs, and clicks find the pair that was clicked."""

from __future__ import annotations

import dataclasses
import threading
from typing import Any

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import LassoMotionError, TrackingError
from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Plane, Seed
from lasso_motion_ros.stream.clicked_pairs import ClickedPairs
from lasso_motion_ros.stream.heart_phases import HeartPhases
from lasso_motion_ros.stream.pair_task import PairTask, PromisedTasks
from lasso_motion_ros.stream.problem_log import ProblemLog
from msg_adapters.calibrations import Extrinsics
from msg_adapters.messages import stamp_to_ns
from msg_adapters.seeds import decode_seed
from msg_adapters.sync.calibrated_frames import CalibrationCounts
from msg_adapters.sync.frame_pairs import FramePairs
from msg_adapters.sync.pairing import PlaneCounts
from msg_adapters.sync.partner import PartnerRule
from msg_adapters.sync.plane_source import plane_sources
from msg_adapters.topics import camera_info_topic, image_topic, seed_topic

# A pair may wait for the tracker beside those that wait for clicks.
_PHASES_BESIDE_CLICKS = 64


class MessageIntake:
    """Takes messages, gives back the tasks that are due; cheap, and never waits for the tracker.

    Args:
        config: how pairs are made, and how many are kept for clicks.
        problems: takes what is wrong with messages.
        extrinsics: where the pose of a plain camera matrix comes from; without it such calibrations are refused.

    Raises:
        ConfigurationError: a crop that is none.

    Attributes:
        sources: per plane, which part of the pictures is taken, and how late their stamps are.
        phases: the heart's phase at each pair; the intake alone adds to it.
        promised: the tasks that must not be lost; the intake alone adds to it.
    """

    def __init__(self, config: StreamConfig, problems: ProblemLog, extrinsics: Extrinsics | None = None) -> None:
        self._problems = problems
        self._lock = threading.Lock()
        rule = PartnerRule.from_seconds(config.sync.jitter_s, config.sync.plane_b_offset_s)
        self.sources = plane_sources(config)
        self._pairs = FramePairs(rule, extrinsics, self.sources)
        self._clicked = ClickedPairs(config.seed_buffer_pairs)
        self.phases = HeartPhases(remembered=2 * config.seed_buffer_pairs + _PHASES_BESIDE_CLICKS)
        self.promised = PromisedTasks()

    def add_image(self, plane: Plane, message: Any) -> list[PairTask]:
        """Take an Image (or CompressedImage) of one plane; give back the tasks that are due."""
        with self._lock:
            pairs = self._pairs.add_image(plane, message)
            self._report_frames(plane, image_topic(plane).name)
            return self._tasks(pairs)

    def add_camera_info(self, plane: Plane, message: Any, *, latched: bool = False) -> list[PairTask]:
        """Take a CameraInfo of one plane, from a publisher that latches or not; give back the tasks that are due."""
        with self._lock:
            pairs = self._pairs.add_camera_info(plane, message, latched=latched)
            self._report_frames(plane, camera_info_topic(plane).name)
            return self._tasks(pairs)

    def add_seed(self, plane: Plane, message: Any) -> list[PairTask]:
        """Take the clicks in one plane; give back the pairs to answer (again), see `ClickedPairs`."""
        with self._lock:
            try:
                points = self.sources[plane].in_crop(decode_seed(message))
            except LassoMotionError as error:
                self._problems.report(seed_topic(plane).name, str(error))
                return []
            stamp = self._pairs.frames[plane].exposure_of(stamp_to_ns(message.header.stamp))
            task = self._clicked.add_clicks(plane, stamp, points, hold=self._pairs.pairing.restarting)
            self._report_clicks()
            return [] if task is None else self._issued([task])

    def add_r_peak(self, message: Any) -> list[PairTask]:
        """Take the stamp of an R peak; it brings no task."""
        with self._lock:
            self.phases.add_r_peak(stamp_to_ns(message.stamp))
        return []

    def flush(self) -> list[PairTask]:
        """The tasks that are left when nothing more will come."""
        with self._lock:
            pairs = self._pairs.flush()
            for plane in PLANES:
                self._report_frames(plane, image_topic(plane).name)
            return self._tasks(pairs)

    def freeze(self) -> FramePair:
        """Hold the last pair with both planes for clicks, however many pairs come after it.

        Raises:
            TrackingError: there has been none.
        """
        with self._lock:
            pair = self._clicked.hold()
        if pair is None:
            raise TrackingError("there is no pair with calibrated images of both planes to hold")
        return pair

    def release(self) -> None:
        """Stop holding the pair."""
        with self._lock:
            self._clicked.release()

    def seed_frozen(self, seed: Seed) -> PairTask:
        """Take clicks on the pair that is held; give back the task that they make.

        Raises:
            TrackingError: none is held.
        """
        with self._lock:
            task = self._clicked.seed_held(seed)
            if task is None:
                raise TrackingError("no pair is held: call ~/freeze, and click on the picture")
            self._issued([task])
            return task

    def seed_pair(self, pair: FramePair, seed: Seed) -> PairTask:
        """Take clicks on a past pair, however long ago it was; give back the task that they make."""
        with self._lock:
            task = self._clicked.seed_pair(pair, seed)
            self._issued([task])
            return task

    def forget_clicks(self) -> int:
        """Forget pairs and clicks; returns the number of the last task, of whose seed nothing is wanted any more."""
        with self._lock:
            self._clicked.clear()
            return self._clicked.number

    @property
    def waiting_a(self) -> Frame | None:
        """Plane A's frame of the next pair, while plane B's has not come; None where there is none, or it has."""
        with self._lock:
            return self._pairs.waiting_a

    @property
    def waiting_clicks(self) -> str:
        """What clicks are kept and what they wait for, in words; empty where none are kept."""
        return self._clicked.waiting

    @property
    def calibrated(self) -> tuple[Plane, ...]:
        """The planes whose last calibration is valid."""
        return tuple(plane for plane in PLANES if self._pairs.frames[plane].calibrated)

    @property
    def offset_ns(self) -> int:
        """Time from A's to B's exposure, as the last pairs have it or as it is configured."""
        with self._lock:
            return self._pairs.pairing.offset_ns

    @property
    def held(self) -> tuple[Plane, ...]:
        """The planes whose newest picture is no new exposure, but the last one shown again."""
        return tuple(plane for plane in PLANES if self._pairs.frames[plane].held)

    @property
    def remarks(self) -> dict[Plane, str]:
        """Per plane, what is to be known of its images; empty where there is nothing."""
        return {plane: self._pairs.frames[plane].remark for plane in PLANES}

    @property
    def frame_counts(self) -> dict[Plane, CalibrationCounts]:
        """Per plane, what became of images and calibrations before pairing."""
        return {plane: dataclasses.replace(self._pairs.frames[plane].counts) for plane in PLANES}

    @property
    def pairing_counts(self) -> dict[Plane, PlaneCounts]:
        """Per plane, what became of images in pairing."""
        return {plane: dataclasses.replace(self._pairs.pairing.counts[plane]) for plane in PLANES}

    def _tasks(self, pairs: list[FramePair]) -> list[PairTask]:
        tasks: list[PairTask] = []
        for place, pair in enumerate(pairs, start=1):
            self.phases.add_pair(pair.stamp_ns, new_run=pair.new_run)
            hold = self._pairs.pairing.restarting or any(later.new_run for later in pairs[place:])
            heard = dataclasses.replace(pair, r_peaks_ns=self.phases.r_peaks_ns)
            tasks += self._clicked.add_pair(heard, hold)
        self._report_clicks()
        return self._issued(tasks)

    def _issued(self, tasks: list[PairTask]) -> list[PairTask]:
        self.promised.add(tasks)
        return tasks

    def _report_frames(self, plane: Plane, topic: str) -> None:
        for complaint in self._pairs.frames[plane].take_complaints():
            self._problems.report(topic, complaint)
        self._problems.remark(image_topic(plane).name, self._pairs.frames[plane].remark)

    def _report_clicks(self) -> None:
        for plane, reason in self._clicked.take_complaints():
            self._problems.report(seed_topic(plane).name, reason)
