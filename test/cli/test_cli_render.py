"""`lasso-motion render`: what the painter draws for each pair comes out of the command, as frames and as video."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from support.drawn_recording import loop, projections, shift, write_input, write_result
from support.rendering_inputs import ellipsoid_mesh

from lasso_motion_ros.cli.main import main
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.geometry.transforms import apply
from lasso_motion_ros.overlay.painter import OverlayPainter
from lasso_motion_ros.overlay.surface_files import read_surface, write_stl
from lasso_motion_ros.reports import offline_overlay
from lasso_motion_ros.reports.picture_grid import STRIP_PX, text_strip
from msg_adapters.images import decode_image
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.recordings.writer import RecordingWriter

STATES = ["TRACKING", "DEGRADED", "LOST", "TRACKING"]
MOTIONS = [0.0, 4.0, None, 8.0]
RAISED = "0 0 0.002 0 0 0 1"

pytest.importorskip("trimesh", reason="pip install 'lasso_motion_ros[overlay]'")


@pytest.fixture
def inputs(tmp_path: Path) -> list[str]:
    recording = write_input(tmp_path / "ring.mcap", [0.0, 4.0, 8.0, 8.0])
    result = write_result(tmp_path / "result.mcap", MOTIONS, STATES)
    write_stl(tmp_path / "ball.stl", ellipsoid_mesh((0.02, 0.015, 0.012), rows=40, columns=21), "mm")
    volume = ["--volume", str(tmp_path / "ball.stl"), "--units", "mm", "--registration", RAISED]
    return ["render", "--quiet", str(recording), str(result), *volume]


def images(recording: str) -> dict[tuple[str, int], np.ndarray]:
    topics = {f"/plane_{plane}/image_raw": plane for plane in PLANES}
    found: dict[tuple[str, int], np.ndarray] = {}
    for message in RecordingReader(recording).messages(list(topics)):
        plane = topics[message.topic]
        found[plane, sum(key[0] == plane for key in found)] = decode_image(message.message)
    return found


def read_png(path: Path) -> np.ndarray:
    return cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB)


def test_frames_are_what_the_painter_draws(inputs: list[str], tmp_path: Path) -> None:
    out = tmp_path / "frames"
    assert main([*inputs, "-o", str(out), "--json", str(tmp_path / "drawn.json")]) == 0
    mesh = read_surface(tmp_path / "ball.stl", "mm").moved(shift(2.0))
    assert len(list(out.iterdir())) == 8
    for (plane, pair), image in images(inputs[2]).items():
        z_mm = MOTIONS[pair]
        status = {1: "DEGRADED", 2: "LOST"}.get(pair, "")
        expected = OverlayPainter(mesh).draw(
            image,
            projections()[plane],
            None if z_mm is None else shift(z_mm),
            status,
            loop=None if z_mm is None else apply(shift(z_mm), loop()),
            covariance=np.diag([0.25e-6] * 3 + [1e-6] * 3),
        )
        np.testing.assert_allclose(read_png(out / f"plane_{plane}_{pair:05d}.png"), expected, atol=2)
    drawn = json.loads((tmp_path / "drawn.json").read_text())
    assert [pair["compensated"] for pair in drawn["pairs"]] == [True, True, False, True]
    assert (drawn["compensated"], drawn["pairs"][2]["status"]) == (3, "LOST")


def test_side_by_side_has_the_static_place_left(inputs: list[str], tmp_path: Path) -> None:
    assert main([*inputs, "-o", str(tmp_path / "both"), "--view", "both"]) == 0
    picture = read_png(tmp_path / "both" / "plane_a_00003.png")
    mesh = read_surface(tmp_path / "ball.stl", "mm").moved(shift(2.0))
    left = OverlayPainter(mesh).draw_static(images(inputs[2])["a", 3], projections()["a"])
    np.testing.assert_array_equal(picture[:, :512], left)
    assert picture.shape == (512, 2 * 512 + 4, 3)


@pytest.mark.parametrize(("view", "shape"), [("compensated", (836, 1540)), ("both", (1642, 1540))])
def test_the_video_plays_at_the_recordings_rate(inputs: list[str], tmp_path: Path, view: str, shape: tuple) -> None:
    av = pytest.importorskip("av")
    out = tmp_path / "out.mp4"
    assert main([*inputs, "-o", str(out), "--view", view]) == 0
    with av.open(str(out)) as container:
        assert container.streams.video[0].average_rate == 4
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert [frame.shape[:2] for frame in frames] == [shape] * 4
    # The LOST pair's banner is amber across the top of the compensated picture.
    row = frames[2][STRIP_PX + 10, -700:-100] if view == "both" else frames[2][STRIP_PX + 10, 100:700]
    assert (np.median(row, axis=0) - [255, 176, 0]).max() < 40


def test_every_frame_says_plane_state_motion_and_that_it_is_for_research(
    inputs: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("av")
    written: list[str] = []

    def noted(words: str, width: int) -> np.ndarray:
        written.append(words)
        return text_strip(words, width)

    monkeypatch.setattr(offline_overlay, "text_strip", noted)
    assert main([*inputs, "-o", str(tmp_path / "out.mp4")]) == 0
    said = [
        "TRACKING   motion x +0.0  y +0.0  z +0.0 mm",
        "DEGRADED   motion x +0.0  y +0.0  z +4.0 mm",
        "LOST   not compensated",
        "TRACKING   motion x +0.0  y +0.0  z +8.0 mm",
    ]
    assert written == [
        words
        for pair, below in enumerate(said)
        for words in (
            "Plane A",
            "Plane B",
            f"t = {0.25 * pair:.2f} s   {below}   Research use only, not a medical device",
        )
    ]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["-o", "{tmp}/x.mp4", "--rate", "0"], "--rate must be positive"),
        (["-o", "{tmp}/x", "--rate", "5"], "--rate is for a video"),
        (["-o", "{tmp}/ball.stl"], "exists"),
        (["-o", "{tmp}/x", "--registration", "1 2"], "found 2 numbers"),
        (["-o", "{tmp}/x", "--volume", "{tmp}/none.stl"], "cannot be read"),
        (["-o", "{tmp}/x", "--remap", "/plane_a/image_raw:=/else"], "lacks /plane_a/image_raw"),
    ],
)
def test_bad_input_is_one_line(
    inputs: list[str], tmp_path: Path, arguments: list[str], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*inputs, *(argument.format(tmp=tmp_path) for argument in arguments)]) == 2
    error = capsys.readouterr().err
    assert text in error
    assert error.count("\n") == 1


def with_images_refused(recording: str, path: Path, topic: str) -> Path:
    """A copy in which the images on topics that end so are of an encoding that is not taken."""
    with RecordingWriter(path) as writer:
        for one in RecordingReader(recording).messages():
            if one.topic.endswith(topic):
                one.message.encoding = "32FC1"
            writer.write(one.topic, one.type_name, one.message, one.log_time_ns)
    return path


def test_a_recording_without_a_pair_is_one_line_that_says_why_and_leaves_nothing(
    inputs: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = with_images_refused(inputs[2], tmp_path / "spoilt.mcap", "/image_raw")
    for out in (tmp_path / "frames", tmp_path / "video.mp4"):
        assert main([*inputs[:2], str(recording), *inputs[3:], "-o", str(out)]) == 2
        error = capsys.readouterr().err
        said = f"{recording}: no image pair could be made: plane_a/image_raw, plane_b/image_raw: encoding: expected"
        assert error.startswith(f"lasso-motion render: {said}")
        assert error.count("\n") == 1
        assert not out.exists()


def test_a_plane_that_is_left_out_is_said(
    inputs: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = with_images_refused(inputs[2], tmp_path / "spoilt.mcap", "b/image_raw")
    assert main([*inputs[:2], str(recording), *inputs[3:], "-o", str(tmp_path / "frames")]) == 0
    error = capsys.readouterr().err
    assert error.startswith("lasso-motion render: plane_b/image_raw: encoding: expected")
    assert error.endswith("(4 times)\n")
    assert len(list((tmp_path / "frames").iterdir())) == 4


def test_a_cut_recording_is_drawn_as_far_as_it_goes(
    inputs: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = Path(inputs[2])
    recording.write_bytes(recording.read_bytes()[:-200])
    assert main([*inputs, "-o", str(tmp_path / "frames")]) == 3
    assert capsys.readouterr().err.count("\n") == 1
    assert list((tmp_path / "frames").iterdir())
