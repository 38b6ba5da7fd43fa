"""The score of any tracker's poses: counted by hand, from CSV and MCAP alike; what is no result is one line."""

from __future__ import annotations

import dataclasses
import json
import runpy
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from support.benchmark_inputs import PAIRS, breathing, export_tiny, true_rows, write_rows
from support.paths import ROOT

from lasso_motion_ros.bench.benchmark.entries import entry_files
from lasso_motion_ros.bench.benchmark.manifest import read_manifest
from lasso_motion_ros.bench.benchmark.score import EntryScore, score_benchmark
from lasso_motion_ros.bench.suite.clinic_tables import ALL, ClassMeasures, class_measures
from lasso_motion_ros.bench.suite.judged_scores import JudgedScores, is_plain
from lasso_motion_ros.bench.suite.sequence import run_sequence
from lasso_motion_ros.cli.main import main
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.evaluation.recorded_input import read_truth
from lasso_motion_ros.geometry.transforms import rigid
from lasso_motion_ros.stream.tracker_factory import create_tracker
from lasso_motion_ros.tools.offline_tracking import track_recording
from msg_adapters import topics
from msg_adapters.messages import header_fields
from msg_adapters.pose_table import PoseRow
from msg_adapters.poses import encode_pose_stamped, encode_pose_with_covariance_stamped
from msg_adapters.recordings.writer import RecordingWriter

IDENTITY = "biplane-lasso/1/seed-5"


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("score") / "benchmark"
    with pytest.MonkeyPatch.context() as patch:
        export_tiny(directory, patch)
    return directory


def only_score(exported: Path, *results: Path) -> EntryScore:
    (entry,) = score_benchmark(exported, results).entries
    return entry


def measured(exported: Path, *results: Path) -> ClassMeasures:
    return only_score(exported, *results).classes[ALL]


def off(row: PoseRow, millimetres: float) -> PoseRow:
    """The answer with its pose moved along x."""
    return dataclasses.replace(row, transform=rigid((0, 0, 0), (1e-3 * millimetres, 0, 0)) @ row.transform)


def write_mcap(path: Path, rows: list[PoseRow], *, references: dict[int, int] | None = None) -> Path:
    """Poses with covariance and nothing else, as a foreign tracker publishes them."""
    topic = topics.MOTION_WITH_COVARIANCE
    with RecordingWriter(path) as writer:
        for number, row in enumerate(rows):
            if references is not None:
                header = header_fields(references[number], "patient_table")
                writer.write("/reference", topics.REFERENCE.type_name, header, row.stamp_ns)
            covariance = np.zeros((6, 6)) if row.covariance is None else row.covariance
            header = header_fields(row.stamp_ns, "patient_table")
            fields = encode_pose_with_covariance_stamped(row.transform, covariance, header)
            writer.write(topic.recorded_name, topic.type_name, fields, row.stamp_ns)
    return path


def test_the_truth_is_without_fault(exported: Path, tmp_path: Path) -> None:
    entry = only_score(exported, write_rows(tmp_path / "true.csv", true_rows(exported), IDENTITY))
    every = entry.classes[ALL]
    # Of four pairs the first is the reference, the third lacks plane A, and the last hides the ring.
    assert (every.sequences, every.pairs, every.plain, every.poses) == (2, 6, 2, 4)
    assert (every.wrong, every.missing, every.refused) == (0, 0, 0)
    assert every.centre_mm == pytest.approx(0.0, abs=1e-6)
    assert every.target_mm == pytest.approx(0.0, abs=1e-6)
    assert (every.inside_68, every.inside_95) == (1.0, 1.0)
    assert entry.entry.latencies_ms.tolist() == [4.0] * 6
    assert entry.unanswered == ()


def test_wrong_missing_and_covariance_by_hand(exported: Path, tmp_path: Path) -> None:
    true = true_rows(exported)
    hidden = read_manifest(exported).sequences[0].stamps_ns[PAIRS - 1]
    # Three millimetres off; none for a plain pair; one for a ring that is hidden.
    rows = [true[0], off(true[1], 3.0), true[2], true[3], true[5], PoseRow(hidden, np.eye(4))]
    every = measured(exported, write_rows(tmp_path / "some.csv", rows))
    assert (every.poses, every.wrong, every.missing) == (4, 2, 1)
    # The hidden ring's pose is compared with nothing; of three errors one is 3 mm.
    assert every.centre_mm == pytest.approx(1.0, abs=1e-3)
    assert every.inside_95 == pytest.approx(2 / 3)
    lever = np.linalg.norm(loop_centre(exported))  # a variance of rotation acts at the world's origin
    assert 9.0 / (1.0 + lever**2) / 3 <= every.nees <= 3.0 + 1e-6


