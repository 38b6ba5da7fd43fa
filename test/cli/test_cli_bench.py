"""`lasso-motion bench`: every stage is measured, on one thread, and the figures agree with each other."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from support.drawn_recording import write_input

from lasso_motion_ros.bench import scaling
from lasso_motion_ros.bench.overlay_times import measure_overlay
from lasso_motion_ros.cli.main import main
from lasso_motion_ros.core.share import share_file


@pytest.mark.slow
def test_a_recording_is_measured_stage_by_stage(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lasso_motion_ros.cli.bench.measure_overlay", lambda: measure_overlay(pictures=12))
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
    parts = [spent for name, spent in stages.items() if name.startswith(" ")]
    assert {"  features", "  registration", "  all else"} <= set(stages)
    assert min(parts) > 0.0
    assert sum(parts) == pytest.approx(stages["tracking"])
    overlay = measured["overlay"]
    assert 19_000 < overlay["triangles"] < 22_000
    assert (overlay["side_px"], overlay["pictures"]) == (1024, 12)
    assert 0.0 < overlay["median_ms"] <= overlay["p95_ms"]
    assert min(overlay["moving_gantry_ms"], overlay["band_ms"]) > 0.0
    assert overlay["processor_per_wall"] <= 1.05
    outer = sum(spent for name, spent in stages.items() if not name.startswith(" "))
    assert outer == pytest.approx(1e3 / measured["pairs_per_s"], rel=0.2)


def test_a_recording_without_clicks_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording = write_input(tmp_path / "ring.mcap", [0.0, 1.0], hidden=(0, 1))
    assert main(["bench", "--bag", str(recording), "--pairs", "0"]) == 2
    assert "--pairs must be at least 1" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("config", "varied"),
    [
        ("config/tracker.yaml", {"looked about the prediction (mm)", "points of the model"}),
        ("config/brost2009.yaml", {"side of the ROI (px of 1024)", "points of the model"}),
    ],
)
def test_the_cost_is_told_as_sizes_grow(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    config: str,
    varied: set[str],
) -> None:
    for sizes in ("MODEL_POINTS", "ROI_PX", "NEAR_MM"):
        smallest, *_, largest = getattr(scaling, sizes)
        monkeypatch.setattr(scaling, sizes, (smallest, largest))
    recording = write_input(tmp_path / "ring.mcap", [0.0, 1.0, 2.0, 1.0])
    figures = tmp_path / "bench.json"
    arguments = ["--config", str(share_file(config)), "--bag", str(recording), "--pairs", "3", "--json", str(figures)]
    assert main(["bench", "--scaling", "--quiet", *arguments]) == 0
    assert "points of the model" in capsys.readouterr().out
    costs = json.loads(figures.read_text())["scaling"]
    assert {cost["varied"] for cost in costs} == varied
    assert len(costs) == 4
    for cost in costs:
        assert sum(cost["stages_ms"].values()) == pytest.approx(cost["tracking_ms"])
        assert cost["tracking_ms"] < cost["pair_ms"]


def test_memory_is_sampled_over_one_long_run_of_one_tracker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = write_input(tmp_path / "ring.mcap", [0.0, 1.0, 2.0, 3.0])
    sizes = iter(100.0 + 0.5 * number for number in range(100))
    monkeypatch.setattr("lasso_motion_ros.bench.memory_growth.resident_mb", lambda: next(sizes))
    figures = tmp_path / "bench.json"
    arguments = ["--bag", str(recording), "--pairs", "40", "--json", str(figures), "--quiet"]
    assert main(["bench", "--memory", *arguments]) == 0
    assert "40 pairs, 40 with a pose; after the first tenth +9.0 MB" in capsys.readouterr().out
    use = json.loads(figures.read_text())["memory"]
    assert use["at_pair"] == list(range(2, 41, 2))
    assert use["resident_mb"] == [100.0 + 0.5 * number for number in range(20)]
