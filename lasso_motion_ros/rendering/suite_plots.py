"""Plots of the phantom suite: errors of every sequence, and the covariance against the errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import chi2

from lasso_motion_ros.suite_run import SequenceResult

COLOURS = ("#0a8f4f", "#d1662b", "#1f6fb4", "#7a4fa3")


def suite_figure(results: Mapping[str, Sequence[SequenceResult]]) -> Any:
    """Cumulative distribution of the centre's error, and of its normalised square against what it should be.

    Args:
        results: by the configuration's name.

    Returns:
        A matplotlib Figure.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    FigureCanvasAgg(figure)
    errors, calibration = figure.subplots(1, 2)
    levels = np.linspace(0.01, 0.99, 99)
    for (name, of_config), colour in zip(results.items(), COLOURS * len(results), strict=False):
        scores = [score for result in of_config for score in result.scores if not score.is_reference]
        centre = np.sort([score.centre_error_mm for score in scores if score.centre_error_mm is not None])
        due = max(1, sum(score.expected for score in scores))
        errors.step(centre, np.arange(1, len(centre) + 1) / due, where="post", color=colour, label=name)
        nees = np.array([score.nees for score in scores if score.nees is not None])
        if nees.size:
            inside = [(nees <= chi2.ppf(level, 3)).mean() for level in levels]
            calibration.plot(levels, inside, color=colour, label=name)
    errors.set_xscale("log")
    errors.axvline(2.0, color="#888888", linestyle=":", linewidth=1)
    errors.set(xlabel="centre error (mm)", ylabel="share of the pairs that show the lasso", ylim=(0.0, 1.02))
    calibration.plot([0.0, 1.0], [0.0, 1.0], color="#888888", linestyle=":", linewidth=1)
    calibration.set(xlabel="expected share inside the ellipsoid", ylabel="found")
    for axis in (errors, calibration):
        axis.grid(alpha=0.25)
        axis.legend(frameon=False, fontsize=9)
    return figure
