"""States of a sequence pair by pair, as one line of text beside what was due: an event's course at a glance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lasso_motion_ros.evaluation.measures import PairScore
from lasso_motion_ros.tracking.tracker import TrackerState

LETTERS = {
    TrackerState.TRACKING.value: "T",
    TrackerState.DEGRADED.value: "d",
    TrackerState.LOST.value: "-",
    TrackerState.DISPLACED.value: "x",
}
WRONG, REFUSED = "!", "r"
DUE, NOT_DUE, ABSENT = "o", ".", "x"
LEGEND = (
    "due: o a pose, . none, x none, the ring being hidden, gone or displaced; "
    "state: T TRACKING, d DEGRADED, - LOST, x DISPLACED, ! a wrong pose, r seed refused"
)


@dataclass(frozen=True)
class StateStrip:
    """One sequence.

    Attributes:
        due: a letter for each pair: what it asks for.
        states: a letter for each pair: what was said.
    """

    due: str
    states: str


def state_strip(scores: Sequence[PairScore], *, refused: bool = False) -> StateStrip:
    """The strip of a sequence.

    Args:
        scores: of its pairs, in order.
        refused: whether its seed was refused: then no pair has a state.
    """
    due = "".join(
        ABSENT if s.hidden or s.displaced else DUE if s.expected or s.is_reference else NOT_DUE for s in scores
    )
    if refused:
        return StateStrip(due, REFUSED * len(scores))
    return StateStrip(due, "".join(WRONG if s.lost_in_silence else LETTERS.get(s.state, "?") for s in scores))


def format_strips(strips: Sequence[tuple[str, StateStrip]]) -> str:
    """Two lines for each named strip, the due one first."""
    width = max((len(name) for name, _ in strips), default=0)
    lines = []
    for name, strip in strips:
        lines += [f"{name:<{width}}  due    {strip.due}", f"{'':<{width}}  state  {strip.states}"]
    return "\n".join([*lines, LEGEND])
