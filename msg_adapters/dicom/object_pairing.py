"""When plane B's object begins, against plane A's: by their clocks, or by what moves in both films at the same time."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import RecordingError
from msg_adapters.dicom.objects import tag_name
from msg_adapters.dicom.xa_object import XaObject

Array = npt.NDArray[np.float64]
NANOSECONDS = 1_000_000_000


@dataclass(frozen=True)
class OffsetTuning:
    """Constants of the estimate.

    Attributes:
        thumbnail_px: side of the reduced pictures whose change is measured: noise is averaged out, motion is not.
        reach_s: how far apart the beginnings may be: clocks in whole seconds, or one pedal for both planes.
        least_frames: of A that must overlap with B for a correlation to mean anything.
        least_correlation: of the planes' changes at the best offset.
        least_lead: by which it must exceed that at any offset further than a frame and a half from it.
    """

    thumbnail_px: int = 64
    reach_s: float = 2.0
    least_frames: int = 8
    least_correlation: float = 0.6
    least_lead: float = 0.15


TUNING = OffsetTuning()


def plane_b_offset(a: XaObject, b: XaObject, given_s: float | None) -> tuple[int, str]:
    """How much later B's first frame was taken than A's.

    Args:
        a: plane A's object.
        b: plane B's.
        given_s: what the user says, seconds; None: by clocks or pictures.

    Returns:
        Nanoseconds, and in words where they come from.

    Raises:
        RecordingError: neither clocks nor pictures tell.
    """
    if given_s is not None:
        return round(given_s * NANOSECONDS), f"plane B begins {given_s:+.3f} s after plane A, as given"
    reason = "the objects have no clock in common"
    for clock in a.clocks:
        if clock not in b.clocks:
            continue
        offset = b.clocks[clock] - a.clocks[clock]
        words = f"plane B begins {offset / NANOSECONDS:+.3f} s after plane A by {tag_name(clock)}"
        if not -b.times_ns[-1] <= offset <= a.times_ns[-1]:
            reason = f"{words}, so that the films do not overlap"
        elif clock not in a.fine_clocks | b.fine_clocks and len(a.times_ns) > 1:
            reason = f"{tag_name(clock)} is in whole seconds"
        else:
            return offset, words
    estimated = estimate_offset_s(a, b)
    if estimated is None:
        raise RecordingError(
            f"{reason}, and the pictures do not tell how the films belong together: add --plane-b-offset"
        )
    return (
        round(estimated * NANOSECONDS),
        f"{reason}: plane B begins {estimated:+.3f} s after plane A by what moves in both films, to within half a frame"
        " (--plane-b-offset)",
    )


def estimate_offset_s(a: XaObject, b: XaObject, tuning: OffsetTuning = TUNING) -> float | None:
    """How much later B begins, seconds, from the change between frames; None where several offsets fit as well."""
    if min(len(a.times_ns), len(b.times_ns)) < tuning.least_frames:
        return None
    changes = {one: _changes(one, tuning.thumbnail_px) for one in (a, b)}
    times_a, times_b = (np.asarray(one.times_ns[1:], dtype=np.float64) / NANOSECONDS for one in (a, b))
    period = float(np.median(np.diff(times_a)))
    steps = int(tuning.reach_s / (0.5 * period))
    offsets = 0.5 * period * np.arange(-steps, steps + 1)
    scores = np.full(len(offsets), -1.0)
    for place, offset in enumerate(offsets):
        inside = (times_a >= times_b[0] + offset - 1e-9) & (times_a <= times_b[-1] + offset + 1e-9)
        if inside.sum() >= tuning.least_frames:
            there = np.interp(times_a[inside] - offset, times_b, changes[b])
            scores[place] = _correlation(changes[a][inside], there)
    best = int(np.argmax(scores))
    others = scores[np.abs(offsets - offsets[best]) > 1.6 * period]
    rival = float(others.max()) if others.size else -1.0
    if scores[best] < tuning.least_correlation or scores[best] - rival < tuning.least_lead:
        return None
    return float(offsets[best])


def _changes(one: XaObject, side: int) -> Array:
    """(N − 1,) how much each picture differs from the one before it."""
    before, found = None, []
    for picture in one.pictures():
        now = cv2.resize(picture, (side, side), interpolation=cv2.INTER_AREA).astype(np.float64)
        if before is not None:
            found.append(float(np.mean(np.abs(now - before))))
        before = now
    return np.asarray(found)


def _correlation(one: Array, other: Array) -> float:
    one, other = one - one.mean(), other - other.mean()
    size = float(np.sqrt((one @ one) * (other @ other)))
    return float(one @ other) / size if size > 0.0 else -1.0
