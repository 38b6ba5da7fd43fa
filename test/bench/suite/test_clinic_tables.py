"""Runs and table of the clinic suite: per event class, by hand."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from support.clinic_inputs import STILL, short

from lasso_motion_ros.bench.suite.clinic_runs import ClinicResult, run_clinic
from lasso_motion_ros.bench.suite.clinic_scenarios import ClinicScenario, clinic_scenario
from lasso_motion_ros.bench.suite.clinic_tables import ALL, class_measures, format_clinic
from lasso_motion_ros.bench.suite.sequence import SequenceResult
from lasso_motion_ros.cli.main import main
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.evaluation.measures import PairScore


def score(index: int, *, pose: bool = True, error_mm: float = 0.1, **given: object) -> PairScore:
    plain = {"is_reference": index == 0, "expected": index > 0, "hidden": False, "displaced": False}
    state = "TRACKING" if pose else "LOST"
    centre = {"centre_error_m": np.array([1e-3 * error_mm, 0.0, 0.0]), "nees": error_mm} if pose else {}
    return PairScore(index, index, has_pose=pose, state=state, **(plain | centre | given))  # type: ignore[arg-type]


def result(since: dict[str, int], *scores: PairScore, plain: tuple[bool, ...], refused: str = "") -> ClinicResult:
    tracked = SequenceResult(STILL, scores, frozenset(), ("",) * len(scores), refused)
    return ClinicResult(ClinicScenario(STILL, since), tracked, plain)


def test_measures_by_class_by_hand() -> None:
    one = result(
        {"slide": 2},
        score(0),
        score(1, error_mm=0.2),
        score(2, pose=False),
        score(3, error_mm=5.0, expected=False),
        score(4, pose=False),
        plain=(True, True, True, True, False),
    )
    found = class_measures([one.judged])
    assert set(found) == {"core", "slide", ALL}
    slide = found["slide"]
    assert (slide.sequences, slide.pairs, slide.plain, slide.poses) == (1, 3, 1, 1)
    # The second pair is plain and without a pose; the fourth is neither plain nor, for this, missing.
    assert (slide.wrong, slide.missing) == (1, 1)
    assert slide.centre_mm == pytest.approx(5.0)
    assert slide.nees == pytest.approx(5.0)
    assert (found["core"].pairs, found["core"].wrong, found["core"].inside_68) == (1, 0, 1.0)
    assert found[ALL].nees == pytest.approx(2.6)
    assert found[ALL].pairs == 4


def test_the_table() -> None:
    refused = result({"core": 0}, score(0, pose=False), score(1, pose=False), plain=(True, True), refused="no")
    lines = format_clinic({"tracker": class_measures([refused.judged])}).splitlines()
    assert lines[0].split()[:8] == ["class", "config", "seq.", "pairs", "plain", "poses", "wrong", "missing"]
    assert lines[1].split()[:8] == ["core", "tracker", "1", "1", "1", "0", "0", "1"]
    assert lines[1].endswith("; 1 seeds refused")
    assert lines[2].startswith(ALL)


@pytest.mark.slow
def test_runs_keep_the_order_of_the_sequences(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lasso_motion_ros.bench.suite.cache.render_sequence", lambda scenario: short())
    drawn = [ClinicScenario(dataclasses.replace(STILL, name=name), {"core": 0}) for name in ("x", "y")]
    found = run_clinic(drawn, {"here": StreamConfig()})
    assert [one.drawn.scenario.name for one in found["here"]] == ["x", "y"]
    assert found["here"][0].plain == (True, True, True)
    assert class_measures([one.judged for one in found["here"]])["core"].pairs == 4


def test_the_ideas_are_weighed_on_clinic_sequences_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("lasso_motion_ros.bench.suite.cache.render_sequence", lambda scenario: short())
    chosen = ["--sequences", "1", "--ablation", "images", "--traps", "tilt"]
    assert main(["suite", "--quiet", "--clinic", *chosen, "--report", str(tmp_path)]) == 0
    whole, without = capsys.readouterr().out.splitlines()[2:4]
    assert whole.startswith("| nothing |")
    assert without.startswith("| the images' evidence |")
    assert "1 clinic sequences of seed" in (tmp_path / "ablation.md").read_text()


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("lasso_motion_ros.bench.suite.cache.render_sequence", lambda scenario: short())
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    arguments = ["suite", "--quiet", "--clinic", "--sequences", "2", "--report", str(tmp_path)]
    assert main([*arguments, "--json", str(tmp_path / "c.json")]) == 0
    assert "all pairs" in capsys.readouterr().out
    found = json.loads((tmp_path / "c.json").read_text())["tracker"]
    assert set(found["classes"]) >= {"core", "ablation", ALL}
    assert [one["since"] for one in found["sequences"]] == [dict(clinic_scenario(2009, k).since) for k in range(2)]
    assert found["sequences"][0]["pairs"][1]["classes"] == ["core"]
    assert (tmp_path / "clinic.txt").is_file()
    assert main(["suite", "--clinic", "--traps", "tilt"]) == 2
    assert "--clinic: not together with" in capsys.readouterr().err
    assert main(["suite", "--clinic", "--sequences", "2", "--only", "2"]) == 2
