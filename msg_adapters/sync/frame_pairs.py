"""Images and calibrations of both planes in, pairs of calibrated frames out.

Pairs are decided when the images come, by their stamps alone; a pair is given out when the calibrations of its images
are decided too. So an image that waits for its calibration is not taken for one that has not come.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

from lasso_motion_ros.geometry.frames import PLANES, Frame, Plane
from msg_adapters.calibrations import Extrinsics
from msg_adapters.sync.calibrated_frames import CalibratedFrames
from msg_adapters.sync.pairing import Pair, PairSynchroniser

# Decided pairs that may wait for calibrations, beyond what the planes' own patience lets wait.
_MAX_DECIDED = 64


@dataclass(eq=False)
class _Slot:
    """An image's place in its pair.

    Attributes:
        settled: it is decided whether there is a calibration for it.
        frame: the image with its calibration; None before, and where it is left out.
    """

    settled: bool = False
    frame: Frame | None = None


class FramePairs:
    """Joins both planes' images and calibrations to pairs of frames, in the order of their stamps.

    Args:
        jitter_s: see `PairSynchroniser`.
        plane_b_offset_s: see `PairSynchroniser`.
        extrinsics: where the pose of a plain camera matrix comes from (see `decode_camera_info`).

    Attributes:
        frames: per plane, what joins its images and calibrations; to be read only.
        pairing: what decides the pairs; to be read only.
    """

    def __init__(self, jitter_s: float, plane_b_offset_s: float, extrinsics: Extrinsics | None = None) -> None:
        self.frames: dict[Plane, CalibratedFrames] = {plane: CalibratedFrames(extrinsics) for plane in PLANES}
        self.pairing: PairSynchroniser[_Slot] = PairSynchroniser(jitter_s, plane_b_offset_s)
        self._unsettled: dict[Plane, deque[_Slot]] = {plane: deque() for plane in PLANES}
        self._decided: deque[Pair[_Slot]] = deque()
        self._new_run = False

    def add_image(self, plane: Plane, message: Any) -> list[Pair[Frame]]:
        """Take an Image or CompressedImage, give back the pairs that are complete now."""
        stamp_ns = self.frames[plane].take_image(message)
        if stamp_ns is not None:
            self.frames["b" if plane == "a" else "a"].note_elsewhere(stamp_ns)
            slot = _Slot()
            self._unsettled[plane].append(slot)
            self._decided.extend(self.pairing.add(plane, stamp_ns, slot))
        return self._complete()

    def add_camera_info(self, plane: Plane, message: Any, *, latched: bool = False) -> list[Pair[Frame]]:
        """Take a CameraInfo (`latched`: from a publisher that latches), give back the pairs that are complete now."""
        self.frames[plane].take_camera_info(message, latched=latched)
        return self._complete()

    def flush(self) -> list[Pair[Frame]]:
        """The pairs that are left when nothing more will come."""
        self._decided.extend(self.pairing.flush())
        return self._complete(final=True)

    def _complete(self, final: bool = False) -> list[Pair[Frame]]:
        self._settle(final)
        complete = self._take_settled()
        if len(self._decided) > _MAX_DECIDED:
            self._settle(final=True)
            complete += self._take_settled()
        return complete

    def _settle(self, final: bool) -> None:
        for plane in PLANES:
            for _, frame in self.frames[plane].settled(final):
                slot = self._unsettled[plane].popleft()
                slot.settled, slot.frame = True, frame

    def _take_settled(self) -> list[Pair[Frame]]:
        complete: list[Pair[Frame]] = []
        while self._decided and all(slot.settled for slot in _slots(self._decided[0])):
            pair = self._decided.popleft()
            a, b = (None if slot is None else slot.frame for slot in (pair.a, pair.b))
            self._new_run = self._new_run or pair.new_run
            if a is not None or b is not None:
                complete.append(Pair(pair.stamp_ns, a, b, self._new_run))
                self._new_run = False
        return complete


def _slots(pair: Pair[_Slot]) -> list[_Slot]:
    return [slot for slot in (pair.a, pair.b) if slot is not None]
