"""What all figures share: colours, panels with legends and bands, a common scale, saving."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import RecordingError

Flags = npt.NDArray[np.bool_]

TRUTH_COLOUR, FOUND_COLOUR = "#3b4252", "#0a8f4f"
STATIC_COLOUR = "#7d93ab"
MISSING_COLOUR, ABSENT_COLOUR = "#f0cfca", "#dfe3e8"


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
