"""How much later one plane's film is than the other's, by what moves in both at the same time."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import Plane
from msg_adapters.images import Pixels
from msg_adapters.sync.held_picture import HeldPicture

Array = npt.NDArray[np.float64]
NANOSECONDS = 1_000_000_000


@dataclass(frozen=True)
class OffsetTuning:
    """Constants of the estimate.

    Attributes:
        thumbnail_px: side of the reduced pictures whose change is measured: noise is averaged out, motion is not.
        reach_s: how far apart the films may be: clocks in whole seconds, one pedal for both planes, or grabbers.
        least_frames: of A that must overlap with B for a correlation to mean anything.
        least_correlation: of the planes' changes at the best offset.
        least_lead: by which it must exceed that at any offset further than a frame and a half from it.
        shortest_period_s: between pictures; no detector is faster, and so many offsets would take for ever.
    """

    thumbnail_px: int = 64
    reach_s: float = 2.0
    least_frames: int = 8
    shortest_period_s: float = 1e-3
    least_correlation: float = 0.6
    least_lead: float = 0.15


TUNING = OffsetTuning()


@dataclass(frozen=True)
class FilmOffset:
    """An estimate.

    Attributes:
        seconds: how much later B's film is than A's by their times, seconds.
        correlation: of the planes' changes there.
        frame_s: A's frame period: half of it is what the estimate is good to.
    """

    seconds: float
    correlation: float
    frame_s: float


class FilmChanges:
    """How much each picture of a film differs from the one before it; held pictures are left out."""

    def __init__(self) -> None:
        self.times_s: list[float] = []
        self.changes: list[float] = []
        self._picture = HeldPicture()
        self._before: Array | None = None
        self._last_ns = 0  # what goes back, or has no stamp, tells no offset

    def add(self, time_ns: int, pixels: Pixels) -> None:
        """Take the next picture, (H, W)."""
        if self._picture.shows_again(time_ns, pixels) or time_ns <= self._last_ns:
            return
        self._last_ns = time_ns
        side = TUNING.thumbnail_px
        now = cv2.resize(pixels, (side, side), interpolation=cv2.INTER_AREA).astype(np.float64)
        if self._before is not None:
            self.times_s.append(time_ns / NANOSECONDS)
            self.changes.append(float(np.mean(np.abs(now - self._before))))
        self._before = now


class FilmOffsetMeter:
    """Measures the offset between the planes' films as their pictures come."""

    def __init__(self) -> None:
        self._films: dict[Plane, FilmChanges] = defaultdict(FilmChanges)

    def add(self, plane: Plane, time_ns: int, pixels: Pixels) -> None:
        """Take the next picture of a plane, (H, W)."""
        self._films[plane].add(time_ns, pixels)

    def estimate(self) -> FilmOffset | None:
        """See `film_offset`."""
        return film_offset(self._films["a"], self._films["b"])


def film_offset(a: FilmChanges, b: FilmChanges, tuning: OffsetTuning = TUNING) -> FilmOffset | None:
    """How much later B's film is; None where the films are too short, hardly move, or several offsets fit as well."""
    if min(len(a.times_s), len(b.times_s)) < tuning.least_frames - 1:
        return None
    origin = a.times_s[0]
    times_a, times_b = np.asarray(a.times_s) - origin, np.asarray(b.times_s) - origin
    changes_a, changes_b = np.asarray(a.changes), np.asarray(b.changes)
    period = float(np.median(np.diff(times_a)))
    if period < tuning.shortest_period_s:
        return None
    steps = int(tuning.reach_s / (0.5 * period))
    offsets = 0.5 * period * np.arange(-steps, steps + 1)
    scores = np.full(len(offsets), -1.0)
    for place, offset in enumerate(offsets):
        inside = (times_a + offset >= times_b[0] - 1e-9) & (times_a + offset <= times_b[-1] + 1e-9)
        if inside.sum() >= tuning.least_frames:
            there = np.interp(times_a[inside] + offset, times_b, changes_b)
            scores[place] = _correlation(changes_a[inside], there)
    best = int(np.argmax(scores))
    others = scores[np.abs(offsets - offsets[best]) > 1.6 * period]
    rival = float(others.max()) if others.size else -1.0
    if scores[best] < tuning.least_correlation or scores[best] - rival < tuning.least_lead:
        return None
    return FilmOffset(float(offsets[best]), float(scores[best]), period)


def _correlation(one: Array, other: Array) -> float:
    one, other = one - one.mean(), other - other.mean()
    size = float(np.sqrt((one @ one) * (other @ other)))
    return float(one @ other) / size if size > 0.0 else -1.0
