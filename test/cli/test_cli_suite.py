"""`lasso-motion suite`: tables, files and figures of every mode, and what does not go together."""

import dataclasses
import json
import re
from pathlib import Path

import pytest
from support.suite_inputs import SMALL, eventful, small

from lasso_motion_ros.bench.model_experiment import run_model_experiment
from lasso_motion_ros.bench.suite.sweeps import SWEEPS
from lasso_motion_ros.bench.suite.traps import TRAPS
from lasso_motion_ros.cli.main import main
from lasso_motion_ros.core.worker_pool import ThisProcess


class OneRun(ThisProcess):
    """Serves one run, as a cluster does."""

    has_run = False

    def run(self, function, items):
        assert not self.has_run
        self.has_run = True
        return super().run(function, items)


def test_the_command_writes_tables_json_and_a_plot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lasso_motion_ros.bench.suite.cache.render_sequence", lambda scenario: eventful())
    arguments = ["suite", "--quiet", "--sequences", "3", "--only", "1"]
    assert main([*arguments, "--json", str(tmp_path / "r.json"), "--report", str(tmp_path / "d")]) == 0
    report = json.loads((tmp_path / "r.json").read_text())["tracker.yaml"]
    assert report["sequences_with"]["sequences"] == 1
    assert len(report["sequences"][0]["pairs"]) == 4
    assert {path.name for path in (tmp_path / "d").iterdir()} == {"suite_tracker.txt", "suite.png"}


@pytest.mark.slow
def test_the_command_sweeps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("lasso_motion_ros.bench.suite.cache.render_sequence", lambda scenario: small())
    # Every value of every trial is tracked from its seed on: as few as tell them apart.
    monkeypatch.setitem(SWEEPS, "offset", dataclasses.replace(SWEEPS["offset"], values=(0.0, 0.37)))
    monkeypatch.setitem(SWEEPS, "start", dataclasses.replace(SWEEPS["start"], values=(0.0, 25.0), trials=2))
    monkeypatch.setattr("lasso_motion_ros.cli.suite.worker_pool", lambda _: OneRun())
    arguments = ["suite", "--quiet", "--sweep", "offset", "start", "--sequences", "1", "--report", str(tmp_path)]
    assert main([*arguments, "--json", str(tmp_path / "s.json")]) == 0
    said = capsys.readouterr().out
    assert "0.37" in said
    assert "in 95 % of the trials" in said
    assert set(json.loads((tmp_path / "s.json").read_text())["offset"]["tracker"]) == {"0.0", "0.37"}
    assert {path.name for path in tmp_path.iterdir()} == {"s.json", "sweeps.txt", "sweeps.png"}


def test_the_command_runs_traps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("lasso_motion_ros.bench.suite.cache.render_sequence", lambda scenario: small())
    arguments = ["suite", "--quiet", "--traps", "tilt", "gantry", "--sequences", "1", "--report", str(tmp_path)]
    assert main([*arguments, "--json", str(tmp_path / "t.json")]) == 0
    assert "the ring tilts" in capsys.readouterr().out
    text = (tmp_path / "traps.txt").read_text()
    assert text.index("\ntilt") < text.index("\ngantry")
    found = json.loads((tmp_path / "t.json").read_text())
    assert set(found) == {"tilt", "gantry"}
    assert found["tilt"]["tracker"]["measures"]["pairs"] == 2
    assert {path.name for path in tmp_path.iterdir()} == {"t.json", "traps.txt"}


@pytest.mark.slow
def test_the_command_writes_the_table_of_the_ablation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("lasso_motion_ros.bench.suite.cache.render_sequence", lambda scenario: small())
    arguments = ["suite", "--quiet", "--sequences", "1", "--traps", "zoom", "--ablation", "ring", "shared"]
    assert main([*arguments, "--report", str(tmp_path), "--json", str(tmp_path / "a.json")]) == 0
    text = (tmp_path / "ablation.md").read_text()
    assert "| the ring's own tilt, spin and size |" in text
    assert "| one profile that both planes share |" in text
    assert text.count("\n| ") == 5
    assert "1 random sequences of seed 2009, 2 pairs, and 2 traps, 4 pairs." in text
    assert set(json.loads((tmp_path / "a.json").read_text())[0]["traps"]) == {"zoom"}
    assert main([*arguments, "nonsense"]) == 2
    assert "found nonsense" in capsys.readouterr().err
    assert main([*arguments, "--config", "config/tracker.yaml", "config/brost2009.yaml"]) == 2
    assert "one --config only" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    "mode", [["--sweep", "offset", "--sequences", "1"], ["--ablation", "ghost", "--traps", "zoom"]]
)
def test_a_worker_finds_what_this_process_finds(
    mode: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    late = dataclasses.replace(SMALL, plane_b_offset=0.37)
    shift = dataclasses.replace(SWEEPS["offset"], values=(0.0, 0.37), apply=lambda _, value: late if value else SMALL)
    monkeypatch.setitem(SWEEPS, "offset", shift)
    monkeypatch.setitem(TRAPS, "zoom", dataclasses.replace(TRAPS["zoom"], sequences=1, apply=lambda *_: SMALL))
    monkeypatch.setattr("lasso_motion_ros.cli.suite.suite_scenarios", lambda *_: (SMALL,))
    found = []
    for name, options in (("one", []), ("other", ["--workers", "1"])):
        file = tmp_path / f"{name}.json"
        assert main(["suite", "--quiet", *mode, *options, "--cache", str(tmp_path / "c"), "--json", str(file)]) == 0
        found.append(re.sub(r'"ms": [^,}]*', "", file.read_text()))  # processor time is never twice the same
    assert found[0] == found[1]


def test_the_command_says_what_the_experiment_gave(tmp_path, capsys):
    arguments = ["suite", "--model-experiment", "4", "--seed", "3", "--json", str(tmp_path / "m.json")]
    assert main(arguments) == 0
    expected = run_model_experiment(trials=4, random_seed=3)
    assert f"the model is {expected.mean_mm:.2f} mm from the truth" in capsys.readouterr().out
    assert json.loads((tmp_path / "m.json").read_text())["mean_mm"] == expected.mean_mm


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--model-experiment", "0"], "--model-experiment must be at least 1, found 0"),
        (["--model-experiment", "--sweep", "rate"], "--model-experiment: with --seed and --json only"),
        (["--model-experiment", "--config", "x.yaml"], "--model-experiment: with --seed and --json only"),
    ],
)
def test_what_does_not_go_with_it_is_refused(arguments, text, capsys):
    assert main(["suite", *arguments]) == 2
    assert text in capsys.readouterr().err


def test_a_number_beyond_the_suite_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["suite", "--sequences", "2", "--only", "2"]) == 2
    assert "expected 0 to 1, found 2" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--traps", "nonsense"], "found nonsense"),
        (["--traps", "--sweep", "rate"], "--sweep: not together"),
        (["--ablation", "--sweep", "rate"], "--sweep: not together"),
        (["--traps", "--only", "1"], "--only: numbers of random sequences"),
        (["--sweep", "rate", "--only", "1"], "--only: numbers of random sequences"),
        (["--traps", "tilt", "--traps", "nonsense"], "found nonsense"),
        (["--traps", "nonsense", "--traps", "tilt"], "found nonsense"),
        (["--traps", "--config", "config/tracker.yaml", "here/tracker.yaml"], "two files are named tracker"),
    ],
)
def test_options_that_contradict_each_other(
    arguments: list[str], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["suite", "--quiet", *arguments]) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert error.count("\n") == 1
