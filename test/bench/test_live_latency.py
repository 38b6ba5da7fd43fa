"""The live benchmark's figures by hand, and a short run of the real one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from lasso_motion_ros.bench.live_latency import format_disturbance, format_live, summarise
from lasso_motion_ros.cli.main import main
from lasso_motion_ros.core.errors import LassoMotionError

MS = 1_000_000


def test_figures_by_hand() -> None:
    sent = {stamp: 1000 * MS * stamp for stamp in range(1, 5)}
    later = {stamp: at + 10 * MS for stamp, at in sent.items() if stamp != 4}
    bare = {"a": {stamp: at + 4 * MS for stamp, at in sent.items()}, "b": later}
    poses = {stamp: at + (20 + 2 * stamp) * MS for stamp, at in sent.items() if stamp != 3} | {0: 1}
    figures = summarise(15.0, 64, sent, bare, poses, {0, 1, 2, 3, 4}, 1, (0.5, 1.0))
    assert (figures.published, figures.heard, figures.answered, figures.poses, figures.dropped) == (4, 3, 4, 3, 1)
    assert figures.bare_ms == (10.0, 10.0, 10.0)
    assert figures.pose_ms[0] == pytest.approx(24.0)
    assert figures.first_pose_ms == pytest.approx(22.0)
    assert figures.growth_ms == pytest.approx(6.0)
    assert figures.within_budget
    assert "4 of 4 pairs answered, 3 with a pose, 1 left out" in format_live(figures)
    assert figures.picture_ms is None
    assert "overlay" not in format_live(figures)
    assert not summarise(15.0, 64, sent, bare, {1: sent[1] + 30 * MS}, {1}, 0, (0, 0)).within_budget


def test_the_overlay_beside_the_tracker_by_hand() -> None:
    sent = {1: 1000 * MS, 2: 2000 * MS}
    bare = {plane: {stamp: at + 10 * MS for stamp, at in sent.items()} for plane in "ab"}
    alone = summarise(15.0, 64, sent, bare, {stamp: at + 20 * MS for stamp, at in sent.items()}, {1, 2}, 0, (0, 0))
    # Of plane B's pictures one was passed over for a newer one, and one belongs to a pair before the stream.
    pictures = {"a": {1: sent[1] + 40 * MS, 2: sent[2] + 60 * MS}, "b": {0: 1, 2: sent[2] + 80 * MS}}
    slower = {stamp: at + 25 * MS for stamp, at in sent.items()}
    beside = summarise(15.0, 64, sent, bare, slower, {1, 2}, 0, (0, 0), pictures)
    assert beside.pictures == 3
    assert beside.picture_ms is not None
    assert beside.picture_ms[0] == pytest.approx(60.0)
    assert "150: kept); 3 of 4 pictures" in format_live(beside)
    assert "+5.0 ms at p50" in format_disturbance(alone, beside)
    with pytest.raises(LassoMotionError, match="not one overlay picture"):
        summarise(15.0, 64, sent, bare, slower, {1, 2}, 0, (0, 0), {"a": {}, "b": {0: 1}})


def test_no_pose_is_an_error() -> None:
    with pytest.raises(LassoMotionError, match="of 1 pairs 1 were received and 0 had a pose"):
        summarise(15.0, 64, {1: 0}, {"a": {1: 5}, "b": {1: 5}}, {}, set(), 0, (0, 0))


@pytest.mark.ros
def test_a_short_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "live.json"
    words = [
        "--live",
        "--overlay",
        "--rate",
        "5",
        "--pairs",
        "10",
        "--side",
        "256",
        "--late",
        "100",
        "--json",
        str(path),
    ]
    assert main(["bench", *words]) == 0
    alone, beside = json.loads(path.read_text())
    for figures in (alone, beside):
        assert (figures["published"], figures["answered"], figures["poses"]) == (10, 10, 10)
    assert alone["pictures"] is None
    assert 0 < beside["pictures"] <= 20
    said = capsys.readouterr().out
    assert "added by tracking" in said
    assert "overlay picture received" in said
    assert "5 pairs/s, plane B 100 ms later, overlay beside it" in said


def test_plane_b_is_no_later_than_half_way_to_the_next_pair(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--live", "--rate", "5", "--late", "101"]) == 2
    assert "--late: up to half of the time between two pairs, found 101" in capsys.readouterr().err
