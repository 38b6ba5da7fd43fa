"""Figures that compare results: their errors, recording by recording, and their times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.evaluation.summary import Summary
from lasso_motion_ros.reports.figure_panels import STATIC_COLOUR, legend_above, panels

Array = npt.NDArray[np.float64]

RESULT_COLOURS = ("#0a8f4f", "#d1662b", "#1f6fb4", "#7a4fa3", "#a8324a")


def comparison_figure(summaries: Mapping[tuple[str, str], Summary]) -> Any:
    """Target error (or, without 3-D truth, 2-D error) of every result beside the static one, recording by recording.

    Args:
        summaries: by recording and result.

    Returns:
        A matplotlib Figure.
    """
    recordings = list(dict.fromkeys(recording for recording, _ in summaries))
    results = list(dict.fromkeys(result for _, result in summaries))
    in_space = any(summary.target_error_mm is not None for summary in summaries.values())
    bars: list[tuple[str, str, list[float]]] = []
    if in_space:
        # One recording's results may differ in the pairs that have a pose; the static error shown is the largest.
        static = [
            max((s.static_error_mm or 0.0 for (r, _), s in summaries.items() if r == recording), default=0.0)
            for recording in recordings
        ]
        bars.append(("static overlay", STATIC_COLOUR, static))
    for result, colour in zip(results, RESULT_COLOURS * len(results), strict=False):
        of_result = [summaries.get((recording, result)) for recording in recordings]
        bars.append((result, colour, [_shown(summary, in_space) for summary in of_result]))
    figure, (axis,) = panels(1, "", height=max(2.4, 0.9 + 0.26 * len(bars) * len(recordings)))
    step = 0.8 / len(bars)
    for number, (name, colour, values) in enumerate(bars):
        at = np.arange(len(recordings)) - 0.4 + step * (number + 0.5)
        axis.barh(at, np.nan_to_num(values), height=0.9 * step, color=colour, label=name)
        for place, value in zip(at, values, strict=True):
            words = f" {value:.2f}" if np.isfinite(value) else " no pose"
            axis.text(value if np.isfinite(value) else 0.0, place, words, va="center", fontsize=8)
    axis.set_yticks(np.arange(len(recordings)), recordings)
    axis.invert_yaxis()
    axis.margins(x=0.1)
    axis.set_xlabel("mean target error (mm)" if in_space else "mean 2-D error of both planes (mm)")
    legend_above(axis, columns=4)
    return figure


def failures_figure(shares: Mapping[str, Mapping[str, tuple[float | None, float | None]]]) -> Any:
    """How often each entry of a benchmark is wrong, and how often it says nothing, by event class.

    Args:
        shares: by entry and class, the share of its poses that are wrong, and of the plain pairs without a pose; None:
            there are none. Every entry has the same classes.

    Returns:
        A matplotlib Figure, wrong poses to the left, missing ones to the right.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    classes = list(next(iter(shares.values()), {}))
    figure = Figure(figsize=(8.0, max(2.4, 1.0 + len(classes) * (0.1 + 0.14 * len(shares)))), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, 2, sharex=True, sharey=True)
    step = 0.8 / max(len(shares), 1)
    coloured = list(zip(shares.items(), RESULT_COLOURS * len(shares), strict=False))
    titles = ("wrong, % of its poses", "missing, % of plain pairs")
    for side, (axis, title) in enumerate(zip(axes, titles, strict=True)):
        for number, ((name, by_class), colour) in enumerate(coloured):
            at = np.arange(len(classes)) - 0.4 + step * (number + 0.5)
            values = [by_class[one][side] for one in classes]
            heights = [0.0 if value is None else 100.0 * value for value in values]
            axis.barh(at, heights, height=0.9 * step, color=colour, label=name)
        axis.set_xlabel(title)
        axis.grid(axis="x", alpha=0.25)
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].set_xlim(0.0, 100.0)
    axes[0].set_yticks(np.arange(len(classes)), classes)
    axes[0].margins(y=0.01)
    axes[0].invert_yaxis()
    legend_above(axes[1], columns=3)
    return figure


def timing_figure(milliseconds: Mapping[str, Array], *, title: str) -> Any:
    """The time that each pair took.

    Args:
        milliseconds: (N,) by the result's name.
        title: what stands above.

    Returns:
        A matplotlib Figure.
    """
    figure, (axis,) = panels(1, title, height=2.6)
    for (name, values), colour in zip(milliseconds.items(), RESULT_COLOURS * len(milliseconds), strict=False):
        label = f"{name}: median {np.median(values):.1f} ms, 95 % within {np.percentile(values, 95):.1f} ms"
        axis.plot(np.arange(len(values)), values, ".-", color=colour, linewidth=0.8, label=label)
    axis.set_ylim(bottom=0.0)
    axis.set_xlabel("pair")
    axis.set_ylabel("ms")
    legend_above(axis, columns=2)
    return figure


def _shown(summary: Summary | None, in_space: bool) -> float:
    if summary is None:
        return float("nan")
    values: Sequence[float | None] = (
        [summary.target_error_mm] if in_space else [summary.error_2d_a_mm, summary.error_2d_b_mm]
    )
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else float("nan")
