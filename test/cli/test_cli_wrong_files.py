"""Every command with each kind of wrong file: one line for each error, status 2 or 3, and never a traceback."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.drawn_recording import write_input, write_result
from support.rendering_inputs import ellipsoid_mesh

from lasso_motion_ros.cli.main import main
from lasso_motion_ros.overlay.surface_files import write_stl

COMMANDS = [
    "track WRONG -o OUT",
    "track IN -o OUT --config WRONG",
    "track IN -o OUT --seeds WRONG",
    "track IN -o OUT --calibration WRONG",
    "check WRONG",
    "evaluate WRONG",
    "evaluate IN --result WRONG",
    "evaluate IN --config WRONG",
    "render WRONG RESULT --volume BALL --units mm -o FRAMES",
    "render IN WRONG --volume BALL --units mm -o FRAMES",
    "render IN RESULT --volume WRONG --units mm -o FRAMES",
    "render IN RESULT --volume BALL --units mm --registration WRONG -o FRAMES",
    "render IN RESULT --volume BALL --units mm --config WRONG -o FRAMES",
    "record --repair WRONG",
    "synth OUT --scenario WRONG",
    "synth OUT --frames 1 --volume WRONG",
    "web --annotate WRONG -o OUT",
    "bench --bag WRONG",
    "bench --config WRONG",
    "suite --config WRONG",
    "benchmark score WRONG --result RESULT",
]
LIVE = ["play WRONG", "demo --bag WRONG --out FRAMES", "demo --config WRONG --out FRAMES"]
SUFFIXES = [".mcap", ".yaml", ".stl", ".ply", ".obj", ".vtp", ".nii.gz", ".nrrd", ".mha", ".dcm", ".png", ""]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    place = tmp_path_factory.mktemp("inputs")
    ball = place / "ball.stl"
    write_stl(ball, ellipsoid_mesh((0.02, 0.015, 0.012), rows=20, columns=11), "mm")
    recording = write_input(place / "ring.mcap", [0.0, 4.0, 8.0])
    return {
        "IN": recording,
        "RESULT": write_result(place / "result.mcap", [0.0, 4.0, 8.0], ["TRACKING"] * 3),
        "BALL": ball,
    }


def wrong_contents(inputs: dict[str, Path]) -> dict[str, bytes]:
    return {
        "empty": b"",
        "text": "Just a text – renamed.\n".encode() * 20,
        "png": b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 4,
        "cut recording": inputs["IN"].read_bytes()[:300],
        "cut surface": inputs["BALL"].read_bytes()[:200],
    }


@pytest.mark.parametrize("words", [*COMMANDS, *LIVE])
def test_a_wrong_file_is_one_line(
    words: str, inputs: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if words in LIVE:
        pytest.importorskip("rclpy", reason="needs ROS 2")
    suffixes = SUFFIXES if "--volume WRONG" in words else SUFFIXES[:1]
    named = {**inputs, "OUT": tmp_path / "out.mcap", "FRAMES": tmp_path / "frames"}
    contents = wrong_contents(inputs)
    for suffix in suffixes:
        wrong = {kind: tmp_path / f"{kind.replace(' ', '_')}{suffix}" for kind in contents}
        for kind, path in wrong.items():
            path.write_bytes(contents[kind])
        folder = tmp_path / f"folder{suffix}"
        folder.mkdir()
        for kind, path in {**wrong, "folder": folder, "missing": tmp_path / f"missing{suffix}"}.items():
            if kind == "empty" and "--scenario" in words:
                continue  # a scenario in which nothing is changed
            status = main([str({**named, "WRONG": path}.get(word, word)) for word in words.split()])
            said = capsys.readouterr()
            assert status == 2, (kind, suffix, said)
            # What `check` finds is its result, and what is played is said before it turns out to be nothing.
            assert said.err.count("\n") <= 1, (kind, suffix, said)
            assert said.err or words.startswith("check"), (kind, suffix, said)
    assert not (tmp_path / "out.mcap").exists()
    assert not (tmp_path / "frames").exists()
