"""Phantom sequences and scores for the tests of the suite."""

from __future__ import annotations

import dataclasses
from functools import cache

from lasso_motion_ros.bench.suite.sequence import RenderedSequence, SequenceResult, render_sequence
from lasso_motion_ros.evaluation.measures import PairScore
from lasso_motion_ros.phantom.settings import Event, GeometrySettings, Scenario

SMALL = Scenario(name="small", pairs=3, geometry=GeometrySettings(size_px=512))
EVENTFUL = dataclasses.replace(SMALL, pairs=4, events=(Event("drop", 2, plane="b"), Event("hide", 3)))


@cache
def small() -> RenderedSequence:
    """Three pairs; rendered once, so not to be changed."""
    return render_sequence(SMALL)


@cache
def eventful() -> RenderedSequence:
    """Four pairs: in the third plane B is missing, in the last the lasso is hidden."""
    return render_sequence(EVENTFUL)


def score(index: int, state: str = "TRACKING", **given: object) -> PairScore:
    """The score of a pair; by default the lasso is in its place, and has a pose if the state says so."""
    has_pose = state in ("TRACKING", "DEGRADED")
    plain = {"is_reference": index == 0, "expected": index > 0, "hidden": False, "displaced": False}
    return PairScore(index, index, state=state, **({"has_pose": has_pose} | plain | given))  # type: ignore[arg-type]


def result(*scores: PairScore, event: Event | None = None, refused: str = "") -> SequenceResult:
    """What a tracker made of a sequence; of the second pair a plane is missing."""
    scenario = dataclasses.replace(SMALL, events=() if event is None else (event,))
    return SequenceResult(scenario, scores, frozenset({1}), ("",) * len(scores), refused)
