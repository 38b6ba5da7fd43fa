"""Clicks as messages and in files; calibration files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.message_inputs import MESSAGES, seed

from lasso_motion_ros.core.errors import ConfigurationError, MessageError
from msg_adapters.messages import ns_to_stamp
from msg_adapters.seeds import (
    decode_polygon,
    decode_seed,
    encode_polygon,
    encode_seeds_file,
    read_calibration_file,
    read_seeds_file,
)

POINTS = "[[1, 2], [3, 4], [5, 6.5], [7, 8], [9, 10], [11, 12]]"
MATRIX = "[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]"


def test_points_survive_the_message() -> None:
    points = np.array([[1.5, 2.25], [1023.75, 0.0]])
    message = MESSAGES.make("geometry_msgs/msg/PolygonStamped", encode_polygon(points, {}))
    assert np.array_equal(decode_polygon(message), points)


def test_too_few_or_infinite_clicks_are_refused() -> None:
    with pytest.raises(MessageError, match="expected 6 clicks or more along the loop, found 5"):
        decode_seed(seed(0, count=5))
    bad = seed(0)
    bad.polygon.points[3].x = float("nan")
    with pytest.raises(MessageError, match="not finite"):
        decode_seed(bad)


@pytest.mark.parametrize(
    ("stamp", "expected"),
    [
        ("", 0),
        ("stamp: 0", 0),
        ("stamp: 12.5", 12_500_000_000),
        ("stamp: {sec: 1760000000, nanosec: 133333333}", 1_760_000_000_133_333_333),
    ],
)
def test_seeds_file(tmp_path: Path, stamp: str, expected: int) -> None:
    path = tmp_path / "seeds.yaml"
    path.write_text(f"plane_a:\n  points: {POINTS}\n  {stamp}\nplane_b: {POINTS}\n")
    seeds = read_seeds_file(path)
    assert seeds["a"]["header"]["stamp"] == ns_to_stamp(expected)
    message = MESSAGES.make("geometry_msgs/msg/PolygonStamped", seeds["b"])
    assert decode_seed(message)[2].tolist() == [5.0, 6.5]


def test_a_seeds_file_that_is_written_is_read_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "seeds.yaml"
    points = {plane: np.arange(12.0).reshape(6, 2) + shift for plane, shift in (("a", 0.25), ("b", 100.126))}
    stamps = {"a": 1_760_000_000_133_333_333, "b": 1_760_000_000_000_000_001}
    path.write_text(encode_seeds_file({plane: (stamps[plane], points[plane]) for plane in ("a", "b")}))
    for plane, fields in read_seeds_file(path).items():
        assert fields["header"]["stamp"] == ns_to_stamp(stamps[plane])
        found = decode_seed(MESSAGES.make("geometry_msgs/msg/PolygonStamped", fields))
        np.testing.assert_allclose(found, points[plane], atol=0.005)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "expected plane_a and plane_b"),
        ("plane_a: []\n", "expected plane_a and plane_b, found plane_a"),
        (f"plane_a: {POINTS}\nplane_b: [[1, 2]]\n", "plane_b.points: expected 6 points or more, found 1"),
        (f"plane_a: {POINTS}\nplane_b: [[1, 2, 3]]\n", "expected a list of"),
        (f"plane_a: {POINTS}\nplane_b: [[1, 2], [3]]\n", "expected a list of"),
        (f"plane_a: {POINTS}\nplane_b: [[1, .nan]]\n", "all finite"),
        (f"plane_a: {POINTS}\nplane_b: {{clicks: {POINTS}}}\n", "found 'clicks'"),
        (f"plane_a: {POINTS}\nplane_b: {{points: {POINTS}, stamp: yes}}\n", "stamp: expected seconds"),
        (f"plane_a: {POINTS}\nplane_b: {{points: {POINTS}, stamp: -1}}\n", "stamp: expected seconds"),
        ("plane_a: [", "cannot be read as YAML"),
        ("plane_a: !!python/object/apply:os.getcwd []\nplane_b: 1\n", "cannot be read as YAML"),
    ],
)
def test_bad_seeds_files_say_where(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "seeds.yaml"
    path.write_text(text)
    with pytest.raises(ConfigurationError) as caught:
        read_seeds_file(path)
    assert reason in str(caught.value)
    assert str(path) in str(caught.value)


def test_calibration_file(tmp_path: Path) -> None:
    path = tmp_path / "calibration.yaml"
    path.write_text(
        f"plane_a: {{p: {MATRIX}, width: 512, height: 256}}\nplane_b: {{p: {MATRIX}, width: 1, height: 2}}\n"
    )
    message = MESSAGES.make("sensor_msgs/msg/CameraInfo", read_calibration_file(path)["a"])
    assert (message.width, message.height, message.p.tolist()) == (512, 256, list(range(1, 13)))


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ("{p: [1, 2], width: 1, height: 1}", "plane_b.p: expected 12 numbers"),
        ("{width: 1, height: 1}", "plane_b.p: expected 12 numbers"),
        (f"{{p: {MATRIX}, width: 1.5, height: 1}}", "plane_b.width: expected a number of pixels, found 1.5"),
        (f"{{p: {MATRIX}, width: 1}}", "plane_b.height: expected a number of pixels, found None"),
        (f"{{p: {MATRIX}, width: 1, height: 1, k: 2}}", "found 'k'"),
        (MATRIX, "expected height, p, width"),
    ],
)
def test_bad_calibration_files_say_where(tmp_path: Path, body: str, reason: str) -> None:
    path = tmp_path / "calibration.yaml"
    path.write_text(f"plane_a: {{p: {MATRIX}, width: 512, height: 256}}\nplane_b: {body}\n")
    with pytest.raises(ConfigurationError) as caught:
        read_calibration_file(path)
    assert reason in str(caught.value)
