"""Whether a picture is the last exposure shown again, as a frame grabber does while the pedal is up."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np

from msg_adapters.images import Pixels


@dataclass(frozen=True)
class _Tuning:
    """What tells a held picture from a new exposure.

    In a new exposure the quanta differ nearly everywhere that radiation comes through; in a held picture a clock or
    the mouse's pointer may change, all of it in one small place.

    Attributes:
        row_step: of these many rows one is looked at first, which tells nearly every new exposure.
        sampled: share of those rows' pixels above which it is one.
        place: of the picture's area, what may change in a held picture, its bounding box.
        remembered: held pictures whose exposure is remembered.
    """

    row_step: int = 16
    sampled: float = 0.04
    place: float = 0.01
    remembered: int = 256


_TUNING = _Tuning()


def shows_the_same(before: Pixels, now: Pixels) -> bool:
    """Whether two pictures (H, W) are the same exposure: equal but for what changes in one small place."""
    if before.shape != now.shape or before.dtype != now.dtype:
        return False
    step = _TUNING.row_step
    limit = _TUNING.sampled * now[::step].size
    # Of these a quarter tells nearly always.
    if any(np.count_nonzero(before[::row] != now[::row]) > limit for row in (4 * step, step)):
        return False
    rows = np.flatnonzero((_words(before) != _words(now)).any(axis=1))
    if not rows.size:
        return True
    height, inside = int(np.ptp(rows)) + 1, slice(rows[0], rows[-1] + 1)
    columns = np.flatnonzero((before[inside] != now[inside]).any(axis=0))
    return height * (int(np.ptp(columns)) + 1) <= _TUNING.place * now.size


def _words(pixels: Pixels) -> Any:
    """The same rows in words of 8 bytes, where they fill them: eight times as fast to compare."""
    fits = pixels.shape[1] * pixels.itemsize % 8 == 0 and pixels.strides[1] == pixels.itemsize
    return pixels.view(np.uint64) if fits else pixels


class HeldPicture:
    """Follows one plane's pictures.

    Attributes:
        held: the newest picture shows no new exposure.
    """

    def __init__(self) -> None:
        self.held = False
        self._exposure_ns: int | None = None
        self._pixels: Any = None
        self._shown: deque[tuple[int, int]] = deque(maxlen=_TUNING.remembered)  # exposure, and how long it was shown

    def shows_again(self, stamp_ns: int, pixels: Pixels) -> bool:
        """Take the next picture; whether it is the last exposure once more, at a later time."""
        exposure_ns, before = self._exposure_ns, self._pixels
        self.held = exposure_ns is not None and stamp_ns > exposure_ns and shows_the_same(before, pixels)
        if not self.held or exposure_ns is None:
            self._exposure_ns, self._pixels = stamp_ns, pixels
            return False
        if self._shown and self._shown[-1][0] == exposure_ns:
            self._shown.pop()
        self._shown.append((exposure_ns, stamp_ns))
        return True

    def exposure_of(self, stamp_ns: int) -> int:
        """The stamp of the exposure that the picture with this stamp shows."""
        for exposure_ns, last_ns in reversed(self._shown):
            if exposure_ns <= stamp_ns <= last_ns:
                return exposure_ns
        return stamp_ns
