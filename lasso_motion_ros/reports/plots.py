"""Plots of a run: the motion against the truth, and the 2-D error of every frame (as the paper's Fig. 3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.geometry.frames import PLANES, Plane

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

TRUTH_COLOUR, FOUND_COLOUR = "#3b4252", "#0a8f4f"
PLANE_COLOURS: dict[Plane, str] = {"a": "#1f6fb4", "b": "#d1662b"}
PLANE_MARKERS: dict[Plane, str] = {"a": "o", "b": "s"}
MISSING_COLOUR, ABSENT_COLOUR = "#f0cfca", "#dfe3e8"
PAPER_ERROR_MM = 1.0


def motion_figure(
    times_s: Array,
    found_mm: Array,
    true_mm: Array | None,
    in_place: Flags | None = None,
    *,
    title: str = "Breathing motion at the lasso",
) -> Any:
    """The displacement since the reference, one panel an axis.

    Args:
        times_s: (N,) time since the first pair, seconds.
        found_mm: (N, 3) published displacement of the loop's centre, world axes, mm; NaN where there was no pose.
        true_mm: (N, 3) the true one, NaN where unknown; or None.
        in_place: (N,) the pairs that show the lasso where the atrium's motion carries it, in all if None; in any
            other no pose is missing.
        title: what stands above.

    Returns:
        A matplotlib Figure.
    """
    figure, axes = panels(3, title, height=6.4)
    answered = np.isfinite(found_mm).all(axis=1)
    due = np.ones(len(times_s), dtype=bool) if in_place is None else in_place
    for number, (axis, name) in enumerate(zip(axes, "xyz", strict=True)):
        if true_mm is not None:
            axis.plot(times_s, true_mm[:, number], color=TRUTH_COLOUR, linewidth=2.2, alpha=0.55, label="truth")
        axis.plot(times_s, found_mm[:, number], "o-", color=FOUND_COLOUR, markersize=4, linewidth=1, label="published")
        mark(axis, times_s[due & ~answered], MISSING_COLOUR, "no pose" if number == 0 else None)
        mark(axis, times_s[~due], ABSENT_COLOUR, "lasso hidden or moved" if number == 0 else None)
        axis.set_ylabel(f"{name} (mm)")
    legend_above(axes[0], columns=4)
    axes[-1].set_xlabel("time since the first pair (s)")
    return figure


def error_figure(
    errors_mm: Mapping[Plane, Array], reference: Flags, has_pose: Flags, in_place: Flags, *, title: str = "2-D error"
) -> Any:
    """The 2-D error of every frame in both planes.

    Args:
        errors_mm: per plane (N,) mean distance between projected model and true centreline, mm at the loop's
            depth; NaN where there was no pose or no truth.
        reference: (N,) the pairs whose motion is the identity by definition: their error is the model's.
        has_pose: (N,) the pairs in which a pose was published.
        in_place: (N,) the pairs that show the lasso where the atrium's motion carries it; a pose in any other is
            false, and marked as such.
        title: what stands above.

    Returns:
        A matplotlib Figure.
    """
    figure, (axis,) = panels(1, title, height=4.0)
    frames = np.arange(len(reference))
    top = PAPER_ERROR_MM
    for plane in PLANES:
        values = errors_mm[plane]
        colour, marker = PLANE_COLOURS[plane], PLANE_MARKERS[plane]
        known = values[~reference & np.isfinite(values)]
        label = f"plane {plane.upper()}"
        if known.size:
            label += f": {known.mean():.2f} ± {known.std():.2f} mm"
        axis.plot(frames, values, marker=marker, color=colour, markersize=4.5, linewidth=1, label=label)
        axis.plot(frames[reference], values[reference], marker, color="white", markeredgecolor=colour, markersize=8)
        top = max(top, float(np.nanmax(values, initial=0.0)))
    axis.plot([], [], "o", color="white", markeredgecolor="#555555", markersize=8, label="reference (model error)")
    axis.axhline(PAPER_ERROR_MM, color="#888888", linestyle=":", linewidth=1, label="the paper's mean, 1.0 mm")
    mark(axis, frames[in_place & ~has_pose], MISSING_COLOUR, "no pose")
    mark(axis, frames[~in_place], ABSENT_COLOUR, "lasso hidden or moved")
    false = frames[~in_place & has_pose]
    if len(false):
        axis.plot(false, np.full(len(false), 1.06 * top), "x", color="#8e0000", markersize=7, label="false pose")
    axis.set_ylim(0.0, 1.1 * top)
    axis.set_xlabel("frame")
    axis.set_ylabel("2-D error (mm, at the loop's depth)")
    legend_above(axis, columns=3)
    return figure


def save_figure(figure: Any, path: str | Path) -> None:
    """Write a figure as PNG (or what else the suffix says), overwriting.

    Raises:
        RecordingError: the file cannot be written.
    """
    try:
        # No date and no version inside: the same numbers give the same file.
        figure.savefig(path, dpi=130, metadata={"Software": None})
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {error.strerror}") from error


def mark(axis: Any, places: npt.NDArray[Any], colour: str, name: str | None) -> None:
    """Bands behind the values at some places of the x axis, named once in the legend."""
    for place in places:
        axis.axvline(place, color=colour, linewidth=5, zorder=0)
    if name and len(places):
        axis.plot([], [], color=colour, linewidth=5, label=name)


def legend_above(axis: Any, columns: int) -> None:
    """The legend above the panel, where it hides no value."""
    axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, frameon=False, fontsize=9)


def panels(count: int, title: str, height: float) -> tuple[Any, list[Any]]:
    """A figure of panels below each other with common axes: (Figure, list of Axes)."""
    # The object API draws without a display and keeps no global state.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, height), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, fontsize=12)
    axes = list(np.atleast_1d(figure.subplots(count, 1, sharex=True, sharey=True)))
    for axis in axes:
        axis.grid(alpha=0.25)
        axis.spines[["top", "right"]].set_visible(False)
    return figure, axes


def share_scale(figures: Sequence[Any]) -> None:
    """Give figures that stand beside each other one vertical scale: the smallest that holds the values of all."""
    axes = [axis for figure in figures for axis in figure.axes]
    limits = np.array([axis.get_ylim() for axis in axes])
    for axis in axes:
        axis.set_ylim(limits[:, 0].min(), limits[:, 1].max())