def loop_centre(exported: Path) -> np.ndarray:
    loop = read_truth(exported / "truth" / "000.mcap").truth.loop
    assert loop is not None
    return loop.mean(axis=0)


def test_poses_with_covariance_in_a_recording_are_worth_the_same(exported: Path, tmp_path: Path) -> None:
    rows = [off(row, 0.3 * number) for number, row in enumerate(true_rows(exported))]
    as_table = measured(exported, write_rows(tmp_path / "rows.csv", rows))
    recorded = measured(exported, write_mcap(tmp_path / "rows.mcap", rows))
    assert dataclasses.astuple(recorded) == pytest.approx(dataclasses.astuple(as_table), rel=1e-9)
    unsure = [dataclasses.replace(row, covariance=None) for row in rows]
    assert measured(exported, write_mcap(tmp_path / "unsure.mcap", unsure)).nees is None  # all zero: it is not known


def test_a_tracker_that_begins_late_has_missed_what_was_before(exported: Path, tmp_path: Path) -> None:
    manifest, true = read_manifest(exported), true_rows(exported)
    later = manifest.sequences[0].stamps_ns[2]
    late = [dataclasses.replace(true[2], transform=np.eye(4))]
    every = measured(exported, write_mcap(tmp_path / "late.mcap", late, references={0: later}))
    assert (every.plain, every.missing) == (2, 2)


def test_a_live_recording_may_hear_of_its_reference_and_state_late(exported: Path, tmp_path: Path) -> None:
    """Topics have no order among each other: the word of the reference, and of TRACKING, after the first pose."""
    rows, topic = true_rows(exported)[:3], topics.MOTION_WITH_COVARIANCE
    with RecordingWriter(tmp_path / "live.mcap") as writer:
        writer.write("/state", topics.STATE.type_name, {"data": "LOST"}, rows[0].stamp_ns)
        for row in rows:
            header = header_fields(row.stamp_ns, "patient_table")
            fields = encode_pose_with_covariance_stamped(row.transform, row.covariance, header)
            writer.write(topic.recorded_name, topic.type_name, fields, row.stamp_ns + 1)
        header = header_fields(rows[0].stamp_ns, "patient_table")
        writer.write("/reference", topics.REFERENCE.type_name, header, rows[1].stamp_ns + 1)
        writer.write("/state", topics.STATE.type_name, {"data": "TRACKING"}, rows[0].stamp_ns + 2)
    every = measured(exported, tmp_path / "live.mcap")
    assert (every.poses, every.wrong, every.centre_mm) == (2, 0, pytest.approx(0.0, abs=1e-6))


