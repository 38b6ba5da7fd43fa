"""Plots of the phantom suite: errors of every sequence, and the covariance against the errors."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from lasso_motion_ros.bench.suite.sequence import SequenceResult
from lasso_motion_ros.bench.suite.suite_measures import Measures, measures

COLOURS = ("#0a8f4f", "#d1662b", "#1f6fb4", "#7a4fa3")
GREY = "#888888"
DECADES = (0.1, 1.0, 10.0)  # mm
LEVELS = np.linspace(0.01, 0.99, 99)


def suite_figure(results: Mapping[str, Sequence[SequenceResult]]) -> Any:
    """Every sequence's errors; the distribution of the errors; the covariance against what it should be.

    Args:
        results: by the configuration's name.

    Returns:
        A matplotlib Figure.
    """
    from scipy.stats import chi2

    figure = _figure(10.0, 7.2)
    places = figure.subplot_mosaic([["each", "each"], ["errors", "calibration"]], height_ratios=[1.1, 1.0])
    each, errors, calibration = (places[name] for name in ("each", "errors", "calibration"))
    for number, ((name, of_config), colour) in enumerate(zip(results.items(), COLOURS * len(results), strict=False)):
        _draw_sequences(each, of_config, colour, 0.3 * number)
        scores = [score for result in of_config for score in result.scores if not score.is_reference]
        centre = np.sort([score.centre_error_mm for score in scores if score.centre_error_mm is not None])
        due = max(1, sum(score.expected for score in scores))
        errors.step(centre, np.arange(1, len(centre) + 1) / due, where="post", color=colour, label=name)
        nees = np.array([score.nees for score in scores if score.nees is not None])
        if nees.size:
            inside = [(nees <= chi2.ppf(level, 3)).mean() for level in LEVELS]
            calibration.plot(LEVELS, inside, color=colour, label=name)
    each.set(xlim=(-1, len(next(iter(results.values())))), yscale="log", ylabel="centre error (mm)")
    each.set_xlabel("sequence: mean (point) and largest error (line); cross: a pose more than 2 mm off, or of no lasso")
    errors.set(xscale="log", xlabel="centre error (mm)", ylabel="share of the pairs due", ylim=(0.0, 1.02))
    calibration.plot([0.0, 1.0], [0.0, 1.0], color=GREY, linestyle=":", linewidth=1)
    calibration.set(xlabel="share expected inside the ellipsoid", ylabel="found", xlim=(0.0, 1.0), ylim=(0.0, 1.02))
    each.axhline(2.0, color=GREY, linestyle=":", linewidth=1)
    errors.axvline(2.0, color=GREY, linestyle=":", linewidth=1)
    each.set_yticks(DECADES, [f"{value:g}" for value in DECADES])
    errors.set_xticks((0.01, *DECADES), [f"{value:g}" for value in (0.01, *DECADES)])
    for axis in (each, errors, calibration):
        _tidy(axis)
    for axis, corner in ((errors, "lower right"), (calibration, "upper left")):
        axis.legend(frameon=False, fontsize=9, loc=corner)
    return figure


def sweeps_figure(found: Mapping[str, Mapping[str, Mapping[float, Measures]]], capture: Collection[str] = ()) -> Any:
    """Two panels a sweep: the centre's error, and the share of the pairs without a good pose.

    Values stand at even distances from easy to hard, as the sweep names them.

    Args:
        found: measures by what was varied, configuration and value.
        capture: those of which the share of successes is shown instead, in one panel.

    Returns:
        A matplotlib Figure.
    """
    abreast = min(len(found), 2)
    rows = -(-len(found) // abreast)
    figure = _figure(6.0 * abreast, 2.6 * rows + 0.4)
    panels = figure.subplots(rows, 2 * abreast, squeeze=False).reshape(-1, 2)
    for pair in panels[len(found) :]:
        for panel in pair:
            panel.remove()
    for (size, wrong), (label, by_config) in zip(panels, found.items(), strict=False):
        ticks = [f"{value:g}" for value in next(iter(by_config.values()))]
        for (config, by_value), colour in zip(by_config.items(), COLOURS * len(by_config), strict=False):
            every = list(by_value.values())
            places = np.arange(len(every))
            centre = [np.nan if one.centre_mean_mm is None else one.centre_mean_mm for one in every]
            silent = np.array([100.0 * one.silent / max(one.expected, 1) for one in every])
            missing = np.array([100.0 * one.missing / max(one.expected, 1) for one in every])
            size.plot(places, centre, "o-", color=colour, markersize=4, label=config)
            if label in capture:
                wrong.plot(places, 100.0 - silent - missing, "o-", color=colour, markersize=4)
            else:
                wrong.plot(places, silent, "o-", color=colour, markersize=4, clip_on=False)
                wrong.plot(places, missing, "s:", color=colour, markersize=4, markerfacecolor="white", clip_on=False)
        size.axhline(2.0, color=GREY, linestyle=":", linewidth=1)
        size.set(yscale="log", ylim=(0.02, 60.0), title="centre error (mm)")
        size.set_yticks(DECADES, [f"{value:g}" for value in DECADES])
        wrong.set(ylim=(-3.0, 103.0), title="% off in silence; dotted: no pose")
        if label in capture:
            wrong.axhline(95.0, color=GREY, linestyle=":", linewidth=1)
            wrong.set(title="% of the trials within 2 mm")
        for panel in (size, wrong):
            panel.set_xticks(np.arange(len(ticks)), ticks)
            panel.set_xlabel(label, fontsize=9)
            panel.title.set(fontsize=9)
            panel.tick_params(labelsize=8)
            _tidy(panel)
    handles, names = panels[0][0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper left", ncols=len(names), frameon=False, fontsize=10)
    return figure


def _draw_sequences(axis: Any, results: Sequence[SequenceResult], colour: str, aside: float) -> None:
    """Mean and largest error of every sequence, in the suite's order; `aside` parts the configurations."""
    for number, result in enumerate(results):
        place = number + aside
        one = measures(result.scores)
        if one.centre_mean_mm is not None and one.centre_max_mm is not None:
            axis.plot([place, place], [one.centre_mean_mm, one.centre_max_mm], color=colour, linewidth=1)
            axis.plot(place, one.centre_mean_mm, "o", color=colour, markersize=3)
        if one.silent:
            axis.plot(place, one.centre_max_mm or 2.0, "x", color=colour, markersize=5)


def _figure(width: float, height: float) -> Any:
    # The object API draws without a display and keeps no global state.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _tidy(axis: Any) -> None:
    axis.grid(alpha=0.25)
    axis.spines[["top", "right"]].set_visible(False)
