"""Plots of the phantom suite: errors of every sequence, and the covariance against the errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import chi2

from lasso_motion_ros.suite.report import Measures
from lasso_motion_ros.suite.run import SequenceResult

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


def sweeps_figure(found: Mapping[str, Mapping[str, Mapping[float, Measures]]]) -> Any:
    """One panel a sweep: mean centre error (left), share of the pairs missing or lost in silence (right).

    Args:
        found: measures by what was varied, configuration and value.

    Returns:
        A matplotlib Figure.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = (len(found) + 1) // 2
    figure = Figure(figsize=(10.0, 3.0 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(rows, 2, squeeze=False).ravel()
    for panel in panels[len(found) :]:
        panel.remove()
    for panel, (label, by_config) in zip(panels, found.items(), strict=False):
        right = panel.twinx()
        for (config, by_value), colour in zip(by_config.items(), COLOURS * len(by_config), strict=False):
            values = list(by_value)
            centre = [one.centre_mean_mm if one.centre_mean_mm is not None else np.nan for one in by_value.values()]
            wrong = [100.0 * (one.missing + one.silent) / max(one.expected, 1) for one in by_value.values()]
            panel.plot(values, centre, "o-", color=colour, markersize=4, label=config)
            right.plot(values, wrong, "x:", color=colour, markersize=5, linewidth=1)
        panel.set(xlabel=label, ylabel="centre error (mm)", yscale="log")
        right.set(ylabel="wrong or missing (%), dotted", ylim=(-2.0, 102.0))
        panel.grid(alpha=0.25)
        panel.legend(frameon=False, fontsize=8, loc="upper left")
    return figure
