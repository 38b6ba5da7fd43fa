"""`lasso-motion bench`: every stage is measured, on one thread, and the figures agree with each other."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from drawn_recording import write_input
from threadpoolctl import threadpool_info

from lasso_motion_ros.cli.bench import one_thread
from lasso_motion_ros.cli.main import main
from lasso_motion_ros.share import share_file


def test_a_recording_is_measured_stage_by_stage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording = write_input(tmp_path / "ring.mcap", [0.0, 1.0, 2.0, 1.0])
    figures = tmp_path / "bench.json"
    config = share_file("config/brost2009.yaml")
    arguments = ["--config", str(config), "--bag", str(recording), "--pairs", "5", "--json", str(figures)]
    assert main(["bench", *arguments]) == 0
    assert "pairs/s on one thread" in capsys.readouterr().out
    measured = json.loads(figures.read_text())
    assert measured["pairs"] == 5
    assert measured["processor_per_wall"] <= 1.05
    stages = measured["stages_ms"]
    assert all(stages[name] > 0 for name in ("deserialise", "decode and pair", "tracking", "serialise"))
    assert stages["  features"] + stages["  registration"] < stages["tracking"]
    overlay = measured["overlay"]
    assert 19_000 < overlay["triangles"] < 22_000
    assert overlay["side_px"] == 1024
    assert 0.0 < overlay["median_ms"] <= overlay["p95_ms"]
    assert overlay["processor_per_wall"] <= 1.05
    outer = sum(spent for name, spent in stages.items() if not name.startswith(" "))
    assert outer == pytest.approx(1e3 / measured["pairs_per_s"], rel=0.2)


def test_thread_pools_are_held_at_one_and_let_go() -> None:
    np.linalg.inv(np.eye(3))  # loads the linear algebra whose pool is meant
    before = cv2.getNumThreads()
    with one_thread():
        assert cv2.getNumThreads() == 1
        assert {pool["num_threads"] for pool in threadpool_info()} == {1}
    assert cv2.getNumThreads() == before


def test_a_recording_without_clicks_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording = write_input(tmp_path / "ring.mcap", [0.0, 1.0], hidden=(0, 1))
    assert main(["bench", "--bag", str(recording), "--pairs", "0"]) == 2
    assert "--pairs must be at least 1" in capsys.readouterr().err
