"""What an exported benchmark consists of: recordings without truth, truth apart, digests; the same bytes each time."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from support.benchmark_inputs import PAIRS, SEED, breathing, contents, export_tiny

from lasso_motion_ros.bench.benchmark.manifest import file_digest, read_manifest, start_ns
from lasso_motion_ros.bench.benchmark.truth_files import read_sequence_truth
from lasso_motion_ros.bench.suite.clinic_scenarios import clinic_scenario
from lasso_motion_ros.cli.main import main
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.evaluation.recorded_input import read_truth
from lasso_motion_ros.stream.recorded_pairs import recorded_pairs
from msg_adapters.recordings.reader import RecordingReader


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("export") / "benchmark"
    with pytest.MonkeyPatch.context() as patch:
        export_tiny(directory, patch)
    return directory


def test_recordings_hold_what_a_tracker_gets_and_no_truth(exported: Path) -> None:
    reader = RecordingReader(exported / "recordings" / "001.mcap")
    planes = {f"/plane_{plane}/{name}" for plane in "ab" for name in ("image_raw", "camera_info", "seed")}
    assert planes <= set(reader.topics) <= planes | {"/ecg/r_peak"}
    pairs = list(recorded_pairs(reader, StreamConfig()))
    assert [pair.is_whole for pair in pairs] == [True, True, False, True]
    for pair, rendered in zip(pairs, breathing().pairs, strict=True):
        for plane, frame in rendered.frames.items():
            np.testing.assert_array_equal(pair.frames[plane].pixels, frame.pixels)
            np.testing.assert_allclose(pair.frames[plane].projection.matrix, frame.projection.matrix, rtol=1e-12)


def test_the_truth_lies_apart_with_what_is_asked(exported: Path) -> None:
    manifest = read_manifest(exported)
    found = read_sequence_truth(exported, manifest, manifest.sequences[1])
    assert [pair.stamp_ns for pair in found.truth.pairs] == list(manifest.sequences[1].stamps_ns)
    for pair, true in zip(found.truth.pairs, breathing().truth.pairs, strict=True):
        np.testing.assert_allclose(pair.motion, true.motion, atol=1e-12)
        assert (pair.displaced, pair.due) == (true.displaced, true.due)
    assert found.plain == (True, True, False, False)
    # As a recording with truth it is one for `evaluate`, too.
    assert len(read_truth(exported / "truth" / "001.mcap").truth.pairs) == PAIRS


def test_the_manifest_names_every_file_with_its_digest(exported: Path) -> None:
    record = json.loads((exported / "manifest.json").read_text())
    named = record["files"] | {name: digest for one in record["sequences"] for name, digest in one["files"].items()}
    there = contents(exported)
    assert named == {name: hashlib.sha256(data).hexdigest() for name, data in there.items() if name != "manifest.json"}
    assert {"README.md", "LICENSE.txt", "recordings/000.mcap", "truth/000.mcap", "truth/000.json"} <= set(named)
    assert record["identity"] == f"biplane-lasso/1/seed-{SEED}"
    assert record["licence"] == "CC0-1.0"
    for number, one in enumerate(record["sequences"]):
        drawn = clinic_scenario(SEED, number)
        assert (one["since"], one["description"]) == (dict(drawn.since), drawn.scenario.description)
    card = there["README.md"].decode()
    assert f"# biplane-lasso/1/seed-{SEED}" in card
    assert "## What it is not" in card
    assert "`core` (1 sequence)" in card


def test_the_same_bytes_again_however_many_sequences(
    exported: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    export_tiny(tmp_path / "again", monkeypatch)
    assert contents(tmp_path / "again") == contents(exported)
    export_tiny(tmp_path / "one", monkeypatch, sequences=1)
    for name in ("recordings/000.mcap", "truth/000.mcap", "truth/000.json"):
        assert file_digest(tmp_path / "one" / name) == file_digest(exported / name)


def test_no_two_sequences_share_a_stamp() -> None:
    begins = {start_ns(version, seed, index) for version in "12" for seed in range(50) for index in range(112)}
    assert len(begins) == 2 * 50 * 112
    assert max(begins) < 2**31 * 10**9  # ROS stamps


def test_it_is_there_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(*given: object) -> None:
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("lasso_motion_ros.bench.benchmark.export.write_truth", stopped)
        with pytest.raises(KeyboardInterrupt):
            export_tiny(tmp_path / "new", patch)
    assert not (tmp_path / "new").exists()


def test_what_is_there_is_replaced_only_if_told_and_only_a_benchmark(
    exported: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    directory = tmp_path / "benchmark"
    export_tiny(directory, monkeypatch, sequences=2, seed=6)
    typed = ["benchmark", "export", str(directory), "--sequences", "1", "--seed", "6", "--workers", "1", "--quiet"]
    before = contents(directory)
    assert main(typed) == 2
    assert "choose another name or add --overwrite" in capsys.readouterr().err
    assert contents(directory) == before
    (directory / "notes.txt").write_text("mine")
    assert main([*typed, "--overwrite"]) == 0
    assert "recordings/001.mcap" not in contents(directory)
    assert (directory / "notes.txt").read_text() == "mine"
    (directory / "recordings" / "patient.mcap").write_text("mine")
    assert main([*typed, "--overwrite"]) == 2
    said = capsys.readouterr().err
    assert "recordings/patient.mcap is not of an earlier benchmark" in said
    assert said.count("\n") == 1
    assert (directory / "recordings" / "patient.mcap").read_text() == "mine"


@pytest.mark.parametrize(("option", "value"), [("--sequences", "0"), ("--seed", "-1"), ("--workers", "0")])
def test_numbers_that_are_none(option: str, value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["benchmark", "export", str(tmp_path / "new"), option, value]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "new").exists()


def test_a_truth_that_is_missing_or_changed_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    manifest = export_tiny(tmp_path, monkeypatch, sequences=1)
    asked = tmp_path / "truth" / "000.json"
    text = asked.read_text()
    asked.write_text(text.replace("true", "false"))
    with pytest.raises(RecordingError, match=r"truth/000\.json: not the file that was exported"):
        read_sequence_truth(tmp_path, manifest, manifest.sequences[0])
    asked.unlink()
    with pytest.raises(RecordingError, match=r"truth/000\.json: missing: it is part of biplane-lasso/1/seed-5"):
        read_sequence_truth(tmp_path, manifest, manifest.sequences[0])
    (tmp_path / "truth").rename(tmp_path / "kept")
    with pytest.raises(RecordingError, match=r"truth: no such directory: the truth of biplane-lasso/1/seed-5 belongs"):
        read_sequence_truth(tmp_path, manifest, manifest.sequences[0])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"version": "0"}, "version '0' of the benchmark; this package scores version '1'"),
        ({"benchmark": "other"}, "not the manifest of a biplane-lasso benchmark"),
        ({"sequences": None}, "damaged"),
        (None, "not a benchmark's manifest"),
    ],
)
def test_a_manifest_that_is_none(change: dict[str, object] | None, said: str, exported: Path, tmp_path: Path) -> None:
    record = json.loads((exported / "manifest.json").read_text())
    text = "no JSON" if change is None else json.dumps(record | change)
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(RecordingError, match=said):
        read_manifest(tmp_path)
