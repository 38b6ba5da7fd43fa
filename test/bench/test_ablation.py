"""Ablation: every idea can be switched off and comes back, and what it costs is told right."""

import importlib
import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from lasso_motion_ros.bench.suite.ablation import Outcome, changes, format_ablation, run_ablation
from lasso_motion_ros.bench.suite.ideas import IDEAS, PACKAGE
from lasso_motion_ros.bench.suite.sequence import RenderedSequence, SequenceResult, render_sequence
from lasso_motion_ros.bench.suite.traps import TRAPS
from lasso_motion_ros.cli.main import main
from lasso_motion_ros.config.parameters import configuration_values
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.evaluation.measures import PairScore
from lasso_motion_ros.phantom.settings import GeometrySettings, Scenario
from lasso_motion_ros.ring.working_image import working_image

SMALL = Scenario(name="small", pairs=3, geometry=GeometrySettings(size_px=512))


@cache
def small() -> RenderedSequence:
    return render_sequence(SMALL)


def named(dotted: str) -> object:
    """What stands under a name below the package."""
    parts = (PACKAGE + dotted).split(".")
    for count in range(len(parts) - 1, 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:count]))
        except ModuleNotFoundError:
            continue
        for part in parts[count:]:
            found = getattr(found, part)
        return found
    raise AssertionError(dotted)


@pytest.mark.parametrize("name", IDEAS)
def test_an_idea_is_switched_off_and_comes_back(name: str) -> None:
    idea = IDEAS[name]
    assert idea.parameters or idea.replaced
    usual = configuration_values(StreamConfig())
    changed = configuration_values(idea.configuration(StreamConfig()))
    assert {key for key in usual if usual[key] != changed[key]} == set(idea.parameters)
    before = {key: named(key) for key in idea.replaced}
    with idea.switched_off():
        for key, value in idea.replaced.items():
            assert named(key) is value
            assert before[key] is not value
            # What replaces a constant is of its kind.
            assert callable(value) or not isinstance(before[key], float | tuple) or type(value) is type(before[key])
    assert {key: named(key) for key in idea.replaced} == before


def test_without_the_local_contrast_the_working_image_is_another() -> None:
    sequence = small()
    frame = sequence.pairs[0].a
    assert frame is not None
    assert sequence.truth.loop is not None
    centre = sequence.truth.loop.mean(axis=0)
    images = []
    for idea in (IDEAS["local"], IDEAS["speed"]):
        with idea.switched_off():
            images.append(working_image(frame, centre, bright=False, shift=np.zeros(2)).values)
    assert np.abs(images[0] - images[1]).mean() > 0.05


def test_every_idea_switched_off_still_tracks() -> None:
    outcomes = run_ablation(StreamConfig(), [small()], IDEAS.values())
    assert outcomes[0].idea is None
    assert [outcome.idea for outcome in outcomes[1:]] == list(IDEAS.values())
    assert all(outcome.pairs == 2 and outcome.ms > 0.0 for outcome in outcomes)
    by_name = {outcome.idea.name: outcome.measures for outcome in outcomes[1:] if outcome.idea is not None}
    whole = outcomes[0].measures
    assert whole.model_mm is not None
    # On any sequence: an ellipse is no lasso, and the ring's own tilt is not the atrium's.
    assert by_name["curve"].model_mm > whole.model_mm
    assert by_name["translation"].target_mean_mm > whole.target_mean_mm
    # What these would change did not happen here.
    assert by_name["speed"] == by_name["found_share"] == whole


def test_traps_are_counted_by_themselves() -> None:
    ideas = [IDEAS["robust"], IDEAS["curve"]]
    outcomes = run_ablation(StreamConfig(), [small()], ideas, [(TRAPS["tilt"], small()), (TRAPS["gantry"], small())])
    without = run_ablation(StreamConfig(), [small()], ideas)
    for one, other in zip(outcomes, without, strict=True):
        assert (one.pairs, one.measures) == (other.pairs, other.measures)
        assert {name: len(results) for name, results in one.trapped.items()} == {"tilt": 1, "gantry": 1}
        # The sequence is the same; TRACKING is only wrong where doubt is due.
        assert (one.traps["tilt"].unsaid, one.traps["gantry"].unsaid) == (0, 2)
    # Each idea is switched off in the traps, too, and only for its own row.
    models = [one.traps["tilt"].measures.model_mm for one in outcomes]
    assert models[0] is not None
    assert models[0] == models[1] < models[2]


def outcome(errors_mm: list[float | None], ms: float = 10.0, idea: str | None = "robust") -> Outcome:
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
    table = format_ablation([whole, outcome([0.1, 0.1, 3.0, None]), outcome([0.1, 0.1, 0.3, 0.3], idea="visible")])
    lines = table.splitlines()
    assert lines[2].startswith("| nothing | 0 | 0 | 0 | 0.20 | 0.30 |")
    assert lines[3].startswith("| robust weights | 1 | 1 | 0 |")
    assert "| 1 / 0 |" in lines[3]
    assert lines[-1] == "Nothing is worse without: asking for the visible share."


def test_what_is_worse_in_a_trap_is_named() -> None:
    def trapped(errors_mm: list[float | None], idea: str | None = "robust") -> Outcome:
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


def test_the_command_writes_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("lasso_motion_ros.bench.suite.cache.render_sequence", lambda scenario: small())
    arguments = ["suite", "--quiet", "--sequences", "1", "--traps", "zoom", "--ablation", "robust", "curve"]
    assert main([*arguments, "--report", str(tmp_path), "--json", str(tmp_path / "a.json")]) == 0
    text = (tmp_path / "ablation.md").read_text()
    assert "| robust weights |" in text
    assert "| an open curve: the ellipse |" in text
    assert text.count("\n| ") == 5
    assert "1 random sequences of seed 2009, 2 pairs, and 2 traps, 4 pairs." in text
    assert set(json.loads((tmp_path / "a.json").read_text())[0]["traps"]) == {"zoom"}
    assert main([*arguments, "nonsense"]) == 2
    assert "found nonsense" in capsys.readouterr().err
    assert main([*arguments, "--config", "config/tracker.yaml", "config/brost2009.yaml"]) == 2
    assert "one --config only" in capsys.readouterr().err
