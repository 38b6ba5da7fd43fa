"""A recording as frame grabbers make it: a heads-up display about the X-ray field, late stamps, held pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from support.drawn_recording import PERIOD_NS, SIDE, stamp, write_input

from lasso_motion_ros.cli.main import main
from lasso_motion_ros.evaluation.recorded_input import read_estimates
from msg_adapters.calibrations import decode_camera_info, encode_camera_info
from msg_adapters.images import decode_image, encode_image
from msg_adapters.messages import header_fields, stamp_to_ns
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.recordings.writer import RecordingWriter
from msg_adapters.seeds import decode_seed, encode_polygon

MOTIONS_MM = [0.0, 2.0, 4.0, 2.0, 0.5]
WIDTH, HEIGHT = 720, 576
ORIGIN = {"a": (100, 30), "b": (60, 50)}
LATE_NS = {"a": 0, "b": 80_000_000}
HELD_AFTER, HELD = 2, 3


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_input(tmp_path_factory.mktemp("plain") / "ring.mcap", MOTIONS_MM)


def moment(recorded_ns: int) -> int:
    """When it is grabbed: after the pedal was up for some frames."""
    return recorded_ns + (HELD * PERIOD_NS if recorded_ns > stamp(HELD_AFTER) else 0)


def grabbed(plain: Path, path: Path) -> Path:
    """The recording in colour, with a clock; plane A is calibrated for the whole picture, plane B for the field."""
    with RecordingWriter(path) as writer:

        def write(one: Any, plane: str, fields: dict[str, Any], at: int) -> None:
            header = header_fields(at + LATE_NS[plane], "patient_table")
            writer.write(one.topic, one.type_name, {**fields, "header": header}, at)

        for one in RecordingReader(plain).messages():
            if not one.topic.startswith("/plane_"):
                continue
            plane, kind, at = one.topic[7], one.topic[9:], moment(stamp_to_ns(one.message.header.stamp))
            x, y = ORIGIN[plane]
            if kind == "seed":
                write(one, plane, encode_polygon(decode_seed(one.message) + np.array([x, y]), {}), at)
            elif kind == "camera_info":
                field = decode_camera_info(one.message)
                picture = field.cropped(-x, -y, WIDTH, HEIGHT)
                write(one, plane, encode_camera_info(picture if plane == "a" else field, {}), at)
            else:
                times = HELD + 1 if at == stamp(HELD_AFTER) else 1
                for repeat in range(times):
                    now = at + repeat * PERIOD_NS
                    write(one, plane, encode_image(with_display(decode_image(one.message), x, y, now), {}), now)
    return path


def with_display(field: np.ndarray, x: int, y: int, now: int) -> np.ndarray:
    """The field in a picture with a frame of light and a clock."""
    picture = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    picture[y - 8 : y + SIDE + 2, x - 8 : x + SIDE + 8] = 255
    picture[y : y + SIDE, x : x + SIDE] = field[..., None]
    picture[2:18, 5:50] = np.random.default_rng(now).integers(0, 255, (16, 45, 1))
    return picture


def parameters(path: Path, **planes: Any) -> Path:
    standard = {
        f"plane_{plane}": {"crop": f"{x} {y} {SIDE} {SIDE}", "stamp_offset_s": LATE_NS[plane] / 1e9}
        for plane, (x, y) in ORIGIN.items()
    }
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": standard | planes}}))
    return path


def motions(result: Path) -> dict[int, np.ndarray]:
    return {one.stamp_ns: one.motion for one in read_estimates(result) if one.motion is not None}


@pytest.mark.slow
def test_it_is_tracked_as_the_images_themselves(
    plain: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = grabbed(plain, tmp_path / "grabbed.mcap")
    config = parameters(tmp_path / "grabber.yaml")
    assert main(["track", str(recording), "-o", str(tmp_path / "out.mcap"), "--config", str(config)]) == 0
    said = capsys.readouterr().out
    assert f"held pictures left out: {HELD} of {len(MOTIONS_MM) + HELD} of plane A, " in said
    assert main(["track", str(plain), "-o", str(tmp_path / "plain.mcap")]) == 0
    expected = {moment(at): motion for at, motion in motions(tmp_path / "plain.mcap").items()}
    found = motions(tmp_path / "out.mcap")
    assert list(found) == list(expected)
    for at, motion in expected.items():
        np.testing.assert_allclose(found[at], motion, atol=2e-5)  # the pause makes the filter less sure
    assert main(["check", str(recording), "--config", str(config)]) == 0
    assert "rgb8 pictures are taken as luminance" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("crop", "said"),
    [
        ("300 30 512 512", "crop: 512×512 pixels at (300, 30) reach beyond the picture, which has 720×576"),
        ("100 30 400 400", "the calibration is for an image of 512×512 (with binning and roi), the image has 720×576"),
        ("100 30 512", "plane_b.crop: expected x y width height in whole pixels, found '100 30 512'"),
        ("0 0 0 9", "plane_b.crop: expected a width and a height of at least 1 pixel, found '0 0 0 9'"),
    ],
)
def test_a_crop_that_cannot_be_is_one_line(
    plain: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], crop: str, said: str
) -> None:
    recording = grabbed(plain, tmp_path / "grabbed.mcap")
    config = parameters(tmp_path / "grabber.yaml", plane_b={"crop": crop})
    assert main(["track", str(recording), "-o", str(tmp_path / "out.mcap"), "--config", str(config)]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
