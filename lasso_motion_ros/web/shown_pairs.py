"""Which pair the live page shows: the newest that is answered, or one that is held for clicking."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import MessageError
from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Plane
from lasso_motion_ros.web.recent import Recent
from lasso_motion_ros.web.source import PageView, Picture, PlanePicture

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """What is kept of the stream.

    Attributes:
        pairs: pairs whose pixels are kept: the tracker may hold one that is not the newest.
        loops: loops that wait for their images.
        overlays: the overlay node's pictures, for each plane.
        overlay_lag_ns: an overlay that is older than the newest pair by more than this does not keep up.
    """

    pairs: int = 12
    loops: int = 64
    overlays: int = 4
    overlay_lag_ns: int = 1_500_000_000


TUNING = _Tuning()


@dataclass(frozen=True, eq=False)
class _Seen:
    """A pair and when (steady clock, seconds) its last image came."""

    pair: FramePair
    number: int
    at_s: float


class ShownPairs:
    """The last pairs with their loops and overlays, and the picture made of them.

    A pair is shown once the tracker has answered it, so that picture and loop belong together, or when the answer
    is too long in coming; then without a loop, never with an older one.

    Args:
        answer_wait_s: how long a pair waits for the tracker's answer.
        clock: steady clock, seconds.
    """

    def __init__(self, answer_wait_s: float, clock: Callable[[], float]) -> None:
        self._wait_s, self._clock = answer_wait_s, clock
        self._pairs: deque[_Seen] = deque(maxlen=TUNING.pairs)
        self._held: _Seen | None = None
        self._loops: Recent[int, Array | None] = Recent(TUNING.loops)
        self._overlays: dict[Plane, Recent[int, tuple[int, npt.NDArray[np.uint8]]]] = {
            plane: Recent(TUNING.overlays) for plane in PLANES
        }
        self._compensated: dict[Plane, Recent[int, bool]] = {plane: Recent(TUNING.loops) for plane in PLANES}
        self._number = 0
        self._overlay_number = 0

    def add_pair(self, pair: FramePair) -> None:
        """Take the next pair; the first of a new run discards those before it."""
        if pair.new_run:
            self._loops.clear()
            self._pairs.clear()
        self._number += 1
        self._pairs.append(_Seen(pair, self._number, self._clock()))

    def add_loop(self, stamp_ns: int, loop: Array | None) -> None:
        """Take the loop (N, 3), world metres, of the pair with this stamp, or that there is none."""
        self._loops[stamp_ns] = loop

    def add_overlay(self, plane: Plane, stamp_ns: int, drawn: npt.NDArray[np.uint8]) -> None:
        """Take the overlay node's picture (H, W, 3) uint8 RGB of the image with this stamp."""
        self._overlay_number += 1
        self._overlays[plane][stamp_ns] = self._overlay_number, drawn

    def add_overlay_drawn(self, plane: Plane, stamp_ns: int, *, compensated: bool) -> None:
        """Learn whether the overlay node's picture of the image with this stamp is drawn with a motion.

        It is said ahead of the picture, though it may come after it. Where an image is drawn anew otherwise, the
        picture before is void.
        """
        if self._compensated[plane].get(stamp_ns, compensated) != compensated:
            self._overlays[plane].pop(stamp_ns, None)
        self._compensated[plane][stamp_ns] = compensated

    def whole_pairs(self) -> list[FramePair]:
        """The last pairs with images of both planes, oldest first."""
        return [seen.pair for seen in self._pairs if seen.pair.is_whole]

    def hold(self, pairs: Sequence[FramePair], stamps: Mapping[Plane, int] | None = None) -> None:
        """Keep one of some pairs on show: the one with these stamps, if it is there, else the last.

        Raises:
            MessageError: there is no pair.
        """
        whole = list(pairs)
        if stamps:
            whole = [pair for pair in whole if all(_stamp(pair, plane) == stamps[plane] for plane in stamps)] or whole
        if not whole:
            raise MessageError("there is no image pair to click in: both planes' images and calibrations are needed")
        self._number += 1
        self._held = _Seen(whole[-1], self._number, self._clock())

    def release(self) -> None:
        """Show what is new again."""
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

    def picture(
        self, view: PageView, *, has_pose: bool, held: bool = False, proposed: Array | None = None
    ) -> Picture | None:
        """The newest picture that may be shown.

        Args:
            view: the film, or the overlay node's pictures where they keep up.
            has_pose: whether the tracker has a pose, so that answers are to be expected, and loops to be shown.
            held: the pair that is held, if there is one.
            proposed: (N, 3) a ring that was found, world metres, to be shown while there is no pose.
        """
        if held and self._held is not None:
            return _film(self._held, None, held=True)
        drawn = self._drawn(has_pose=has_pose) if view == "overlay" else None
        if drawn is not None:
            return drawn
        now = self._clock()
        for seen in reversed(self._pairs):
            if not has_pose or seen.pair.stamp_ns in self._loops or now - seen.at_s >= self._wait_s:
                return _film(seen, self._loops.get(seen.pair.stamp_ns) if has_pose else proposed, held=False)
        return None

    def _drawn(self, *, has_pose: bool) -> Picture | None:
        """The overlay node's pictures of the newest pair of which it has drawn all, while it keeps up."""
        for seen in reversed(self._pairs):
            if self._pairs[-1].pair.stamp_ns - seen.pair.stamp_ns > TUNING.overlay_lag_ns:
                return None
            frames = seen.pair.frames
            if not all(frame.stamp_ns in self._overlays[plane] for plane, frame in frames.items()):
                continue
            drawn = {plane: self._overlays[plane][frame.stamp_ns] for plane, frame in frames.items()}
            if any(self._compensated[plane].get(frame.stamp_ns) != has_pose for plane, frame in frames.items()):
                continue  # the pictures, the planes and the headline must say the same
            loop = self._loops.get(seen.pair.stamp_ns) if has_pose else None
            planes = {
                plane: PlanePicture(frame.stamp_ns, drawn[plane][1], _projected(loop, frame))
                for plane, frame in frames.items()
            }
            # A new drawing is a new picture. Films have the numbers 4n and 4n + 1, overlays 8n + 2 and 8n + 6.
            number = max(number for number, _ in drawn.values())
            return Picture(4 * (2 * number + (loop is not None)) + 2, False, planes)
        return None


def _film(seen: _Seen, loop: Array | None, *, held: bool) -> Picture:
    planes = {
        plane: PlanePicture(frame.stamp_ns, frame.pixels, _projected(loop, frame))
        for plane, frame in seen.pair.frames.items()
    }
    # The same pair has another number once its loop has come.
    return Picture(4 * seen.number + (loop is not None), held, planes)


def _projected(loop: Array | None, frame: Frame) -> Array | None:
    return None if loop is None else frame.projection.project(loop)


def _stamp(pair: FramePair, plane: Plane) -> int | None:
    frame = pair.frame(plane)
    return None if frame is None else frame.stamp_ns
