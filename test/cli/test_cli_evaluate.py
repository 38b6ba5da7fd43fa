"""`lasso-motion evaluate`: the numbers that went into the files come out of the command."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from support.drawn_recording import write_input, write_result

from lasso_motion_ros.cli.main import main
from msg_adapters.recordings.reader import RecordingReader

STATES = ["TRACKING", "TRACKING", "DEGRADED", "LOST"]


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    return write_input(tmp_path / "ring.mcap", [0.0, 4.0, 8.0, 4.0])


@pytest.fixture
def result(tmp_path: Path) -> Path:
    return write_result(tmp_path / "out.mcap", [0.0, 4.5, 10.5, None], STATES)


def test_known_errors_are_measured(
    recording: Path, result: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    figures = tmp_path / "figures.json"
    assert main(["evaluate", str(recording), "--result", str(result), "--json", str(figures)]) == 0
    summary = json.loads(figures.read_text())["recordings"]["ring"]["summary"]
    assert summary["centre_error_mm"] == pytest.approx(1.5)  # of 0.5 and 2.5
    assert summary["static_error_mm"] == pytest.approx(6.0)  # of 4 and 8
    assert summary["removed_share"] == pytest.approx(0.75)
    assert (summary["missing"], summary["lost_in_silence"], summary["degraded_share"]) == (1, 1, 0.5)
    assert summary["model_error_a_mm"] == pytest.approx(0.0, abs=1e-3)
    assert summary["covariance_95_share"] == pytest.approx(0.5)
    output = capsys.readouterr().out
    assert "ring" in output
    assert "75 %" in output


def test_quiet_prints_the_table_alone(recording: Path, result: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", "--quiet", str(recording), "--result", str(result)]) == 0
    assert "projected curve" not in capsys.readouterr().out


def test_a_cut_recording_ends_with_3(recording: Path, result: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording.write_bytes(recording.read_bytes()[:-200])
    assert main(["evaluate", str(recording), "--result", str(result)]) == 3
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["nowhere.mcap"], "nowhere.mcap"),
        (["{in}", "{in}", "--result", "{out}"], "--result belongs to one recording"),
        (["{in}", "--result", "{out}", "--config", "x.yaml"], "nothing is tracked"),
        (["{in}", "--result", "{out}", "--sid", "-1"], "--sid must be positive"),
        (["{in}", "--result", "{in}"], "not a result of the tracker"),
        (["{in}", "--result", "{out}", "--json", "no/such/directory.json"], "cannot be written"),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str], text: str, recording: Path, result: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    filled = [argument.format(**{"in": recording, "out": result}) for argument in arguments]
    assert main(["evaluate", *filled]) == 2
    error = capsys.readouterr().err
    assert text in error
    assert error.count("\n") == 1


def test_the_truth_in_a_recording_changes_no_answer(tmp_path: Path) -> None:
    motions = [0.0, 2.0, 4.0]
    answers = []
    for name, truth in (("with", True), ("without", False)):
        recording, result = tmp_path / f"{name}.mcap", tmp_path / f"{name}_result.mcap"
        assert main(["track", "--quiet", str(write_input(recording, motions, truth=truth)), "-o", str(result)]) == 0
        answers.append([(m.topic, m.log_time_ns, m.data) for m in RecordingReader(result).raw_messages()])
    assert answers[0] == answers[1]


def test_without_a_result_the_recording_is_tracked_first(recording: Path, tmp_path: Path) -> None:
    """A clean ring on an even ground: the published method follows it."""
    figures = tmp_path / "figures.json"
    assert main(["evaluate", "--quiet", str(recording), "--json", str(figures)]) == 0
    summary = json.loads(figures.read_text())["recordings"]["ring"]["summary"]
    assert (summary["poses"], summary["missing"], summary["lost_in_silence"]) == (3, 0, 0)
    assert summary["removed_share"] > 0.9


def test_what_is_wrong_is_seen_before_anything_is_tracked(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Minutes of tracking are not for nothing: the truth of all recordings, their clicks and the parameters first."""
    from lasso_motion_ros.tools import evaluation_runs

    monkeypatch.setattr(evaluation_runs, "track_recording", lambda *_, **__: pytest.fail("tracked"))
    untrue = write_input(tmp_path / "untrue.mcap", [0.0, 2.0], truth=False)
    assert main(["evaluate", str(untrue)]) == 2
    assert "no truth" in capsys.readouterr().err
    assert main(["evaluate", str(recording), "--config", str(tmp_path / "none.yaml")]) == 2
    assert "none.yaml" in capsys.readouterr().err


def test_of_several_recordings_one_that_fails_is_said_and_left_out(
    recording: Path, result: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    untrue = write_input(tmp_path / "untrue.mcap", [0.0, 2.0], truth=False)
    figures = tmp_path / "figures.json"
    words = ["evaluate", "--quiet", str(untrue), str(recording), "--result", str(result), str(result)]
    assert main([*words, "--json", str(figures)]) == 3
    assert list(json.loads(figures.read_text())["recordings"]) == ["ring"]
    said = capsys.readouterr()
    assert said.err.startswith(f"lasso-motion evaluate: left out: {untrue}: no /ground_truth/motion")
    assert said.err.count("\n") == 1
    assert "75 %" in said.out
    # None that could be scored: all are said, and it has failed.
    assert main(["evaluate", "--quiet", str(untrue), str(tmp_path / "none.mcap")]) == 2
    assert capsys.readouterr().err.count("\n") == 2
