"""When nothing that can be tracked has come for too long, or nothing was answered: what must not pass for tracking."""

from __future__ import annotations

import threading

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.stream.pace import Pace, stopped_after_s


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
        self._paces: dict[Plane, Pace] = {plane: Pace() for plane in PLANES}
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
            self._paces[plane].arrived(now_s)

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
        return max((pace.last_s for pace in self._paces.values() if pace.last_s is not None), default=None)

    def _limit_s(self) -> float:
        return self._timeout_s if self._timeout_s > 0.0 else stopped_after_s(self._paces.values())
