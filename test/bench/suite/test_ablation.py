"""Ablation: every idea can be switched off and comes back, and what it costs is told right."""

import dataclasses

import numpy as np
import pytest
from support.message_inputs import FakeTracker
from support.suite_inputs import SMALL, small

from lasso_motion_ros.bench.suite.ablation import Outcome, changes, format_ablation, track_variants
from lasso_motion_ros.bench.suite.ideas import IDEAS, Idea, TurningWithTheRing
from lasso_motion_ros.bench.suite.sequence import SequenceResult
from lasso_motion_ros.bench.suite.traps import TRAPS, Trap
from lasso_motion_ros.config.parameters import configuration_values
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.evaluation.measures import PairScore
from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.geometry.transforms import apply
from lasso_motion_ros.ring.ring_options import RingOptions
from lasso_motion_ros.tracking.tracker import TrackResult

CENTRE = np.array([0.1, 0.2, 0.3])


@pytest.mark.parametrize("name", IDEAS)
def test_an_idea_changes_its_own_parameters_only(name: str) -> None:
    idea = IDEAS[name]
    assert idea.parameters or idea.options or idea.around
    usual = configuration_values(StreamConfig())
    changed = configuration_values(idea.configuration(StreamConfig()))
    assert {key for key in usual if usual[key] != changed[key]} == set(idea.parameters)
    assert idea.options != RingOptions()


class TurnedRing(FakeTracker):
    """A ring that has turned by 0.1 rad about z, in an atrium that has not moved."""

    def _result(self, pair: FramePair) -> TrackResult:
        angles = np.linspace(0.0, 2.0 * np.pi, 65) + 0.1 * self.count
        loop = CENTRE + 0.01 * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
        return dataclasses.replace(super()._result(pair), motion=np.eye(4), loop=loop)


def test_a_ring_that_turns_turns_the_motion_with_it() -> None:
    sequence = small()
    tracker = TurningWithTheRing(TurnedRing())
    tracker.initialise(sequence.pairs[0], sequence.seed)
    motion = tracker.track(sequence.pairs[1]).motion
    assert motion is not None
    np.testing.assert_allclose(motion[:2, 0], [np.cos(0.1), np.sin(0.1)], atol=1e-4)
    np.testing.assert_allclose(apply(motion, CENTRE[None])[0], CENTRE, atol=1e-4)


def counted(ideas: list[Idea], *traps: Trap) -> list[Outcome]:
    """What becomes of one sequence, whole and without each idea: as a random one, and as one of these traps'."""
    outcomes = [Outcome(None), *(Outcome(idea) for idea in ideas)]
    for trap in (None, *traps):
        for one, variant in zip(outcomes, track_variants(small(), ideas, StreamConfig()), strict=True):
            one.add(variant, trap)
    return outcomes


@pytest.fixture(scope="module")
def outcomes() -> list[Outcome]:
    """What becomes of one sequence, whole and without each idea; read only."""
    return counted(list(IDEAS.values()))


@pytest.mark.slow
def test_every_idea_switched_off_still_tracks(outcomes: list[Outcome]) -> None:
    assert outcomes[0].idea is None
    assert [outcome.idea for outcome in outcomes[1:]] == list(IDEAS.values())
    assert all(outcome.pairs == 2 and outcome.ms > 0.0 for outcome in outcomes)
    by_name = {outcome.idea.name: outcome.measures for outcome in outcomes[1:] if outcome.idea is not None}
    whole = outcomes[0].measures
    assert whole.model_mm is not None
    # On any sequence: the ring's own tilt is not the atrium's, and another template registers elsewhere.
    assert by_name["translation"].target_mean_mm > whole.target_mean_mm
    assert by_name["shared"] != whole
    # What these would change did not happen here.
    assert by_name["slide"] == by_name["ghost"] == whole


