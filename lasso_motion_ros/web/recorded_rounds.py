"""A recording that is played over and over with later stamps: which recorded stamp one of the stream's is."""

from __future__ import annotations


def recorded_stamp(stamp_ns: int, first_ns: int, period_ns: int) -> int:
    """The stamp in the recording, ns.

    Args:
        stamp_ns: in the stream.
        first_ns: a time between two rounds, just before the first one's images.
        period_ns: how much later each round's stamps are; 0: nothing is played in rounds.
    """
    return stamp_ns - max(0, (stamp_ns - first_ns) // period_ns) * period_ns if period_ns else stamp_ns
