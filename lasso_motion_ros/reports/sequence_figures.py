"""Figures of one result on one recording, pair by pair: motion, 2-D error, target error, error by axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.evaluation.measures import PairScore
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.reports.figure_panels import (
    ABSENT_COLOUR,
    FOUND_COLOUR,
    MISSING_COLOUR,
    STATIC_COLOUR,
    TRUTH_COLOUR,
    Flags,
    legend_above,
    mark,
    panels,
)

Array = npt.NDArray[np.float64]

PLANE_COLOURS: dict[Plane, str] = {"a": "#1f6fb4", "b": "#d1662b"}
PLANE_MARKERS: dict[Plane, str] = {"a": "o", "b": "s"}
PAPER_ERROR_MM = 1.0


@dataclass(frozen=True, eq=False)
class PairFlags:
    """What kind of pair each one of a sequence is.

    Attributes:
        reference: (N,) the pairs whose motion is the identity by definition: they are left out of the means.
        has_pose: (N,) the pairs in which a pose was published.
        in_place: (N,) the pairs that show the lasso where the atrium's motion carries it; a pose in any other is false,
            and none is missing there.
    """

    reference: Flags
    has_pose: Flags
    in_place: Flags

    @classmethod
    def of(cls, scores: Sequence[PairScore]) -> PairFlags:
        """The flags of scored pairs."""
        return cls(
            reference=np.array([score.is_reference for score in scores]),
            has_pose=np.array([score.has_pose for score in scores]),
            in_place=np.array([not (score.hidden or score.displaced) for score in scores]),
        )


def errors_2d_mm(scores: Sequence[PairScore]) -> dict[Plane, Array]:
    """Per plane (N,) the 2-D error of each pair, mm at the loop's depth; NaN where there is none."""
    return {plane: missing_as_nan([score.error_2d_mm.get(plane) for score in scores]) for plane in PLANES}


def missing_as_nan(values: Sequence[float | None]) -> Array:
    """(N,) the values, NaN for None."""
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


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


def error_figure(errors_mm: Mapping[Plane, Array], flags: PairFlags, *, title: str = "2-D error") -> Any:
    """The 2-D error of every frame in both planes.

    Args:
        errors_mm: per plane (N,) mean distance between projected model and true centreline, mm at the loop's
            depth; NaN where there was no pose or no truth.
        flags: of what kind the pairs are; the reference's error is the model's.
        title: what stands above.

    Returns:
        A matplotlib Figure.
    """
    figure, (axis,) = panels(1, title, height=4.0)
    frames = np.arange(len(flags.reference))
    top = PAPER_ERROR_MM
    for plane in PLANES:
        values = errors_mm[plane]
        colour, marker = PLANE_COLOURS[plane], PLANE_MARKERS[plane]
        known = values[~flags.reference & np.isfinite(values)]
        label = f"plane {plane.upper()}"
        if known.size:
            label += f": {known.mean():.2f} ± {known.std():.2f} mm"
        axis.plot(frames, values, marker=marker, color=colour, markersize=4.5, linewidth=1, label=label)
        axis.plot(
            frames[flags.reference],
            values[flags.reference],
            marker,
            color="white",
            markeredgecolor=colour,
            markersize=8,
        )
        top = max(top, float(np.nanmax(values, initial=0.0)))
    axis.plot([], [], "o", color="white", markeredgecolor="#555555", markersize=8, label="reference (model error)")
    axis.axhline(PAPER_ERROR_MM, color="#888888", linestyle=":", linewidth=1, label="the paper's mean, 1.0 mm")
    mark(axis, frames[flags.in_place & ~flags.has_pose], MISSING_COLOUR, "no pose")
    mark(axis, frames[~flags.in_place], ABSENT_COLOUR, "lasso hidden or moved")
    false = frames[~flags.in_place & flags.has_pose]
    if len(false):
        axis.plot(false, np.full(len(false), 1.06 * top), "x", color="#8e0000", markersize=7, label="false pose")
    axis.set_ylim(0.0, 1.1 * top)
    axis.set_xlabel("frame")
    axis.set_ylabel("2-D error (mm, at the loop's depth)")
    legend_above(axis, columns=3)
    return figure


def compensation_figure(static_mm: Array, compensated_mm: Array, flags: PairFlags, *, title: str) -> Any:
    """Target error of every pair without and with compensation.

    Args:
        static_mm: (N,) mean target error with T = identity; NaN where unknown.
        compensated_mm: (N,) the same with the published motion; NaN where there was no pose.
        flags: of what kind the pairs are.
        title: what stands above.

    Returns:
        A matplotlib Figure.
    """
    figure, (axis,) = panels(1, title, height=3.6)
    frames = np.arange(len(static_mm))
    counted = np.isfinite(compensated_mm) & ~flags.reference
    for values, colour, name in (
        (static_mm, STATIC_COLOUR, "static overlay"),
        (compensated_mm, FOUND_COLOUR, "compensated"),
    ):
        label = f"{name}: {values[counted].mean():.2f} mm" if counted.any() else name
        axis.plot(frames, values, "o-", color=colour, markersize=4, linewidth=1.2, label=label)
    mark(axis, frames[flags.in_place & ~flags.has_pose], MISSING_COLOUR, "no pose")
    mark(axis, frames[~flags.in_place], ABSENT_COLOUR, "lasso hidden or moved")
    axis.set_ylim(bottom=0.0)
    axis.set_xlabel("pair")
    axis.set_ylabel("target error (mm)")
    legend_above(axis, columns=4)
    return figure


def axis_figure(static_mm: Array, residual_mm: Array, *, title: str) -> Any:
    """Along each world axis, the displacement to compensate and the residual.

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
