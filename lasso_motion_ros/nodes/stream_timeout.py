"""When nothing that can be tracked has come for too long, or nothing was answered: what must not pass for tracking."""

from __future__ import annotations

import statistics
import threading
from collections import deque
from dataclasses import dataclass
from itertools import pairwise

from lasso_motion_ros.geometry.frames import PLANES, Plane


@dataclass(frozen=True)
class _Tuning:
    """When a stream counts as stopped where the user has not said so.

    Attributes:
        least_s: never sooner; images may come in bursts.
        periods: frame periods of the plane that has the longer ones.
        arrivals: images from which a plane's frame period is taken.
    """

    least_s: float = 1.0
    periods: float = 3.0
    arrivals: int = 9


_TUNING = _Tuning()


class StreamTimeout:
    """Follows images, pairs and answers by the steady clock, and says what has failed to come.

    It may be used from several threads. All times are of the steady clock, seconds.

    Args:
        timeout_s: the parameter `stream_timeout_s`; 0: by the frame period.
        now_s: at the start.
    """

    def __init__(self, timeout_s: float, now_s: float) -> None:
        self._lock = threading.Lock()
        self._timeout_s = timeout_s
        self._began_s = now_s
        self._arrivals: dict[Plane, deque[float]] = {plane: deque(maxlen=_TUNING.arrivals) for plane in PLANES}
        self._held_s: float | None = None
        self._unused_s: float | None = None  # since when images have come without making a pair
        self._problem = ""
        self._last_task = 0
        self._waiting_s: float | None = None

    def reconfigure(self, timeout_s: float) -> None:
        """Go on with another timeout."""
        with self._lock:
            self._timeout_s = timeout_s

    def add_image(self, plane: Plane, now_s: float) -> None:
        """An image has come, usable or not."""
        with self._lock:
            last_s = self._last_image_s()
            if self._unused_s is None or (last_s is not None and now_s - last_s > self._limit_s()):
                self._unused_s = now_s
            self._arrivals[plane].append(now_s)

    def add_held(self, now_s: float) -> None:
        """A picture has come that is no new exposure, but the last one shown again."""
        with self._lock:
            self._held_s = now_s

    def add_problem(self, text: str) -> None:
        """Something was wrong with an image or a calibration; the last one is named where none can be used."""
        with self._lock:
            self._problem = text

    def asked(self, number: int, now_s: float) -> None:
        """The tracker has been given a pair.

        Args:
            number: of its task; they count up.
            now_s: steady clock.
        """
        with self._lock:
            self._last_task = number
            self._unused_s, self._problem = None, ""
            if self._waiting_s is None:
                self._waiting_s = now_s

    def answered(self, number: int, now_s: float) -> None:
        """The tracker has answered a pair; those before it that were left out are not waited for any more."""
        with self._lock:
            self._waiting_s = None if number >= self._last_task else now_s

    def forget(self) -> None:
        """What the tracker was given is not waited for any more."""
        with self._lock:
            self._waiting_s = None

    def reason(self, now_s: float) -> str:
        """What has failed to come for too long, in a few words; empty where all is well."""
        with self._lock:
            limit_s = self._limit_s()
            if self._waiting_s is not None:
                unanswered_s = now_s - self._waiting_s
                return f"the tracker has not answered for {unanswered_s:.1f} s" if unanswered_s > limit_s else ""
            last_s = self._last_image_s()
            if last_s is None:
                return "no images yet" if now_s - self._began_s > limit_s else ""
            if now_s - last_s > limit_s:
                held = self._held_s is not None and now_s - self._held_s <= limit_s
                return f"{'the picture is held: no new exposure' if held else 'no images'} for {now_s - last_s:.1f} s"
            unused_s = 0.0 if self._unused_s is None else now_s - self._unused_s
            if unused_s > limit_s:
                return f"no image could be used for {unused_s:.1f} s: {self._problem or 'they make no pair'}"
            return ""

    def _last_image_s(self) -> float | None:
        return max((arrivals[-1] for arrivals in self._arrivals.values() if arrivals), default=None)

    def _limit_s(self) -> float:
        if self._timeout_s > 0.0:
            return self._timeout_s
        periods = [
            statistics.median(later - earlier for earlier, later in pairwise(arrivals))
            for arrivals in self._arrivals.values()
            if len(arrivals) > 1
        ]
        return max(_TUNING.least_s, _TUNING.periods * max(periods, default=0.0))
