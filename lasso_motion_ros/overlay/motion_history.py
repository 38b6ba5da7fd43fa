"""Which motion belongs to which image, and what the overlay says where there is none."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.overlay import OverlayConfig
from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.tracking.tracker import TrackerState
from msg_adapters.sync.partner import NEW_RUN_NS, FrameIntervals, PartnerRule

Array = npt.NDArray[np.float64]

KEPT = 64
NANOSECONDS = 1_000_000_000
NOT_YET = "no motion yet"


@dataclass(frozen=True, eq=False)
class Choice:
    """What an image is drawn with.

    Attributes:
        motion: (4, 4) T with p_now = T · p_reference; None where none may be trusted.
        status: words for the picture: a remark on the motion, or why there is none.
        loop: (N, 3) the catheter that belongs to the motion, world metres; None where there is none.
        covariance: (6, 6) of the motion, at the world origin, m and rad; None where there is none, or where the motion
            is that of an earlier pair: how far off it is now the tracker has not said.
    """

    motion: Array | None
    status: str
    loop: Array | None = None
    covariance: Array | None = None


class MotionHistory:
    """Motions by stamp, and the rule that finds an image's own.

    An image of plane A has the motion with its stamp. An image of plane B has that of the A to which it belongs by
    `PartnerRule`, as in the tracker, if that is no older than `motion_timeout_s`. Only stamps are compared.

    Args:
        config: the overlay's parameters.
    """

    def __init__(self, config: OverlayConfig) -> None:
        self._rule = PartnerRule.from_seconds(config.sync.jitter_s, config.sync.plane_b_offset_s)
        self._timeout_ns = round(config.motion_timeout_s * NANOSECONDS)
        self._motions: deque[tuple[int, Array]] = deque(maxlen=KEPT)
        self._loops: deque[tuple[int, Array]] = deque(maxlen=KEPT)
        self._covariances: deque[tuple[int, Array]] = deque(maxlen=KEPT)
        self._state = ""
        self._intervals = FrameIntervals()

    def add_state(self, state: str) -> None:
        """Take a `state`, or words for why there is none. One without a pose invalidates every motion before it."""
        self._state = state
        if not self.has_pose:
            self._forget()

    def add_motion(self, stamp_ns: int, motion: Array) -> None:
        """Take a `motion`."""
        if self._motions and stamp_ns < self._motions[-1][0] - NEW_RUN_NS:
            self._forget()
        self._motions.append((stamp_ns, motion))

    def add_loop(self, stamp_ns: int, loop: Array) -> None:
        """Take a `catheter`, (N, 3) world metres. After the first one an image also waits for its motion's loop."""
        self._loops.append((stamp_ns, loop))

    def add_covariance(self, stamp_ns: int, covariance: Array) -> None:
        """Take a motion's (6, 6) covariance. After the first one an image also waits for its motion's."""
        self._covariances.append((stamp_ns, covariance))

    def add_image(self, plane: Plane, stamp_ns: int) -> None:
        """Note an image's stamp: plane A's frame period is learnt from them."""
        if plane == "a":
            self._intervals.add(stamp_ns)

    def answered(self, plane: Plane, stamp_ns: int) -> bool:
        """Whether the motion of the image's own pair is there."""
        own = self._own(plane, stamp_ns)
        return own is not None and all(
            not known or _at(known, own[0]) is not None for known in (self._loops, self._covariances)
        )

    def choose(self, plane: Plane, stamp_ns: int) -> Choice:
        """What to draw an image with, now."""
        if not self.has_pose:
            return Choice(None, self._state)
        remark = "" if self._state == TrackerState.TRACKING.value else self._state
        own = self._own(plane, stamp_ns)
        if own is not None:
            return Choice(own[1], remark, _at(self._loops, own[0]), _at(self._covariances, own[0]))
        earlier = [(at, motion) for at, motion in self._motions if at <= stamp_ns + self._rule.jitter_ns]
        if not earlier:
            return Choice(None, NOT_YET)
        at, motion = earlier[-1]
        age_s = (stamp_ns - at) / NANOSECONDS
        if stamp_ns - at > self._timeout_ns:
            return Choice(None, f"motion {age_s:.1f} s old")
        return Choice(motion, f"{remark}, motion {age_s:.2f} s old".removeprefix(", "), _at(self._loops, at))

    @property
    def has_pose(self) -> bool:
        """Whether the tracker says that there is a pose."""
        return TrackerState.tells_of_pose(self._state)

    def _forget(self) -> None:
        self._motions.clear()
        self._loops.clear()
        self._covariances.clear()

    def _own(self, plane: Plane, stamp_ns: int) -> tuple[int, Array] | None:
        earliest, latest = 0, 0
        if plane == "b":
            earliest, latest = self._rule.window_ns(self._intervals.period_ns, self._intervals.shortest_ns)
        for at, motion in reversed(self._motions):
            if earliest <= stamp_ns - at <= min(latest, self._timeout_ns):
                return at, motion
        return None


def _at(known: deque[tuple[int, Array]], stamp_ns: int) -> Array | None:
    """The entry of a stamp, or None."""
    return next((entry for at, entry in reversed(known) if at == stamp_ns), None)
