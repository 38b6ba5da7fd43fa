"""`lasso-motion track`: files in, files out, with a stand-in for the method."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from support.message_inputs import MESSAGES, FakeTracker, projection, seed, stamp, stream

from lasso_motion_ros.cli.main import main
from lasso_motion_ros.core.share import bundled_recording
from lasso_motion_ros.stream import pipeline
from lasso_motion_ros.stream.problem_log import Problem, problem_lines
from msg_adapters.images import decode_image, encode_image
from msg_adapters.messages import header_fields, stamp_to_ns
from msg_adapters.poses import decode_pose
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.recordings.writer import RecordingWriter
from msg_adapters.seeds import decode_seed


@pytest.fixture(autouse=True)
def fake(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pipeline, "create_tracker", lambda config: FakeTracker())


def record(path: Path, messages: Any = None, drop: str = "nothing", rename: dict[str, str] | None = None) -> Path:
    with RecordingWriter(path) as writer:
        for topic, type_name, message, at in messages or stream(6):
            if drop not in topic:
                writer.write((rename or {}).get(topic, topic), type_name, message, at)
    return path


def track(*arguments: Any) -> int:
    return main(["track", *map(str, arguments)])


def motion(path: Path) -> dict[int, float]:
    found = RecordingReader(path).messages(["/motion"])
    return {stamp_to_ns(m.message.header.stamp): round(float(decode_pose(m.message)[0, 3]) * 1e3, 6) for m in found}


EXPECTED = {stamp(k): float(k) for k in range(6)}


def test_a_recording_becomes_poses(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out.mcap"
    assert track(record(tmp_path / "in.mcap"), "-o", out) == 0
    assert motion(out) == EXPECTED
    assert "6 pairs, 6 poses; 6 TRACKING" in capsys.readouterr().out
    messages = list(RecordingReader(out).messages())
    assert [m.topic for m in messages[:9]] == [
        "/state", "/state", "/state", "/reference", "/state", "/motion", "/motion_raw", "/motion_with_covariance",
        "/catheter",
    ]  # fmt: skip
    assert [m.message.data for m in messages if m.topic == "/state"][:4] == [
        "WAITING_FOR_CALIBRATION", "WAITING_FOR_SEED", "WAITING_FOR_SEED", "TRACKING",
    ]  # fmt: skip
    assert {m.log_time_ns for m in messages} == set(EXPECTED)


def test_two_runs_write_the_same_bytes(tmp_path: Path) -> None:
    recording = record(tmp_path / "in.mcap")
    for name in ("1", "2"):
        (tmp_path / name).mkdir()
        assert track(recording, "-o", tmp_path / name / "out.mcap") == 0
    assert (tmp_path / "1" / "out.mcap").read_bytes() == (tmp_path / "2" / "out.mcap").read_bytes()


def test_a_cut_recording_is_used_and_said_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording = record(tmp_path / "in.mcap")
    data = recording.read_bytes()
    recording.write_bytes(data[: len(data) - 300])
    assert track(recording, "-o", tmp_path / "out.mcap") == 3
    assert "what could be read was used" in capsys.readouterr().err
    assert motion(tmp_path / "out.mcap") == EXPECTED


def seeds_file(path: Path) -> Path:
    # A list for each plane: of one list for both PyYAML would write an alias, which is refused.
    planes = {f"plane_{plane}": {"points": decode_seed(seed(0)).tolist()} for plane in "ab"}
    path.write_text(yaml.safe_dump(planes))
    return path


def calibration_file(path: Path) -> Path:
    planes = {
        f"plane_{plane}": {"p": projection(plane).matrix.reshape(-1).tolist(), "width": 32, "height": 32}  # type: ignore[arg-type]
        for plane in "ab"
    }
    path.write_text(yaml.safe_dump(planes))
    return path


def test_seeds_calibration_and_names_come_from_outside(tmp_path: Path) -> None:
    names = {"/plane_a/image_raw": "/frontal", "/plane_b/image_raw": "/lateral"}
    only_images = [entry for entry in stream(6) if entry[0] in names]
    recording = record(tmp_path / "in.mcap", only_images, rename=names)
    status = track(
        recording, "-o", tmp_path / "out.mcap", "--seeds", seeds_file(tmp_path / "s.yaml"),
        "--calibration", calibration_file(tmp_path / "c.yaml"),
        "--remap", "frontal:=plane_a/image_raw", "/lateral:=/plane_b/image_raw",
    )  # fmt: skip
    assert status == 0
    assert motion(tmp_path / "out.mcap") == EXPECTED


def test_compressed_images_are_input_too(tmp_path: Path) -> None:
    def compressed() -> Any:
        for topic, type_name, message, at in stream(6):
            if not topic.endswith("image_raw"):
                yield topic, type_name, message, at
                continue
            data = cv2.imencode(".png", np.array(decode_image(message)))[1].reshape(-1)
            fields = {"header": header_fields(at - 1000), "format": "mono8; png compressed", "data": data}
            yield topic + "/compressed", "sensor_msgs/msg/CompressedImage", fields, at

    assert track(record(tmp_path / "in.mcap", compressed()), "-o", tmp_path / "out.mcap") == 0
    assert motion(tmp_path / "out.mcap") == EXPECTED


def test_colour_is_taken_as_luminance_and_raw_images_before_compressed_ones(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def coloured() -> Any:
        for topic, type_name, message, at in stream(6):
            if topic.endswith("image_raw"):
                picture = np.dstack([decode_image(message)] * 3)
                fields = {"header": header_fields(at - 1000), "format": "png", "data": b"not looked at"}
                yield topic + "/compressed", "sensor_msgs/msg/CompressedImage", fields, at
                message = MESSAGES.make(type_name, encode_image(picture, header_fields(at - 1000)))
            yield topic, type_name, message, at

    assert track(record(tmp_path / "in.mcap", coloured()), "-o", tmp_path / "out.mcap") == 0
    assert motion(tmp_path / "out.mcap") == EXPECTED
    said = capsys.readouterr()
    assert "plane_a/image_raw, plane_b/image_raw: rgb8 pictures are taken as luminance (ITU-R BT.601)\n" in said.out
    assert "plane_b/image_raw/compressed: not used: plane_b/image_raw is there, which has lost nothing\n" in said.out
    assert said.err == ""


@pytest.mark.parametrize(
    ("drop", "text"),
    [
        ("plane_b/image_raw", "lacks /plane_b/image_raw (sensor_msgs/msg/Image); it has"),
        ("camera_info", "lacks /plane_a/camera_info (sensor_msgs/msg/CameraInfo), /plane_b/camera_info"),
        ("plane_b/seed", "no clicks (/plane_b/seed): give them with lasso-motion track --seeds FILE; the page"),
    ],
)
def test_what_is_missing_is_named_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], drop: str, text: str
) -> None:
    assert track(record(tmp_path / "in.mcap", drop=drop), "-o", tmp_path / "out.mcap") == 2
    error = capsys.readouterr().err
    assert text in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out.mcap").exists()


def test_images_that_are_all_refused_leave_no_output(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def coloured() -> Any:
        for topic, type_name, message, at in stream(3):
            if topic.endswith("image_raw"):
                message.encoding = "32FC1"
            yield topic, type_name, message, at

    assert track(record(tmp_path / "in.mcap", coloured()), "-o", tmp_path / "out.mcap") == 2
    assert (
        "no image pair could be made: plane_a/image_raw, plane_b/image_raw: encoding: expected mono8"
        in capsys.readouterr().err
    )
    assert not (tmp_path / "out.mcap").exists()


def test_refused_clicks_are_one_line_and_leave_no_output(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pipeline, "create_tracker", lambda config: FakeTracker(refuse=True))
    recording = record(tmp_path / "in.mcap")
    assert track(recording, "-o", tmp_path / "out.mcap") == 2
    assert capsys.readouterr().err == f"lasso-motion track: {recording}: no pair got a pose: seed: no loop here\n"
    assert list(tmp_path.iterdir()) == [recording]


def millimetres(message: Any) -> None:
    message.p = message.p * np.array([1e-3, 1e-3, 1e-3, 1.0] * 3)


def too_few_clicks(message: Any) -> None:
    message.polygon.points = message.polygon.points[:3]


def other_clock(message: Any) -> None:
    message.header.stamp.sec -= 100


def without_stamp(message: Any) -> None:
    message.header.stamp.sec = message.header.stamp.nanosec = 0


@pytest.mark.parametrize(
    ("kind", "mistake", "lines"),
    [
        ("/camera_info", millimetres, "no image pair could be made: plane_a/camera_info, plane_b/camera_info: p: "
         "expected the source 0.3 to 2 m from the world origin, found 785 m; the matrix looks like millimetres, "
         "metres are expected"),
        ("b/camera_info", millimetres, "no pair got a pose: plane_b/camera_info: p: expected the source"),
        ("/seed", too_few_clicks, "no pair got a pose: plane_a/seed, plane_b/seed: polygon: expected 6 clicks or more"),
        ("/seed", other_clock, "no pair got a pose: plane_a/seed, plane_b/seed: the clicked image (1759999900.0000"),
        ("/image_raw", without_stamp, "no image pair could be made: plane_a/image_raw, plane_b/image_raw: "
         "header.stamp: expected the time of exposure"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line_and_what_was_there_before_stays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str, mistake: Any, lines: str
) -> None:
    """In the bundled recording, with all that it has besides."""
    recording, out = tmp_path / "in.mcap", tmp_path / "out.mcap"
    with RecordingWriter(recording) as writer:
        for number, one in enumerate(RecordingReader(bundled_recording()).messages()):
            if number > 40:
                break
            if one.topic.endswith(kind):
                mistake(one.message)
            writer.write(one.topic, one.type_name, one.message, one.log_time_ns)
    out.write_bytes(b"a good result")
    assert track(recording, "-o", out, "--overwrite") == 2
    error = capsys.readouterr().err
    assert error.startswith(f"lasso-motion track: {recording}: {lines}")
    assert error.count("\n") == 1
    assert sorted(tmp_path.iterdir()) == [recording, out]
    assert out.read_bytes() == b"a good result"


def test_what_is_wrong_on_both_planes_is_said_once() -> None:
    problems = {Problem("plane_a/x", "bad"): 3, Problem("", "a new run"): 1, Problem("plane_b/x", "bad"): 1}
    assert problem_lines(problems) == ["plane_a/x, plane_b/x: bad (4 times)", "a new run"]


def test_output_is_not_overwritten_by_accident(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording = record(tmp_path / "in.mcap")
    before = recording.read_bytes()
    assert track(recording, "-o", recording, "--overwrite") == 2
    assert "is an input, and no input is overwritten" in capsys.readouterr().err
    assert recording.read_bytes() == before
    (tmp_path / "out.mcap").write_bytes(b"mine")
    assert track(recording, "-o", tmp_path / "out.mcap") == 2
    assert (tmp_path / "out.mcap").read_bytes() == b"mine"
    assert track(recording, "-o", tmp_path / "out.mcap", "--overwrite") == 0


@pytest.mark.parametrize("rule", ["a", "a:=", ":=b", "a:=b:=c"])
def test_remap_rules_are_checked(tmp_path: Path, capsys: pytest.CaptureFixture[str], rule: str) -> None:
    assert track(record(tmp_path / "in.mcap"), "-o", tmp_path / "out.mcap", "--remap", rule) == 2
    assert "expected FROM:=TO" in capsys.readouterr().err


def test_help_shows_the_file_formats(capsys: pytest.CaptureFixture[str]) -> None:
    assert track("--help") == 0
    shown = capsys.readouterr().out
    assert "points: [[512.5, 300.0]" in shown
    assert "p: [12 numbers, row by row]" in shown


def test_late_images_of_alternating_planes(tmp_path: Path) -> None:
    recording = record(tmp_path / "in.mcap", stream(6, offset_ns=166_666_666))
    assert track(recording, "-o", tmp_path / "out.mcap", "--quiet") == 0
    assert motion(tmp_path / "out.mcap") == EXPECTED


def test_the_counts_as_json(tmp_path: Path) -> None:
    figures = tmp_path / "counts.json"
    recording = record(tmp_path / "in.mcap", list(stream(6))[:-2])  # the last image is missing
    assert track("--quiet", recording, "-o", tmp_path / "out.mcap", "--json", figures) == 0
    counts = json.loads(figures.read_text())
    assert (counts["pairs"], counts["poses"], counts["half_pairs"]) == (6, 5, 1)
    assert counts["states"] == {"TRACKING": 5, "LOST": 1}
    assert counts["damage"] is None
