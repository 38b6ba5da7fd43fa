"""Images and calibrations of both planes in, pairs of calibrated frames out.

Pairs are decided when the images come, by their stamps alone; a pair is given out when the calibrations of its images
are decided too. So an image that waits for its calibration is not taken for one that has not come.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Pair, Plane
from msg_adapters.calibrations import Extrinsics
from msg_adapters.sync.calibrated_frames import WHOLE_PICTURE, CalibratedFrames, PendingFrame
from msg_adapters.sync.pairing import PairSynchroniser
from msg_adapters.sync.partner import PartnerRule
from msg_adapters.sync.plane_source import PlaneSource

# Decided pairs that may wait for calibrations, beyond what the planes' own patience lets wait.
_MAX_DECIDED = 64


class FramePairs:
    """Joins both planes' images and calibrations to pairs of frames, in the order of their stamps.

    Args:
        rule: which B belongs to which A.
        extrinsics: where the pose of a plain camera matrix comes from (see `decode_camera_info`).
        sources: per plane, which part of the pictures is taken, and how late their stamps are; by default all of them,
            and not at all.

    Attributes:
        frames: per plane, what joins its images and calibrations; read only.
        pairing: what decides the pairs; read only.
    """

    def __init__(
        self,
        rule: PartnerRule,
        extrinsics: Extrinsics | None = None,
        sources: Mapping[Plane, PlaneSource] | None = None,
    ) -> None:
        given = sources or dict.fromkeys(PLANES, WHOLE_PICTURE)
        self.frames: dict[Plane, CalibratedFrames] = {
            plane: CalibratedFrames(extrinsics, given[plane]) for plane in PLANES
        }
        self.pairing: PairSynchroniser[PendingFrame] = PairSynchroniser(rule)
        self._decided: deque[Pair[PendingFrame]] = deque()
        self._new_run = False

    @property
    def waiting_a(self) -> Frame | None:
        """Plane A's frame of the next pair, while plane B's has not come; None where there is none, or it has."""
        pending = None if self._decided else self.pairing.waiting_a
        return None if pending is None else pending.frame

    def add_image(self, plane: Plane, message: Any) -> list[FramePair]:
        """Take an Image or CompressedImage, give back the pairs that are complete now."""
        pending = self.frames[plane].take_image(message)
        if pending is not None:
            self.frames["b" if plane == "a" else "a"].note_elsewhere(pending.stamp_ns)
            self._decided.extend(self.pairing.add(plane, pending.stamp_ns, pending))
        return self._complete()

    def add_camera_info(self, plane: Plane, message: Any, *, latched: bool = False) -> list[FramePair]:
        """Take a CameraInfo (`latched`: from a publisher that latches), give back the pairs that are complete now."""
        self.frames[plane].take_camera_info(message, latched=latched)
        return self._complete()

    def flush(self) -> list[FramePair]:
        """The pairs that are left when nothing more will come."""
        self._decided.extend(self.pairing.flush())
        return self._complete(final=True)

    def _complete(self, final: bool = False) -> list[FramePair]:
        self._settle(final)
        complete = self._take_settled()
        if len(self._decided) > _MAX_DECIDED:
            self._settle(final=True)
            complete += self._take_settled()
        return complete

    def _settle(self, final: bool) -> None:
        for frames in self.frames.values():
            frames.settle(final)

    def _take_settled(self) -> list[FramePair]:
        complete: list[FramePair] = []
        while self._decided and all(pending.settled for pending in self._decided[0].frames.values()):
            decided = self._decided.popleft()
            a, b = (None if pending is None else pending.frame for pending in (decided.a, decided.b))
            # A new run begins with its first pair that has a calibration.
            self._new_run = self._new_run or decided.new_run
            if a is not None or b is not None:
                complete.append(Pair(decided.stamp_ns, a, b, self._new_run))
                self._new_run = False
        return complete
