"""The report's own plots: error with and without compensation, residual by axis, results against each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.evaluation.summary import Summary
from lasso_motion_ros.reports.plots import (
    ABSENT_COLOUR,
    FOUND_COLOUR,
    MISSING_COLOUR,
    TRUTH_COLOUR,
    Flags,
    legend_above,
    mark,
    panels,
)

Array = npt.NDArray[np.float64]

STATIC_COLOUR = "#7d93ab"
RESULT_COLOURS = ("#0a8f4f", "#d1662b", "#1f6fb4", "#7a4fa3", "#a8324a")


def compensation_figure(
    static_mm: Array, compensated_mm: Array, reference: Flags, has_pose: Flags, in_place: Flags, *, title: str
) -> Any:
    """Target error of every pair without and with compensation.

    Args:
        static_mm: (N,) mean target error with T = identity; NaN where unknown.
        compensated_mm: (N,) the same with the published motion; NaN where there was no pose.
        reference: (N,) the pairs whose motion is the identity by definition; they are left out of the means.
        has_pose: (N,) the pairs in which a pose was published.
        in_place: (N,) the pairs that show the lasso where the atrium's motion carries it.
        title: what stands above.

    Returns:
        A matplotlib Figure.
    """
    figure, (axis,) = panels(1, title, height=3.6)
    frames = np.arange(len(static_mm))
    counted = np.isfinite(compensated_mm) & ~reference
    for values, colour, name in (
        (static_mm, STATIC_COLOUR, "static overlay"),
        (compensated_mm, FOUND_COLOUR, "compensated"),
    ):
        label = f"{name}: {values[counted].mean():.2f} mm" if counted.any() else name
        axis.plot(frames, values, "o-", color=colour, markersize=4, linewidth=1.2, label=label)
    mark(axis, frames[in_place & ~has_pose], MISSING_COLOUR, "no pose")
    mark(axis, frames[~in_place], ABSENT_COLOUR, "lasso hidden or moved")
    axis.set_ylim(bottom=0.0)
    axis.set_xlabel("pair")
    axis.set_ylabel("target error (mm)")
    legend_above(axis, columns=4)
    return figure


def axis_figure(static_mm: Array, residual_mm: Array, *, title: str) -> Any:
    """Per axis of the world, what there was to compensate and what is left of it.

    Args:
        static_mm: (N, 3) true displacement of the loop's centre since the reference; NaN where unknown.
        residual_mm: (N, 3) error of the centre; NaN where there was no pose. Its mean is drawn as the constant
            offset, one standard deviation about it as the jitter.
        title: what stands above.

    Returns:
        A matplotlib Figure.
    """
    figure, axes = panels(3, title, height=6.4)
    frames = np.arange(len(static_mm))
    for number, (axis, name) in enumerate(zip(axes, "xyz", strict=True)):
        residual = residual_mm[:, number]
        axis.axhline(0.0, color="#bbbbbb", linewidth=0.8, zorder=0)
        axis.plot(frames, static_mm[:, number], color=TRUTH_COLOUR, linewidth=1.6, alpha=0.5, label="static error")
        axis.plot(frames, residual, "o", color=FOUND_COLOUR, markersize=4, label="residual")
        if np.isfinite(residual).any():
            mean, spread = float(np.nanmean(residual)), float(np.nanstd(residual))
            axis.axhspan(mean - spread, mean + spread, color=FOUND_COLOUR, alpha=0.15, linewidth=0, label="jitter (sd)")
            axis.axhline(mean, color=FOUND_COLOUR, linewidth=1, linestyle="--", label="constant offset")
            axis.set_title(f"constant {mean:+.2f} mm, jitter {spread:.2f} mm", loc="left", fontsize=9)
        axis.set_ylabel(f"{name} (mm)")
    legend_above(axes[0], columns=4)
    axes[-1].set_xlabel("pair")
    return figure


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


def timing_figure(milliseconds: Mapping[str, Array], *, title: str) -> Any:
    """Time of every pair's answer.

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
