"""The demonstration as a user runs it: three processes over DDS, files on disk, no process left behind."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")
pytest.importorskip("av", reason="needs the video extra")
pytest.importorskip("trimesh", reason="needs the overlay extra")

from support.child_processes import children_of, is_running
from support.drawn_recording import loop, write_input

from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.share import share_file
from lasso_motion_ros.evaluation.measures import Truth, score_pairs
from lasso_motion_ros.evaluation.recorded_input import read_estimates, read_truth
from lasso_motion_ros.evaluation.summary import summarise
from lasso_motion_ros.tools.demo_surface import demo_surface
from lasso_motion_ros.tools.demonstration import LIMITS, exceeded_limits

MOTIONS_MM = [0.0, 2.0, 5.0, 3.0, 0.0]


def command(*arguments: str | Path) -> list[str]:
    return [sys.executable, "-m", "lasso_motion_ros.cli.main", "demo", *map(str, arguments)]


@pytest.mark.ros
def test_a_recording_is_played_tracked_overlaid_and_judged(tmp_path: Path) -> None:
    bag = write_input(tmp_path / "ring.mcap", MOTIONS_MM)
    out = tmp_path / "out"
    done = subprocess.run(
        command("--bag", bag, "--out", out), capture_output=True, encoding="utf-8", timeout=280, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "5 pairs played, 5 answered, 5 with a pose" in done.stdout
    for name in ("overlay.mp4", "motion.png", "error_2d.png", "table.txt", "table.json", "live.mcap"):
        assert str(out / name) in done.stdout
        assert (out / name).stat().st_size > 0
    # The table is of what came over the wire.
    scores = score_pairs(read_truth(bag).truth, read_estimates(out / "live.mcap"))
    table = json.loads((out / "table.json").read_text())["recordings"]["ring"]
    assert table["summary"]["error_2d_a_mm"] == pytest.approx(summarise(scores).error_2d_a_mm)
    assert [pair["has_pose"] for pair in table["pairs"]] == [True] * 5


@pytest.mark.ros
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_demonstration_leaves_no_process(tmp_path: Path, number: signal.Signals, status: int) -> None:
    bag = write_input(tmp_path / "ring.mcap", MOTIONS_MM * 4)
    with subprocess.Popen(
        command("--bag", bag, "--out", tmp_path / "out"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        start_new_session=True,
    ) as demo:
        assert demo.stdout is not None
        assert demo.stderr is not None
        if not any(line.startswith("playing") for line in demo.stdout):
            pytest.fail(f"it ended before it played: {demo.stderr.read()}")
        children = children_of(demo.pid)
        assert len(children) >= 2
        demo.send_signal(number)
        assert demo.wait(60) == status
        assert demo.stderr.read() == "lasso-motion demo: interrupted\n"
        assert not any(is_running(child) for child in children)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["logs"]


@pytest.mark.ros
def test_a_node_that_fails_ends_it_with_its_own_words(tmp_path: Path) -> None:
    from lasso_motion_ros.tools.live_graph import DemonstrationInput, run_graph

    given = DemonstrationInput(
        recording=tmp_path / "never_read.mcap",
        configuration=share_file("config/tracker.yaml"),
        surface=tmp_path / "none.stl",
        whole_pairs=1,
        pictures={},
        live=tmp_path / "live.mcap",
        logs=tmp_path / "logs",
    )
    before = children_of(os.getpid())  # of other tests, in the same process: multiprocessing keeps a helper
    with pytest.raises(LassoMotionError, match=r"the overlay ended with status 2: .*none.stl: cannot be read"):
        run_graph(given, lambda line: None)
    assert set(children_of(os.getpid())) <= set(before)


def test_the_vein_is_where_the_lasso_is() -> None:
    surface = demo_surface(Truth(pairs=(), loop=loop()))
    nearest = np.linalg.norm(surface.vertices[:, None] - loop()[::20], axis=2).min(axis=0)
    assert np.median(nearest) < 2e-3  # along most of the ring the wall is there, but where the appendage joins it


@pytest.mark.parametrize(("name", "limit"), LIMITS.items())
def test_a_table_above_a_limit_is_named(name: str, limit: float) -> None:
    scores = summarise(())
    fine = dict.fromkeys(LIMITS, 0.0)
    within = type(scores)(**{**vars(scores), **fine, name: limit})
    above = type(scores)(**{**vars(scores), **fine, name: limit + 0.5})
    unknown = type(scores)(**{**vars(scores), **fine, name: None})
    assert exceeded_limits(within) == []
    assert exceeded_limits(above) == [f"{name} is {limit + 0.5:.3g}, at most {limit:g} is allowed"]
    assert exceeded_limits(unknown) == [f"{name} is unknown, at most {limit:g} is allowed"]
