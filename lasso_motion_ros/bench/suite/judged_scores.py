"""Scores of one sequence with what they count for: event classes, and whether the images plainly show the ring."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from lasso_motion_ros.evaluation.measures import PairScore, PairTruth
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.phantom.shown_poles import EVIDENCE


@dataclass(frozen=True, eq=False)
class JudgedScores:
    """What a tracker made of one sequence, as the clinic suite and the benchmark count it.

    Attributes:
        since: first pair from which on each of the sequence's event classes holds, by name.
        scores: of its pairs, in order.
        plain: per pair, whether both planes plainly show the ring, by the simulator's truth.
        refused: whether the tracker did not start: its seed was refused.
    """

    since: Mapping[str, int]
    scores: tuple[PairScore, ...]
    plain: tuple[bool, ...]
    refused: bool = False


def begun_classes(since: Mapping[str, int], pair: int) -> frozenset[str]:
    """The event classes that a pair counts for: those that have begun; before the first one, the plain core."""
    begun = frozenset(name for name, first in since.items() if pair >= first)
    return begun or frozenset({"core"})


def is_plain(true: PairTruth) -> bool:
    """Whether both planes plainly show the ring at its true electrodes."""
    return all(true.evidence.get(plane, 0.0) >= EVIDENCE.plain for plane in PLANES)
