"""A tiny benchmark: two sequences of four pairs; in the third plane A is lost, in the last the ring is hidden."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support.clinic_inputs import STILL

from lasso_motion_ros.bench.benchmark.export import export_benchmark
from lasso_motion_ros.bench.benchmark.manifest import Manifest, read_manifest
from lasso_motion_ros.bench.benchmark.truth_files import read_sequence_truth
from lasso_motion_ros.bench.suite.sequence import RenderedSequence, render_sequence
from lasso_motion_ros.phantom.settings import BreathingSettings, Event, GeometrySettings, Scenario
from msg_adapters.pose_table import PoseRow, pose_table_lines

SEED = 5
PAIRS = 4


@cache
def breathing() -> RenderedSequence:
    """The sequence that stands for each of the benchmark's; rendered once, so not to be changed."""
    return render_sequence(
        dataclasses.replace(
            STILL,
            pairs=PAIRS,
            rate_hz=3.0,
            geometry=GeometrySettings(size_px=512),
            breathing=BreathingSettings(amplitude_mm=8.0),
            events=(Event("drop", 2, plane="a"), Event("hide", 3)),
        )
    )


def export_tiny(directory: Path, patch: pytest.MonkeyPatch, sequences: int = 2, seed: int = SEED) -> Manifest:
    """Export it; only what is rendered is not what was drawn."""

    def render(scenario: Scenario) -> RenderedSequence:
        return breathing()

    patch.setattr("lasso_motion_ros.bench.suite.cache.render_sequence", render)
    return export_benchmark(directory, seed=seed, sequences=sequences, workers=1)


def true_rows(directory: Path) -> list[PoseRow]:
    """The truth as a tracker's answers: a pose for each pair that shows the ring, with 1 mm² of variance each way."""
    manifest = read_manifest(directory)
    rows = []
    covariance = 1e-6 * np.eye(6)
    for sequence in manifest.sequences:
        truth = read_sequence_truth(directory, manifest, sequence).truth
        for pair in truth.pairs[: PAIRS - 1]:
            rows.append(PoseRow(pair.stamp_ns, pair.motion, covariance, "TRACKING", 4.0))
    return rows


def write_rows(path: Path, rows: Iterable[PoseRow], identity: str = "") -> Path:
    """A file of poses."""
    path.write_text("\n".join(pose_table_lines(rows, identity)) + "\n", encoding="utf-8")
    return path


def contents(directory: Path) -> Mapping[str, bytes]:
    """Every file below a directory, by its path there."""
    return {
        file.relative_to(directory).as_posix(): file.read_bytes()
        for file in sorted(directory.rglob("*"))
        if file.is_file()
    }
