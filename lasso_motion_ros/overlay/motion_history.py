"""Which motion belongs to which image: what the overlay draws an image with, or that it must say it has none."""

from __future__ import annotations

import statistics
from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.overlay import OverlayConfig
from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.tracking.tracker import TrackerState
from msg_adapters.sync.pairing import MAX_PERIOD_NS, NEW_RUN_NS, RECENT

Array = npt.NDArray[np.float64]

KEPT = 64
NANOSECONDS = 1_000_000_000
NOT_YET = "not yet received"


@dataclass(frozen=True, eq=False)
class Choice:
    """What an image is drawn with.

    Attributes:
        motion: (4, 4) T with p_now = T · p_reference; None where none may be trusted.
        status: words for the picture: a remark on the motion, or why there is none.
        loop: (N, 3) the catheter that belongs to the motion, world metres; None where there is none.
    """

    motion: Array | None
    status: str
    loop: Array | None = None


class MotionHistory:
    """Motions by stamp, and the rule that finds an image's own.

    An image of plane A has the motion with its stamp. An image of plane B has that of the last A not later than it, up
    to half of A's frame period before it (no more than `motion_timeout_s`), or at the known exposure offset. Only
    stamps are compared.

    Args:
        config: the overlay's parameters.
    """

    def __init__(self, config: OverlayConfig) -> None:
        self._jitter_ns = round(config.sync.jitter_s * NANOSECONDS)
        offset_s = config.sync.plane_b_offset_s
        self._offset_ns = round(offset_s * NANOSECONDS) if offset_s >= 0.0 else None
        self._timeout_ns = round(config.motion_timeout_s * NANOSECONDS)
        self._motions: deque[tuple[int, Array]] = deque(maxlen=KEPT)
        self._loops: deque[tuple[int, Array]] = deque(maxlen=KEPT)
        self._state = ""
        self._last_a_ns: int | None = None
        self._intervals: deque[int] = deque(maxlen=RECENT)

    def add_state(self, state: str) -> None:
        """Take a `state`. One without a pose ends the validity of every motion before it."""
        self._state = state
        if not self.has_pose:
            self._forget()

    def add_motion(self, stamp_ns: int, motion: Array) -> None:
        """Take a `motion`."""
        if self._motions and stamp_ns < self._motions[-1][0] - NEW_RUN_NS:
            self._forget()
        self._motions.append((stamp_ns, motion))

    def add_loop(self, stamp_ns: int, loop: Array) -> None:
        """Take a `catheter`, (N, 3) world metres. Once one came, an image waits for its motion's loop too."""
        self._loops.append((stamp_ns, loop))

    def add_image(self, plane: Plane, stamp_ns: int) -> None:
        """Take note of an image's stamp: plane A's frame period is learnt from them."""
        if plane != "a":
            return
        if self._last_a_ns is not None and stamp_ns < self._last_a_ns - NEW_RUN_NS:
            self._intervals.clear()
        elif self._last_a_ns is not None:
            if stamp_ns <= self._last_a_ns:
                return
            self._intervals.append(min(stamp_ns - self._last_a_ns, MAX_PERIOD_NS))
        self._last_a_ns = stamp_ns

    def answered(self, plane: Plane, stamp_ns: int) -> bool:
        """Whether the motion of the image's own pair is there."""
        own = self._own(plane, stamp_ns)
        return own is not None and (not self._loops or self._loop(own[0]) is not None)

    def choose(self, plane: Plane, stamp_ns: int) -> Choice:
        """What to draw an image with, now."""
        if not self.has_pose:
            return Choice(None, self._state)
        remark = "" if self._state == TrackerState.TRACKING.value else self._state
        own = self._own(plane, stamp_ns)
        if own is not None:
            return Choice(own[1], remark, self._loop(own[0]))
        earlier = [(at, motion) for at, motion in self._motions if at <= stamp_ns + self._jitter_ns]
        if not earlier:
            return Choice(None, NOT_YET)
        at, motion = earlier[-1]
        age_s = (stamp_ns - at) / NANOSECONDS
        if stamp_ns - at > self._timeout_ns:
            return Choice(None, f"{age_s:.1f} s old")
        return Choice(motion, f"{remark}, motion {age_s:.2f} s old".removeprefix(", "), self._loop(at))

    @property
    def has_pose(self) -> bool:
        """Whether the tracker says that there is a pose."""
        return self._state in (TrackerState.TRACKING.value, TrackerState.DEGRADED.value)

    def _forget(self) -> None:
        self._motions.clear()
        self._loops.clear()

    def _loop(self, stamp_ns: int) -> Array | None:
        return next((loop for at, loop in reversed(self._loops) if at == stamp_ns), None)

    def _own(self, plane: Plane, stamp_ns: int) -> tuple[int, Array] | None:
        for at, motion in reversed(self._motions):
            later_ns = stamp_ns - at
            if plane == "a":
                belongs = later_ns == 0
            elif self._offset_ns is not None:
                belongs = abs(later_ns - self._offset_ns) <= self._jitter_ns
            else:
                half_ns = statistics.median_low(self._intervals) // 2 if self._intervals else 0
                belongs = -self._jitter_ns <= later_ns <= min(max(half_ns, self._jitter_ns), self._timeout_ns)
            if belongs:
                return at, motion
        return None
