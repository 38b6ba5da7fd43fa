"""Whether images come, and how soon the tracker answers them."""

from __future__ import annotations

import statistics
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.stream.pace import Pace, stopped_after_s
from lasso_motion_ros.web.recent import Recent


@dataclass(frozen=True)
class _Tuning:
    """What is remembered.

    Attributes:
        unanswered: images of plane A that may still be answered.
        latencies: answers over which the latency is taken.
    """

    unanswered: int = 64
    latencies: int = 64


TUNING = _Tuning()


class StreamHealth:
    """Follows images and answers by their stamps.

    Args:
        clock: steady clock, seconds.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._began_at_s: float | None = None
        self._paces: dict[Plane, Pace] = {plane: Pace() for plane in PLANES}
        self._held_at_s: dict[Plane, float] = {}
        self._received: Recent[int, tuple[float, bool]] = Recent(TUNING.unanswered)
        self._latencies_ms: deque[float] = deque(maxlen=TUNING.latencies)

    def add_image(self, plane: Plane, stamp_ns: int, *, answer_expected: bool) -> None:
        """Take note of an image.

        Args:
            plane: its plane.
            stamp_ns: its stamp.
            answer_expected: whether the tracker answers at once. A pair that waits for clicks is answered when they
                come: that says nothing about speed.
        """
        now, age_s = self._clock(), self.image_age_s
        if age_s is None or age_s > self.stopped_after_s:
            self._began_at_s = now
        self._paces[plane].arrived(now)
        if plane == "a":
            newest = self._received.newest
            if newest is not None and stamp_ns < newest:
                self._received.clear()  # another run: its stamps may be those of the last
            self._received[stamp_ns] = now, answer_expected

    def add_held(self, plane: Plane) -> None:
        """Take note of a picture that is no new exposure, but the last one shown again."""
        self._held_at_s[plane] = self._clock()

    def is_held(self, plane: Plane) -> bool:
        """Whether pictures of a plane come that are no new exposure."""
        held_at_s = self._held_at_s.get(plane)
        return held_at_s is not None and self._clock() - held_at_s <= stopped_after_s([self._paces[plane]])

    def add_answer(self, stamp_ns: int) -> float:
        """Take note of the answer to plane A's image of this stamp.

        Returns:
            When that image came, or now if it has not: a pose may overtake its image, which is larger.
        """
        at_s, expected = self._received.get(stamp_ns, (self._clock(), False))
        if expected:
            self._latencies_ms.append(1e3 * (self._clock() - at_s))
        return at_s

    def has_seen(self, plane: Plane) -> bool:
        """Whether an image has come."""
        return self._paces[plane].last_s is not None

    @property
    def image_age_s(self) -> float | None:
        """Seconds since the last image of either plane; None before the first."""
        last = [pace.last_s for pace in self._paces.values() if pace.last_s is not None]
        return self._clock() - max(last) if last else None

    @property
    def coming_s(self) -> float:
        """Seconds since the images have begun to come, or to come again."""
        return 0.0 if self._began_at_s is None else self._clock() - self._began_at_s

    @property
    def stopped_after_s(self) -> float:
        """Seconds without an image, or without an answer to one, after which they have stopped to come."""
        return stopped_after_s(self._paces.values())

    def silence_s(self, plane: Plane) -> float | None:
        """Seconds since the last image, if that is longer than the images' rate explains; else None."""
        pace = self._paces[plane]
        if pace.last_s is None:
            return None
        age = self._clock() - pace.last_s
        return age if age > stopped_after_s([pace]) else None

    @property
    def latency_ms(self) -> float | None:
        """Median time from image to answer, milliseconds."""
        return statistics.median(self._latencies_ms) if self._latencies_ms else None

    @property
    def worst_latency_ms(self) -> float | None:
        """The longest time from image to answer, milliseconds."""
        return max(self._latencies_ms, default=None)
