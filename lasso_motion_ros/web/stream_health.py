"""Whether images come, and how soon the tracker answers them."""

from __future__ import annotations

import statistics
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.web.recent import Recent


@dataclass(frozen=True)
class _Tuning:
    """When a plane counts as silent, and what is remembered.

    Attributes:
        silent_s: a plane is silent after this long without an image, seconds,
        silent_periods: or after this many frame periods, whichever is longer;
        silent_at_most_s: but no later than this, seconds.
        pause_s: images that come after a pause of this long, seconds, have begun anew,
        pause_periods: or after this many frame periods, whichever is longer.
        arrivals: images from which a plane's frame period is taken.
        unanswered: images of plane A that may still be answered.
        latencies: answers over which the latency is taken.
    """

    silent_s: float = 1.5
    silent_periods: float = 4.0
    silent_at_most_s: float = 5.0
    pause_s: float = 0.9
    pause_periods: float = 3.0
    arrivals: int = 8
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
        self._arrivals: dict[Plane, deque[float]] = {plane: deque(maxlen=TUNING.arrivals) for plane in PLANES}
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
        pause_s = max(TUNING.pause_s, TUNING.pause_periods * (self.period_s(plane) or 0.0))
        if age_s is None or age_s > pause_s:
            self._began_at_s = now
        self._arrivals[plane].append(now)
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
        return held_at_s is not None and self._clock() - held_at_s <= TUNING.silent_s

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
        return bool(self._arrivals[plane])

    @property
    def image_age_s(self) -> float | None:
        """Seconds since the last image of either plane; None before the first."""
        last = [arrivals[-1] for arrivals in self._arrivals.values() if arrivals]
        return self._clock() - max(last) if last else None

    @property
    def coming_s(self) -> float:
        """Seconds since the images have begun to come, or to come again."""
        return 0.0 if self._began_at_s is None else self._clock() - self._began_at_s

    def period_s(self, plane: Plane) -> float | None:
        """Median time between a plane's last images, seconds; None before the second."""
        periods = [later - earlier for earlier, later in pairwise(self._arrivals[plane])]
        return statistics.median(periods) if periods else None

    def silence_s(self, plane: Plane) -> float | None:
        """Seconds since the last image, if that is longer than the images' rate explains; else None."""
        arrivals = self._arrivals[plane]
        if not arrivals:
            return None
        age = self._clock() - arrivals[-1]
        allowed = max(TUNING.silent_s, TUNING.silent_periods * (self.period_s(plane) or 0.0))
        return age if age > min(allowed, TUNING.silent_at_most_s) else None

    @property
    def latency_ms(self) -> float | None:
        """Median time from image to answer, milliseconds."""
        return statistics.median(self._latencies_ms) if self._latencies_ms else None

    @property
    def worst_latency_ms(self) -> float | None:
        """The longest time from image to answer, milliseconds."""
        return max(self._latencies_ms, default=None)