def test_a_sequence_without_an_answer_counts_and_is_said(
    exported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = write_rows(tmp_path / "half.csv", true_rows(exported)[:3])
    entry = only_score(exported, result)
    assert entry.unanswered == ("001",)
    assert (entry.classes[ALL].missing, entry.classes[ALL].refused) == (1, 1)
    assert main(["benchmark", "score", str(exported), "--result", str(result), "--quiet"]) == 3
    assert "half: no answer at all on 1 of the sequences (001)" in capsys.readouterr().out


def test_which_files_are_one_trackers(exported: Path, tmp_path: Path) -> None:
    manifest = read_manifest(exported)
    ours = tmp_path / "ours"
    ours.mkdir()
    for name in ("000.mcap", "001.mcap", "summary.csv"):
        (ours / name).touch()
    one, other = tmp_path / "one.csv", tmp_path / "other.csv"
    one.touch()
    other.touch()
    assert entry_files([ours, one, other], manifest) == {
        "ours": [ours / "000.mcap", ours / "001.mcap"],
        "one": [one],
        "other": [other],
    }
    assert entry_files([ours / "001.mcap", ours / "000.mcap"], manifest) == {
        "ours": [ours / "001.mcap", ours / "000.mcap"]
    }
    (tmp_path / "one").mkdir()
    for given, said in (
        ([tmp_path / "one"], "no MCAP or CSV file in it"),
        ([tmp_path / "none.csv"], "there is no such file or folder"),
        ([one, ours / "one.csv"], "are both named one"),
    ):
        (ours / "one.csv").touch()
        with pytest.raises(LassoMotionError, match=said):
            entry_files(given, manifest)


def changed(text: str, line: int, column: str, value: str) -> str:
    """A table with another value in one line, counted from 1."""
    lines = text.splitlines()
    names = next(one for one in lines if not one.startswith("#")).split(",")
    cells = lines[line - 1].split(",")
    cells[names.index(column)] = value
    return "\n".join([*lines[: line - 1], ",".join(cells), *lines[line:]])


def put(line: int, column: str, value: str) -> Callable[[str], str]:
    return lambda text: changed(text, line, column, value)


WRONG_TABLES: list[tuple[Callable[[str], str], str]] = [
    (lambda text: text.replace("seed-5", "seed-6"), "poses of biplane-lasso/1/seed-6; this benchmark is"),
    (lambda text: text.replace("lasso/1/", "lasso/0/"), "poses of biplane-lasso/0/seed-5; this benchmark is"),
    (lambda text: text.replace("qw", "w"), "no column qw: expected stamp,x,y,z,qx,qy,qz,qw"),
    (lambda text: text.replace("latency_ms", "delay"), "column 'delay' is not known"),
    (lambda text: text.replace("cov35", "state2").replace(",state2", ""), "35 of the columns cov0 to cov35"),
    (lambda text: text.replace(",state,", ",x,"), "column 'x' is there twice"),
    (lambda text: "", "empty: expected a first line"),
    (lambda text: f"{text}1,2,3", "line 9: 3 values for 46 columns"),
    (put(4, "x", "nan"), "line 4: x: expected a finite number, found 'nan'"),
    (put(4, "qz", "one"), "line 4: qz: expected a finite number, found 'one'"),
    (put(4, "y", ""), "line 4: y is empty though x is not"),
    (put(4, "qw", "0.5"), "line 4: qx, qy, qz, qw: expected a quaternion of length 1, found 0.5"),
    (put(4, "cov0", "-1"), "line 4: cov0 to cov35: expected a covariance, found a negative variance"),
    (put(4, "cov1", "1"), "line 4: cov0 to cov35: expected a symmetric matrix"),
    (put(4, "latency_ms", "-3"), "line 4: latency_ms: expected none below zero"),
    (put(4, "state", "HAPPY"), "line 4: state 'HAPPY': expected one of INACTIVE"),
    (put(4, "state", "LOST"), "line 4: a pose in state LOST"),
    (put(4, "stamp", "yesterday"), "line 4: stamp: expected seconds since 1970, found 'yesterday'"),
    (put(4, "stamp", "1e18"), "line 4: stamp: 1e18 looks like nanoseconds"),
    (put(4, "stamp", "1.5"), "line 4: no pair has this stamp: pair 0 of sequence 000 is nearest"),
    (lambda text: text + text.splitlines()[3], "line 9: pair 1 of sequence 000 has an answer already"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "said"), WRONG_TABLES)
def test_a_table_that_is_wrong_is_one_line(
    change: Callable[[str], str], said: str, exported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_rows(tmp_path / "poses.csv", true_rows(exported), IDENTITY)
    path.write_text(change(path.read_text()))
    assert main(["benchmark", "score", str(exported), "--result", str(path)]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"lasso-motion benchmark: {path}: ")
    assert said in told
    assert told.count("\n") == 1


def test_stamps_of_another_benchmark_and_millimetres_are_noticed(exported: Path, tmp_path: Path) -> None:
    rows = true_rows(exported)
    elsewhere = [dataclasses.replace(row, stamp_ns=row.stamp_ns + 10**12) for row in rows]
    for write, name in ((write_rows, "late.csv"), (write_mcap, "late.mcap")):
        with pytest.raises(LassoMotionError, match="none of its 6 stamps is that of a pair of biplane-lasso/1/seed-5"):
            score_benchmark(exported, [write(tmp_path / name, elsewhere)])
    far = [off(row, 12_000.0) for row in rows]
    with pytest.raises(LassoMotionError, match="12 m in the middle: looks like millimetres"):
        score_benchmark(exported, [write_rows(tmp_path / "far.csv", far)])


def test_a_recording_that_is_wrong_is_named_with_topic_and_stamp(exported: Path, tmp_path: Path) -> None:
    rows = true_rows(exported)[:3]
    first = rows[0].stamp_ns
    with pytest.raises(LassoMotionError, match=r"/motion_with_covariance: stamp \d+ ns: two poses with this stamp"):
        score_benchmark(exported, [write_mcap(tmp_path / "twice.mcap", [*rows, rows[1]])])
    bad = dataclasses.replace(rows[1], covariance=-np.eye(6))
    with pytest.raises(LassoMotionError, match=r"stamp \d+ ns: pose.covariance: expected a covariance"):
        score_benchmark(exported, [write_mcap(tmp_path / "negative.mcap", [rows[0], bad])])
    broken = tmp_path / "nan.mcap"
    with RecordingWriter(broken) as writer:
        fields = encode_pose_stamped(np.eye(4), header_fields(first, "patient_table"))
        fields["pose"]["position"]["x"] = float("nan")
        writer.write("/motion", topics.MOTION.type_name, fields, first)
    with pytest.raises(LassoMotionError, match=rf"nan.mcap: /motion: stamp {first} ns: pose: a value is not finite"):
        score_benchmark(exported, [broken])
    with pytest.raises(LassoMotionError, match="no poses in it"):
        score_benchmark(exported, [exported / "recordings" / "000.mcap"])


@pytest.mark.parametrize(
    ("reference", "said"),
    [
        (lambda stamps, number: stamps[number], r"^sly: sequence 000: the reference changes, to \d+ ns: expected one"),
        (lambda stamps, number: 7, "^sly: sequence 000: its reference, 7 ns, is the stamp of none of its pairs"),
    ],
)
def test_nobody_is_right_by_a_reference_of_his_own(
    reference: Callable[[tuple[int, ...], int], int], said: str, exported: Path, tmp_path: Path
) -> None:
    stamps = read_manifest(exported).sequences[0].stamps_ns
    references = {number: reference(stamps, number) for number in range(3)}
    path = write_mcap(tmp_path / "sly.mcap", true_rows(exported)[:3], references=references)
    with pytest.raises(LassoMotionError, match=said):
        score_benchmark(exported, [path])


def test_the_command_table_json_and_page(exported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    true = true_rows(exported)
    good = write_rows(tmp_path / "good.csv", true, IDENTITY)
    bad = write_rows(tmp_path / "bad&.csv", [off(row, 9.0) if row is true[1] else row for row in true])
    outputs = ["--json", str(tmp_path / "s.json"), "--report", str(tmp_path / "report")]
    assert main(["benchmark", "score", str(exported), "--result", str(good), str(bad), *outputs]) == 0
    said = capsys.readouterr().out
    assert said.startswith(f"{IDENTITY}: 2 sequences, 8 pairs\nclass")
    assert "good: latency 4.0 ms (median), 4.0 ms (95 %) of 6 answers" in said
    found = json.loads((tmp_path / "s.json").read_text())
    assert found["benchmark"] == IDENTITY
    assert [found["entries"][name]["classes"][ALL]["wrong"] for name in ("good", "bad&")] == [0, 1]
    assert found["entries"]["good"]["latency_ms"] == {"answers": 6, "median": 4.0, "percentile_95": 4.0}
    pairs = found["entries"]["bad&"]["sequences"]["000"]
    assert [(one["plain"], one["lost_in_silence"]) for one in pairs][:2] == [(True, False), (True, True)]
    page = (tmp_path / "report" / "benchmark.html").read_text()
    assert f"<h1>Lasso tracking: {IDENTITY}</h1>" in page
    assert "<td>bad&amp;</td>" in page
    assert '<td class="bad">1</td>' in page
    assert 'src="data:image/png;base64,' in page
    assert sorted(path.name for path in (tmp_path / "report").iterdir()) == ["benchmark.html", "benchmark.png"]
    assert main(["benchmark", "score", str(exported), "--result", str(good), *outputs]) == 2  # no --overwrite


@pytest.mark.slow
def test_our_tracker_is_worth_what_the_suite_says(exported: Path, tmp_path: Path) -> None:
    """From files, by way of messages, as in memory."""
    drawn = read_manifest(exported).sequences[0]
    result = run_sequence(breathing(), create_tracker(StreamConfig()))
    plain = tuple(is_plain(true) for true in breathing().truth.pairs)
    in_memory = class_measures([JudgedScores(drawn.since, result.scores, plain)])[ALL]
    track_recording(exported / "recordings" / "000.mcap", tmp_path / "ours.mcap")
    judged = only_score(exported, tmp_path / "ours.mcap").sequences["000"]
    from_files = class_measures([judged])[ALL]
    assert (from_files.wrong, from_files.missing) == (0, 0)
    assert from_files.poses >= 1
    # The clicks are single precision in a message.
    assert dataclasses.astuple(from_files) == pytest.approx(dataclasses.astuple(in_memory), rel=0.05)


@pytest.mark.parametrize("suffix", [".csv", ".mcap", ""])
@pytest.mark.parametrize(
    "data", [b"", b"Just a text\n", b"\x89PNG\r\n\x1a\n\x00\xff"], ids=["empty", "text", "picture"]
)
def test_another_kind_of_file_is_one_line(
    data: bytes, suffix: str, exported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"result{suffix}"
    path.write_bytes(data)
    assert main(["benchmark", "score", str(exported), "--result", str(path)]) == 2
    said = capsys.readouterr().err
    assert str(path) in said
    assert said.count("\n") == 1


def test_the_example_enters_a_template_matcher(exported: Path, tmp_path: Path) -> None:
    result = tmp_path / "template.csv"
    example = runpy.run_path(str(ROOT / "examples" / "template_tracker.py"))
    example["main"](str(exported), str(result))
    entry = only_score(exported, result)
    assert entry.unanswered == ()
    assert len(entry.entry.latencies_ms) >= 4
    # Of the pairs with both planes the second shows the ring, and the last hides it, which a matcher may not notice.
    assert entry.classes[ALL].missing == 0
    assert entry.classes[ALL].centre_mm is not None
    assert entry.classes[ALL].centre_mm < 0.5