@pytest.mark.slow
def test_traps_are_counted_by_themselves(outcomes: list[Outcome]) -> None:
    ideas = [IDEAS["ghost"], IDEAS["translation"]]
    trapped = counted(ideas, TRAPS["tilt"], TRAPS["gantry"])
    without = [next(one for one in outcomes if one.idea is idea) for idea in (None, *ideas)]
    for one, other in zip(trapped, without, strict=True):
        assert (one.pairs, one.measures) == (other.pairs, other.measures)
        assert {name: len(results) for name, results in one.trapped.items()} == {"tilt": 1, "gantry": 1}
        # The sequence is the same; TRACKING is only wrong where doubt is due.
        assert (one.traps["tilt"].unsaid, one.traps["gantry"].unsaid) == (0, 2)
    # Each idea is switched off in the traps, too, and only for its own row.
    targets = [one.traps["tilt"].measures.target_mean_mm for one in trapped]
    assert targets[0] is not None
    assert targets[0] == targets[1] < targets[2]


def outcome(errors_mm: list[float | None], ms: float = 10.0, idea: str | None = "ring") -> Outcome:
    """One sequence; None is a missing pose."""
    scores = [
        PairScore(
            index,
            index,
            is_reference=False,
            expected=True,
            hidden=False,
            displaced=False,
            has_pose=error is not None,
            state="LOST" if error is None else "TRACKING",
            centre_error_m=None if error is None else np.array([1e-3 * error, 0.0, 0.0]),
            target_error_mm=error,
        )
        for index, error in enumerate(errors_mm, start=1)
    ]
    result = SequenceResult(SMALL, tuple(scores), frozenset(), ("",) * len(scores), "")
    return Outcome(None if idea is None else IDEAS[idea], [result], 1e-3 * ms * len(scores), len(scores))


def test_costs_by_hand() -> None:
    whole = outcome([0.1, 0.1, 0.3, 0.3], idea=None)
    assert changes(whole, outcome([0.1, 0.1, 0.3, 0.301], ms=10.5)) == ([], [])
    worse, better = changes(whole, outcome([0.1, 0.1, 3.0, None], ms=8.0))
    assert worse[:3] == ["silent +1", "missing +1", "centre +433 %"]
    assert better == ["time -20 %"]
    assert changes(whole, outcome([0.05, 0.05, 0.15, 0.15]))[0] == []
    table = format_ablation([whole, outcome([0.1, 0.1, 3.0, None]), outcome([0.1, 0.1, 0.3, 0.3], idea="gap")])
    lines = table.splitlines()
    assert lines[2].startswith("| nothing | 0 | 0 | 0 | 0.20 | 0.30 |")
    assert lines[3].startswith("| the ring's own tilt, spin and size | 1 | 1 | 0 |")
    assert "| 1 / 0 |" in lines[3]
    assert lines[-1] == "Nothing is worse without: the planes' disagreement."


def test_what_is_worse_in_a_trap_is_named() -> None:
    def trapped(errors_mm: list[float | None], idea: str | None = "ring") -> Outcome:
        quiet = outcome([0.1, 0.1], idea=idea)
        quiet.trapped = {"tilt": outcome(errors_mm).results, "jump": outcome([0.1]).results}
        return quiet

    whole = trapped([0.1, 0.1, None], idea=None)
    assert changes(whole, trapped([0.1, 0.1, None])) == ([], [])
    assert changes(whole, trapped([None, 3.0, 0.1])) == (
        ["tilt: silent +1", "tilt: TRE +1450 %"],
        [],
    )
    assert changes(whole, trapped([0.1, None, None])) == (["tilt: missing +1"], [])
    assert changes(whole, trapped([0.1, 0.1, 0.1])) == ([], ["tilt: missing -1"])
    # Less than a tenth, and less than 0.02 mm, is no change in so few pairs.
    assert changes(whole, trapped([0.109, 0.109, None])) == ([], [])
    assert changes(whole, trapped([0.115, 0.115, None])) == ([], [])
    lines = format_ablation([whole, trapped([0.1, None, None]), trapped([0.1, 0.1, None], idea="ghost")]).splitlines()
    assert lines[2].endswith("|  | 0 | 1 | 0 |  |  |")
    assert lines[3].endswith("| 0 / 0 | 0 | 2 | 0 | tilt: missing +1 | – |")
    assert lines[-1] == "Nothing is worse without: asking that contrast does not fade."
