"""The motion trace: where the loop's centre has gone since the reference, over the last seconds."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.covariance import at_point
from lasso_motion_ros.geometry.transforms import apply, inverse
from lasso_motion_ros.web.source import TracePoint

Array = npt.NDArray[np.float64]

TRACE_S = 30.0
SIGMA_VALID_NS = 1_000_000_000
"""A covariance holds for motions that are later by no more than this."""
_MOST_POINTS = 4000


class MotionTrace:
    """Makes the trace from motions and loops.

    Args:
        clock: steady clock, seconds.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._points: deque[TracePoint] = deque(maxlen=_MOST_POINTS)
        self._motion: tuple[int, Array] | None = None
        self._centre: Array | None = None
        self._sigma: tuple[int, float] | None = None

    def add_motion(self, stamp_ns: int, motion: Array, at_s: float) -> None:
        """Add the point of a motion (4, 4) whose image came at the given time of the clock."""
        self._motion = stamp_ns, motion
        # A rotation about the distant origin moves the loop too: the displacement of the loop's centre counts.
        at = np.zeros(3) if self._centre is None else self._centre
        shift_mm = 1e3 * (apply(motion, at[None])[0] - at)
        self._add((float(shift_mm[0]), float(shift_mm[1]), float(shift_mm[2])), at_s)

    def add_loop(self, stamp_ns: int, loop: Array) -> None:
        """Take the catheter's curve (N, 3), world metres; its pair's motion then gives the centre at the reference."""
        if len(loop) and self._motion is not None and self._motion[0] == stamp_ns:
            self._centre = apply(inverse(self._motion[1]), loop.mean(axis=0)[None])[0]

    def add_covariance(self, stamp_ns: int, motion: Array, covariance: Array) -> None:
        """Take how sure a motion (4, 4) is: its (6, 6) covariance at the world's origin, ROS order, m and rad."""
        if self._centre is not None:
            spread = at_point(covariance, apply(motion, self._centre[None])[0])
            self._sigma = stamp_ns, 1e3 * float(np.sqrt(max(0.0, np.linalg.eigvalsh(spread)[-1])))

    @property
    def sigma_mm(self) -> float | None:
        """Standard deviation of the loop's place at the last motion, in its worst direction; None: not known."""
        if self._sigma is None or self._motion is None or abs(self._sigma[0] - self._motion[0]) > SIGMA_VALID_NS:
            return None
        return self._sigma[1]

    def interrupt(self) -> None:
        """Add a gap: there is no pose any more."""
        self._add(None, self._clock())

    def points(self, after: int) -> list[TracePoint]:
        """Those of the last 30 s with a number above `after`."""
        begin = self._clock() - TRACE_S
        return [point for point in self._points if point.number > after and point.time_s >= begin]

    def _add(self, shift_mm: tuple[float, float, float] | None, at_s: float) -> None:
        number = self._points[-1].number + 1 if self._points else 1
        self._points.append(TracePoint(number, at_s, shift_mm))
