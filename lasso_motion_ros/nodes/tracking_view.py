"""What `plane_x/tracking` shows: the newest pair or the frozen one, and before the calibrations the images alone."""

from __future__ import annotations

import contextlib

from sensor_msgs.msg import CompressedImage

from lasso_motion_ros.core.errors import MessageError
from lasso_motion_ros.geometry.frames import PLANES, Frame, Plane, UncalibratedFrame
from lasso_motion_ros.nodes.clicking import ClickBoard
from lasso_motion_ros.nodes.state_watch import StateWatch
from lasso_motion_ros.nodes.state_words import last_pose_words
from lasso_motion_ros.nodes.tracker_publishers import TrackerPublishers, TrackingPicture
from lasso_motion_ros.stream.pipeline import TrackingPipeline
from msg_adapters.images import decode_image
from msg_adapters.input_bytes import ReadImage
from msg_adapters.messages import stamp_to_ns


class TrackingView:
    """Chooses what is drawn, while somebody watches; `TrackerPublishers` draws it in a thread of its own.

    Args:
        publishers: draw and publish.
        state_watch: the state as published, and how old the last pose is.
        board: the frozen pair, and the clicks on it.
    """

    def __init__(self, publishers: TrackerPublishers, state_watch: StateWatch, board: ClickBoard) -> None:
        self._publishers, self._state_watch, self._board = publishers, state_watch, board
        self._frame_ids: dict[Plane, str] = {}
        self._uncalibrated: dict[Plane, Frame | UncalibratedFrame] = {}

    def name_frame(self, plane: Plane, frame_id: str) -> None:
        """Take note of a plane's frame, before an image of it can be drawn."""
        self._frame_ids[plane] = frame_id

    def add_image(self, pipeline: TrackingPipeline, plane: Plane, message: ReadImage | CompressedImage) -> None:
        """Take note of an image that has come; one without a calibration is drawn as it is.

        So whoever sets the system up sees that it arrives.

        Args:
            pipeline: has taken it in.
            plane: which it is of.
            message: as it came.
        """
        if plane in pipeline.intake.calibrated:
            self._uncalibrated.pop(plane, None)
        elif self._publishers.watched:
            self._show_uncalibrated(pipeline, plane, message)

    def show(self, pipeline: TrackingPipeline) -> None:
        """Have the newest pair drawn, or the frozen one."""
        pair = self._board.pair or pipeline.session.last_pair
        if pair is None or not self._publishers.watched:
            return
        result, told = pipeline.session.last_result, self._state_watch.told(pipeline.statistics())
        loop = result.loop if result is not None and result.stamp_ns == pair.stamp_ns else None
        clicks = {plane: self._board.clicks(plane) for plane in PLANES}
        frames: dict[Plane, Frame | UncalibratedFrame] = {**pair.frames}
        ids, held = dict(self._frame_ids), pair is self._board.pair
        age = last_pose_words(self._state_watch.pose_age_s) if told.state.is_alarm else ""
        remark = f"last good pose {age}" if age else ""
        self._publishers.show(TrackingPicture(frames, loop, told.state, told.reason, clicks, ids, held, remark))

    def _show_uncalibrated(
        self, pipeline: TrackingPipeline, plane: Plane, message: ReadImage | CompressedImage
    ) -> None:
        with contextlib.suppress(MessageError):  # the intake has complained about it
            source = pipeline.intake.sources[plane]
            stamp = source.exposure_ns(stamp_to_ns(message.header.stamp))
            self._uncalibrated[plane] = UncalibratedFrame(stamp, decode_image(message, source.crop))
            told = self._state_watch.told(pipeline.statistics())
            shown, ids = dict(self._uncalibrated), dict(self._frame_ids)
            self._publishers.show(TrackingPicture(shown, None, told.state, told.reason, {}, ids))
