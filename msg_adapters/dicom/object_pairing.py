"""When plane B's object begins, against plane A's: by their clocks, or by what moves in both films at the same time."""

from __future__ import annotations

from lasso_motion_ros.core.errors import RecordingError
from msg_adapters.dicom.objects import tag_name
from msg_adapters.dicom.xa_object import XaObject
from msg_adapters.film_offset import NANOSECONDS, FilmChanges, film_offset


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


def estimate_offset_s(a: XaObject, b: XaObject) -> float | None:
    """How much later B begins, seconds, from the change between frames; None where several offsets fit as well."""
    films = FilmChanges(), FilmChanges()
    for film, one in zip(films, (a, b), strict=True):
        for time_ns, picture in zip(one.times_ns, one.pictures(), strict=True):
            film.add(int(time_ns), picture)
    found = film_offset(films[0], films[1])
    return None if found is None else -found.seconds
