"""`lasso-motion synth`: the recording it writes, and what it refuses."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from lasso_motion_ros.cli.main import main
from lasso_motion_ros.core.share import share_directory
from msg_adapters.calibrations import decode_camera_info
from msg_adapters.images import decode_image
from msg_adapters.markers import decode_points
from msg_adapters.poses import decode_pose
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.seeds import decode_polygon

SCENARIO = """
pairs: 4
rate_hz: 4.0
plane_b_offset: 0.25
geometry: {size_px: 128}
imaging: {bits: 8}
events:
  - {kind: drop, first: 2, plane: a}
  - {kind: hide, first: 3}
"""


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("synth")
    (directory / "mine.yaml").write_text(SCENARIO)
    output = directory / "out.mcap"
    assert main(["synth", str(output), "--scenario", str(directory / "mine.yaml"), "--quiet"]) == 0
    return output


def test_all_topics_of_the_contract(recording: Path) -> None:
    messages = list(RecordingReader(recording).messages())
    counts = Counter(message.topic for message in messages)
    assert counts.pop("/ecg/r_peak", 1) >= 1
    assert counts == {
        "/plane_a/image_raw": 3,
        "/plane_a/camera_info": 3,
        "/plane_b/image_raw": 4,
        "/plane_b/camera_info": 4,
        "/plane_a/seed": 1,
        "/plane_b/seed": 1,
        "/ground_truth/motion": 4,
        "/ground_truth/motion_respiratory": 4,
        "/ground_truth/plane_a/catheter": 3,
        "/ground_truth/plane_b/catheter": 3,
        "/ground_truth/catheter": 1,
        "/ground_truth/targets": 1,
    }
    times = [message.log_time_ns for message in messages]
    assert times == sorted(times)


def test_messages_agree_with_each_other(recording: Path) -> None:
    by_topic: dict[str, list] = {}
    for message in RecordingReader(recording).messages():
        by_topic.setdefault(message.topic, []).append(message.message)
    image, info = by_topic["/plane_b/image_raw"][1], by_topic["/plane_b/camera_info"][1]
    pixels = decode_image(image)
    assert pixels.shape == (128, 128)
    assert (image.header.stamp.sec, image.header.stamp.nanosec) == (1760000000, 312500000)
    assert image.header.frame_id == "plane_b"
    projection = decode_camera_info(info, pixels.shape)
    loop = decode_points(by_topic["/ground_truth/catheter"][0])
    motion = decode_pose(by_topic["/ground_truth/motion"][1])
    line = decode_polygon(by_topic["/ground_truth/plane_b/catheter"][1])
    assert line.shape == (90, 2)
    assert projection.project(loop @ motion[:3, :3].T + motion[:3, 3]) == pytest.approx(line, abs=1e-3)
    seed = by_topic["/plane_b/seed"][0]
    assert (seed.header.stamp.sec, seed.header.stamp.nanosec) == (1760000000, 62500000)
    assert 8 <= len(seed.polygon.points) <= 14
    assert len(decode_points(by_topic["/ground_truth/targets"][0])) == 200
    assert by_topic["/ground_truth/motion"][0].header.frame_id == "patient_table"


def test_an_independent_reader_reads_it(recording: Path) -> None:
    decoder = pytest.importorskip("mcap_ros2.decoder")
    from mcap.reader import make_reader

    with recording.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[decoder.DecoderFactory()])
        images = [m for *_, m in reader.iter_decoded_messages(topics=["/plane_a/image_raw"])]
    assert len(images) == 3
    assert np.frombuffer(images[0].data, np.uint8).std() > 10


def test_same_seed_same_bytes_other_seed_other_bytes(recording: Path, tmp_path: Path) -> None:
    arguments = ["--scenario", str(recording.parent / "mine.yaml"), "--quiet", "--frames", "2"]
    contents = []
    for name, extra in (("x", []), ("y", []), ("z", ["--seed", "5"])):
        (tmp_path / name).mkdir()
        output = tmp_path / name / "out.mcap"
        assert main(["synth", str(output), *arguments, *extra]) == 0
        contents.append(output.read_bytes())
    assert contents[0] == contents[1]
    assert contents[0] != contents[2]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "no output given"),
        (["out.mcap", "--scenario", "nowhere"], "nowhere: no such file, nor one of the scenarios"),
        (["out.mcap", "--frames", "0"], "frames: expected at least 1"),
        (["out.mcap", "--seed", "-1"], "seed: expected 0 to"),
        (["out.mcap", "--volume", "missing.nii"], "missing.nii: "),
    ],
)
def test_bad_input_is_one_plain_line(
    arguments: list[str],
    words: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["synth", *arguments]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out.mcap").exists()


def test_an_existing_file_is_kept(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = recording.read_bytes()
    arguments = ["synth", str(recording), "--scenario", str(recording.parent / "mine.yaml"), "--frames", "1", "--quiet"]
    assert main(arguments) == 2
    assert "exists" in capsys.readouterr().err
    assert recording.read_bytes() == before


def test_list(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["synth", "--list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("01_clear_view")
    assert lines[-1] == "7 scenarios, 231 pairs"


def test_the_bundled_recording() -> None:
    path = share_directory() / "bags" / "two_breaths.mcap"
    assert path.stat().st_size <= 15_000_000
    counts: Counter[str] = Counter()
    heights = []
    for message in RecordingReader(path).messages():
        counts[message.topic] += 1
        if message.topic == "/ground_truth/motion_respiratory":
            heights.append(message.message.pose.position.z)
        elif message.topic == "/plane_a/image_raw" and counts[message.topic] == 1:
            assert decode_image(message.message).shape == (512, 512)
            assert message.message.encoding == "mono8"
    assert counts["/plane_a/image_raw"] == counts["/plane_b/image_raw"] == counts["/ground_truth/motion"] >= 24
    assert counts["/plane_a/seed"] == counts["/plane_b/seed"] == 1
    # Two breaths: twice down beyond half the depth and back.
    below = np.asarray(heights) < 0.5 * min(heights)
    assert np.sum(np.diff(below.astype(int)) == 1) == 2
    assert np.sum(np.diff(below.astype(int)) == -1) == 2
