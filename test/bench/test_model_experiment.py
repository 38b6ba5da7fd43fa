"""The paper's model experiment, from the figures to the command."""

import math

import numpy as np
import pytest

from lasso_motion_ros.bench import model_experiment
from lasso_motion_ros.bench.model_experiment import PAPER_DISTANCE_MM, curve_distance, run_model_experiment
from lasso_motion_ros.core.errors import ReconstructionError
from lasso_motion_ros.seeding.cones import Ellipse3D


@pytest.mark.slow
def test_papers_experiment(record_property):
    # 5 mm on the detector, 100 points: the paper has 3.2 mm.
    result = run_model_experiment(trials=200, noise_mm=5.0, points=100, random_seed=0)
    record_property("mean_model_distance_mm", result.mean_mm)
    assert result.trials == 200
    assert result.refused <= 6
    assert result.mean_mm == pytest.approx(PAPER_DISTANCE_MM, abs=0.5)
    assert result.median_mm < result.mean_mm


def test_without_noise_the_model_is_exact():
    # Curves of 120 points: the sagitta of a chord is 10 mm · (1 − cos 1.5°) = 0.0034 mm.
    assert run_model_experiment(trials=20, noise_mm=0.0).mean_mm < 0.004


def test_seed_decides():
    first, again, other = (run_model_experiment(trials=5, random_seed=s) for s in (1, 1, 2))
    assert first == again
    assert first.mean_mm != other.mean_mm


def test_refused_trials_are_counted_and_left_out(monkeypatch):
    reconstruct = model_experiment.reconstruct_ellipse
    calls = iter(range(100))

    def every_second(projections, outlines):
        if next(calls) % 2:
            raise ReconstructionError("no")
        return reconstruct(projections, outlines)

    monkeypatch.setattr(model_experiment, "reconstruct_ellipse", every_second)
    result = run_model_experiment(trials=6, noise_mm=0.0)
    assert (result.trials, result.refused) == (6, 3)
    assert result.mean_mm < 0.004


def test_all_refused_gives_no_distance():
    # Five points are too few for an ellipse.
    result = run_model_experiment(trials=5, points=5)
    assert result.refused == 5
    assert math.isnan(result.mean_mm)
    assert math.isnan(result.median_mm)


def test_distance_by_hand():
    # Concentric circles of 10 and 12 mm: 2 mm, but for the chords.
    u, v = np.eye(3)[:2]
    small, large = (Ellipse3D(np.zeros(3), r * u, r * v) for r in (0.010, 0.012))
    assert curve_distance(small, large) == pytest.approx(0.002, abs=5e-6)
