"""How soon a tracker notices that the lasso is hidden, removed or moved, and that it is back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lasso_motion_ros.bench.suite.sequence import SequenceResult
from lasso_motion_ros.tracking.tracker import TrackerState


@dataclass(frozen=True)
class EventTiming:
    """How one event was noticed.

    Attributes:
        sequence: name of the sequence.
        kind: hide, remove or move.
        pairs_to_silence: poses published after it before the first pair without one; 0 is at once.
        pairs_to_recovery: pairs from the lasso's return to the first pose; None where it did not return or recover.
        pairs_to_displaced: pairs from the first displaced one to DISPLACED; None where it was not said.
        returned: whether the sequence goes on after it with the lasso in its place.
    """

    sequence: str
    kind: str
    pairs_to_silence: int | None
    pairs_to_recovery: int | None
    pairs_to_displaced: int | None
    returned: bool


def event_timings(results: Sequence[SequenceResult]) -> tuple[EventTiming, ...]:
    """How every hidden, removed or moved lasso was noticed, in the sequences whose seed was taken."""
    timings = []
    for result in results:
        for event in result.scenario.events:
            if result.refused or event.kind not in ("hide", "remove", "move"):
                continue
            absent = [score for score in result.scores if score.hidden or score.displaced]
            if not absent:
                continue
            back = [score for score in result.scores if score.index > absent[-1].index]
            timings.append(
                EventTiming(
                    sequence=result.scenario.name,
                    kind=event.kind,
                    pairs_to_silence=_first([not score.has_pose for score in absent]),
                    pairs_to_recovery=_first([score.has_pose for score in back]) if event.kind == "hide" else None,
                    pairs_to_displaced=_first([score.state == TrackerState.DISPLACED.value for score in absent])
                    if event.kind == "move"
                    else None,
                    returned=bool(back),
                )
            )
    return tuple(timings)


def timing_distribution(timings: Sequence[EventTiming]) -> dict[str, dict[str, int]]:
    """How many events took how many pairs, by what was waited for; "never" where it did not come.

    Pairs are counted from the one that had the event: 0 is in that very pair. A lasso that is hidden till the end
    of its sequence, or is not seen again for another reason, has no recovery to wait for.
    """
    waits = {
        "to no pose, hidden or taken out": [t.pairs_to_silence for t in timings if t.kind != "move"],
        "to no pose, moved": [t.pairs_to_silence for t in timings if t.kind == "move"],
        "to DISPLACED, moved": [t.pairs_to_displaced for t in timings if t.kind == "move"],
        "from the return to a pose, hidden": [t.pairs_to_recovery for t in timings if t.kind == "hide" and t.returned],
    }
    distribution: dict[str, dict[str, int]] = {}
    for name, pairs in waits.items():
        names = [str(count) for count in sorted({count for count in pairs if count is not None})]
        counts = {count: sum(str(value) == count for value in pairs) for count in names}
        if None in pairs:
            counts["never"] = pairs.count(None)
        distribution[name] = counts
    return distribution


def _first(flags: Sequence[bool]) -> int | None:
    return next((number for number, flag in enumerate(flags) if flag), None)
