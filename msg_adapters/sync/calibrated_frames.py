"""Gives each image of one plane its calibration, per frame or latched, whichever message arrives first.

Per frame, an image uses the calibration with its own stamp and waits a little for it. Latched, the last calibration
holds. The stamps tell which of the two it is, so a recording is read as the live stream was; live, a publisher's
durability tells it, too.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np

from lasso_motion_ros.core.errors import MessageError
from lasso_motion_ros.geometry.frames import Frame
from lasso_motion_ros.geometry.projection import Projection
from msg_adapters.calibrations import Extrinsics, decode_camera_info, needs_pose
from msg_adapters.images import TAKEN_AS_LUMINANCE, Pixels, decode_grey
from msg_adapters.messages import NANOSECONDS, stamp_to_ns
from msg_adapters.sync.held_picture import HeldPicture
from msg_adapters.sync.plane_source import PlaneSource


@dataclass(frozen=True)
class _Patience:
    """How long an image waits for its calibration, and how much is remembered.

    An image is given up only when both `images` and `lag_ns` are exceeded.

    Attributes:
        images: further images that may pass.
        lag_ns: time between their stamps, nanoseconds. A reliable publisher whose small messages were pushed out by
            large images sends them again after up to ten frames.
        most_waiting: images that wait at most.
        calibrations: stamps of calibrations that are remembered.
    """

    images: int = 2
    lag_ns: int = 700_000_000
    most_waiting: int = 32
    calibrations: int = 64


_PATIENCE = _Patience()
WHOLE_PICTURE = PlaneSource()


@dataclass(frozen=True, eq=False)
class _WithoutPose:
    """A CameraInfo with a plain camera matrix: the camera's pose is looked up at each image's stamp."""

    message: Any


_Calibration = Projection | _WithoutPose


@dataclass(eq=False)
class PendingFrame:
    """An image, and what has been decided about its calibration.

    Attributes:
        stamp_ns: its stamp.
        pixels: its grey values.
        picture: (height, width) of the published picture that they are of.
        settled: whether its calibration is decided.
        frame: the image with its calibration; None before that, and where there is none for it.
        elsewhere: images of the other plane that came since.
        first_elsewhere_ns: stamp of the first of them.
        last_elsewhere_ns: stamp of the last of them.
    """

    stamp_ns: int
    pixels: Pixels
    picture: tuple[int, int]
    settled: bool = False
    frame: Frame | None = None
    elsewhere: int = 0
    first_elsewhere_ns: int = 0
    last_elsewhere_ns: int = 0


@dataclass
class CalibrationCounts:
    """What became of one plane's messages before pairing.

    Attributes:
        images: images received.
        refused_images: of those, refused by their content.
        held: of those, the last exposure shown again.
        uncalibrated: images for which there was no valid calibration.
        calibrations: calibrations received.
        refused_calibrations: of those, refused by their content.
    """

    images: int = 0
    refused_images: int = 0
    held: int = 0
    uncalibrated: int = 0
    calibrations: int = 0
    refused_calibrations: int = 0


class CalibratedFrames:
    """Joins one plane's images and calibrations to frames.

    Args:
        extrinsics: where the pose of a plain camera matrix comes from (see `decode_camera_info`).
        source: which part of the pictures is taken, and how late their stamps are.

    Attributes:
        counts: what became of the messages.
        remark: what is to be known of the images, though nothing is wrong with them; empty where there is nothing.
    """

    def __init__(self, extrinsics: Extrinsics | None = None, source: PlaneSource = WHOLE_PICTURE) -> None:
        self._extrinsics = extrinsics
        self._source = source
        self._last_projection: tuple[Projection, tuple[int, int], Projection] | None = None
        self.counts = CalibrationCounts()
        self.remark = ""
        self._picture = HeldPicture()
        self._waiting: deque[PendingFrame] = deque()
        self._own: dict[int, _Calibration | None] = {}  # None: refused
        self._latest: _Calibration | None = None
        self._heard = False
        self._newest_ns = 0
        self._per_frame: bool | None = None  # None: the stamps have not shown it yet
        self._latched = False
        self._matched: set[int] = set()  # the first two stamps that an image and a calibration shared
        self._recent_images: deque[int] = deque(maxlen=_PATIENCE.most_waiting)
        self._complete: list[Frame] = []
        self._last_message: tuple[bytes, _Calibration] | None = None
        self._complaints: list[str] = []

    @property
    def calibrated(self) -> bool:
        """Whether the last calibration heard is valid."""
        return self._latest is not None

    @property
    def held(self) -> bool:
        """Whether the newest picture is the last exposure shown again."""
        return self._picture.held

    def exposure_of(self, stamp_ns: int) -> int:
        """The exposure's time of the picture with this published stamp; that of an earlier one, if it was held."""
        return self._picture.exposure_of(self._source.exposure_ns(stamp_ns))

    def take_complaints(self) -> list[str]:
        """What was wrong with messages since the last call."""
        complaints, self._complaints = self._complaints, []
        return complaints

    def add_image(self, message: Any) -> list[Frame]:
        """Take an Image or CompressedImage, give back the frames that are complete now.

        One that breaks the contract is a complaint.
        """
        self.take_image(message)
        return self.settle()

    def add_camera_info(self, message: Any, *, latched: bool = False) -> list[Frame]:
        """Take a CameraInfo, give back the frames that are complete now.

        One that breaks the contract is a complaint; images that would have used it are left out.

        Args:
            message: the CameraInfo.
            latched: it is known to come from a publisher that latches: it holds until the next, even if it has an
                image's stamp, and no image waits for another.
        """
        self.take_camera_info(message, latched=latched)
        return self.settle()

    def flush(self) -> list[Frame]:
        """The frames that are left when nothing more will come."""
        return self.settle(final=True)

    def take_image(self, message: Any) -> PendingFrame | None:
        """Take an image, which `settle` completes; None where it is refused, or a held picture: no new exposure."""
        self.counts.images += 1
        stamp = self._source.exposure_ns(stamp_to_ns(message.header.stamp))
        try:
            if stamp == 0:
                raise MessageError("header.stamp: expected the time of exposure, found zero")
            grey = decode_grey(message, self._source.crop)
        except MessageError as error:
            self.counts.refused_images += 1
            self._complaints.append(str(error))
            self._picture.held = False  # what came is no picture at all
            return None
        self.remark = f"{grey.colour} {TAKEN_AS_LUMINANCE}" if grey.colour else ""
        if self._picture.shows_again(stamp, grey.pixels):
            self.counts.held += 1
            return None
        if self._recent_images and stamp < self._recent_images[-1] - NANOSECONDS:
            self._leave_behind()
            if self._recent_images[-1] - NANOSECONDS < self._newest_ns:
                # Back to an earlier time: the later calibrations say nothing about what is still to come.
                self._own.clear()
                self._newest_ns = 0
        self._recent_images.append(stamp)
        pending = PendingFrame(stamp, grey.pixels, grey.picture)
        self._waiting.append(pending)
        return pending

    def note_elsewhere(self, stamp_ns: int) -> None:
        """Note the other plane's image: this plane may have stopped, and its images must not wait forever."""
        for waiting in self._waiting:
            if waiting.elsewhere == 0:
                waiting.first_elsewhere_ns = stamp_ns
            waiting.elsewhere += 1
            waiting.last_elsewhere_ns = stamp_ns

    def take_camera_info(self, message: Any, *, latched: bool = False) -> None:
        """Take a calibration, with which `settle` completes images. See `add_camera_info`."""
        self.counts.calibrations += 1
        stamp = self._source.exposure_ns(stamp_to_ns(message.header.stamp))
        try:
            projection: _Calibration | None = self._decoded(message)
        except MessageError as error:
            self.counts.refused_calibrations += 1
            self._complaints.append(str(error))
            projection = None
        if stamp < self._newest_ns - NANOSECONDS:
            self._own.clear()
            self._newest_ns = 0
        if latched and not self._latched:
            self._latched, self._per_frame = True, None
        if stamp != 0 and stamp in self._recent_images:
            self._per_frame = self._shows_per_frame(stamp)
        elif stamp == 0 and self._per_frame is None:
            self._per_frame = False
        self._own[stamp] = projection
        while len(self._own) > _PATIENCE.calibrations:
            del self._own[next(iter(self._own))]
        self._latest, self._heard = projection, True
        self._newest_ns = max(self._newest_ns, stamp)

    def settle(self, final: bool = False) -> list[Frame]:
        """Decide on the waiting images, in the order in which they came.

        Args:
            final: nothing more will come: decide on all of them.

        Returns:
            The frames completed since the last call; an image without a calibration is left out.
        """
        self._settle_waiting(final)
        complete, self._complete = self._complete, []
        return complete

    def _decoded(self, message: Any) -> _Calibration:
        roi = message.roi
        content = np.concatenate([np.asarray(message.p, np.float64), np.asarray(message.d, np.float64)]).tobytes()
        sizes = (message.width, message.height, message.binning_x, message.binning_y)
        content += repr((*map(int, sizes), roi.x_offset, roi.y_offset, roi.width, roi.height)).encode()
        content += message.header.frame_id.encode("utf-8", "replace")
        if self._last_message is not None and self._last_message[0] == content:
            return self._last_message[1]
        calibration: _Calibration
        if self._extrinsics is not None and needs_pose(message):
            calibration = _WithoutPose(message)
        else:
            calibration = decode_camera_info(message)
        self._last_message = (content, calibration)
        return calibration

    def _posed(self, calibration: _WithoutPose, stamp: int) -> Projection | None:
        """The projection as it is at an image's stamp; None, with a complaint, where it is not known."""
        extrinsics = self._extrinsics
        if extrinsics is None:
            return None
        try:
            return decode_camera_info(calibration.message, extrinsics=lambda frame_id, _: extrinsics(frame_id, stamp))
        except MessageError as error:
            self._complaints.append(str(error))
            return None

    def _settle_waiting(self, final: bool) -> None:
        while self._waiting:
            stamp = self._waiting[0].stamp_ns
            if stamp in self._own:
                self._per_frame = self._shows_per_frame(stamp)
                projection = self._own[stamp]
                for older in [other for other in self._own if other < stamp]:
                    del self._own[older]
            elif self._must_wait(stamp, final):
                break
            else:
                projection = self._standing_in(stamp)
            self._settle_oldest(projection)

    def _settle_oldest(self, calibration: _Calibration | None) -> None:
        oldest = self._waiting.popleft()
        oldest.settled, oldest.frame = True, self._frame(oldest, calibration)
        if oldest.frame is not None:
            self._complete.append(oldest.frame)

    def _shows_per_frame(self, stamp: int) -> bool | None:
        """Whether an image and a calibration with one stamp mean that each image has its own; where latched, two do."""
        if len(self._matched) < 2:
            self._matched.add(stamp)
        return True if not self._latched or len(self._matched) > 1 else None

    def _leave_behind(self) -> None:
        """Settle the images from before a step back in time: what follows says nothing about them."""
        while self._waiting:
            stamp = self._waiting[0].stamp_ns
            self._settle_oldest(self._own.get(stamp, None if self._per_frame else self._latest))

    def _must_wait(self, stamp: int, final: bool) -> bool:
        """Whether this image's own calibration, or any at all, may still come."""
        if final or len(self._waiting) > _PATIENCE.most_waiting:
            return False
        first = self._waiting[0]
        if len(self._waiting) > _PATIENCE.images and self._waiting[-1].stamp_ns - stamp >= _PATIENCE.lag_ns:
            return False
        # The planes' clocks may differ: only stamps of one plane are compared.
        elsewhere_ns = first.last_elsewhere_ns - first.first_elsewhere_ns
        if first.elsewhere > _PATIENCE.images and elsewhere_ns >= _PATIENCE.lag_ns:
            return False
        if not self._heard:
            return True
        if self._per_frame is None:
            return len(self._waiting) < 2 and not self._latched
        return self._per_frame and self._newest_ns < stamp

    def _standing_in(self, stamp: int) -> _Calibration | None:
        """The calibration for an image whose own will not come."""
        if not self._per_frame:
            if self._heard:
                self._per_frame = False
            return self._latest
        if self._newest_ns < stamp:
            self._per_frame = None  # they have stopped: if that lasts, the last one holds
            return self._latest
        # Its own calibration was lost on the way. Equal neighbours can stand in for it: nothing was moving.
        before = [self._own[other] for other in self._own if other < stamp]
        after = [self._own[other] for other in self._own if other > stamp]
        if before and after and before[-1] is not None and before[-1] is after[0]:
            return before[-1]
        return None

    def _frame(self, pending: PendingFrame, calibration: _Calibration | None) -> Frame | None:
        stamp, pixels, projection = pending.stamp_ns, pending.pixels, calibration
        if isinstance(projection, _WithoutPose):
            projection = self._posed(projection, stamp)
            if projection is None:
                self.counts.uncalibrated += 1
                return None
        if projection is None:
            self.counts.uncalibrated += 1
            if self._latest is not None or not self._heard:  # else the calibration's own complaint says it
                self._complaints.append("an image was left out: there is no calibration for it")
            return None
        projection = self._of_crop(projection, pending.picture)
        if pixels.shape != (projection.height, projection.width):
            self.counts.uncalibrated += 1
            height, width = pending.picture
            crop = "" if self._source.crop is None else f", its crop {pixels.shape[1]}×{pixels.shape[0]}"
            if not crop and projection.width <= width and projection.height <= height:
                crop = "; crop says where the X-ray field is, if the picture shows more"
            self._complaints.append(
                f"width, height: the calibration is for an image of {projection.width}×{projection.height} (with"
                f" binning and roi), the image has {width}×{height}{crop}"
            )
            return None
        return Frame(stamp, pixels, projection)

    def _of_crop(self, published: Projection, picture: tuple[int, int]) -> Projection:
        """The projection to the crop's pixels; one and the same while the calibration is."""
        last = self._last_projection
        if last is None or last[0] is not published or last[1] != picture:
            last = self._last_projection = published, picture, self._source.projection(published, picture)
        return last[2]
