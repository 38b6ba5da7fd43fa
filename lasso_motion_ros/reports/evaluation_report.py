"""The evaluation's report: one HTML page that holds its own pictures, and the same pictures as PNG files.

The page's words and order are in `templates/evaluation_report.html.j2`; its figures and numbers are made here.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.parameters import Value, parameter_table
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.output_files import write_text
from lasso_motion_ros.evaluation.axes import displacements_mm, residuals_mm
from lasso_motion_ros.evaluation.evaluated import Evaluated, mean_groups, row_names
from lasso_motion_ros.evaluation.measures import PairScore
from lasso_motion_ros.evaluation.summary import BLOCKS, Columns, mean_row, summarise
from lasso_motion_ros.reports.comparison_figures import comparison_figure, timing_figure
from lasso_motion_ros.reports.figure_panels import save_figure, share_scale
from lasso_motion_ros.reports.page_templates import page_template
from lasso_motion_ros.reports.picture_files import EmbeddedPicture, embedded_jpeg, embedded_png, write_png
from lasso_motion_ros.reports.report_tables import PAPER_ROW, Row, axis_rows, key_figures, table_row
from lasso_motion_ros.reports.sequence_figures import (
    PairFlags,
    axis_figure,
    compensation_figure,
    error_figure,
    errors_2d_mm,
    missing_as_nan,
    motion_figure,
)
from lasso_motion_ros.reports.worst_frames import WorstFrame, error_mm

Array = npt.NDArray[np.float64]
Figures = dict[str, tuple[Any, str]]
"""Plots (matplotlib Figures) and captions, by name."""

PAGE = "report.html"
REPORT_FILES = (
    PAGE,
    "comparison.png",
    "timing.png",
    *(f"*_{name}.png" for name in ("target_error", "error_2d", "motion", "axes", "worst_[0-9]*")),
)
"""What a report consists of."""
TEMPLATE = "evaluation_report.html.j2"
MOST_KEY_FIGURES = 3
"""With more results than these, the key figures of each would push the tables off the screen."""
_PAPER_COLUMNS = {"pairs", "2-D A", "2-D B", "model A", "model B"}


def write_report(
    directory: Path,
    results: Sequence[Evaluated],
    worst: Sequence[Sequence[WorstFrame]],
    versions: Mapping[str, str],
    show: Callable[[Sequence[int]], Iterable[int]] = iter,
) -> Path:
    """Write `report.html` and its pictures into an empty directory.

    Args:
        directory: where.
        results: in the order of the rows; several of one recording stand side by side.
        worst: for each result its worst frames, the worst first.
        versions: what the figures were made with, by name.
        show: iterates over the results' indices and may show progress.

    Returns:
        The page.

    Raises:
        RecordingError: something cannot be written.
    """
    page = directory / PAGE
    contents = _Contents(directory, results, worst).all(versions, show)
    write_text(page, page_template(TEMPLATE).render(contents))
    return page


class _Contents:
    """What the template shows; pictures are written as they are drawn."""

    def __init__(self, directory: Path, results: Sequence[Evaluated], worst: Sequence[Sequence[WorstFrame]]) -> None:
        self._directory = directory
        self._results = results
        self._worst = worst
        self._names = row_names(results)
        self._summaries = [summarise(one.scores) for one in results]

    def all(self, versions: Mapping[str, str], show: Callable[[Sequence[int]], Iterable[int]]) -> dict[str, Any]:
        in_space = any(summary.centre_error_mm is not None for summary in self._summaries)
        return {
            "subtitle": self._subtitle(),
            "key_figures": self._key_figures(),
            "paper_table": self._paper_table(),
            "tables": list(self._tables(in_space=in_space)),
            "has_truth_in_space": in_space,
            "comparison": self._comparison(),
            "recordings": self._recordings([_figures(self._results[n]) for n in show(range(len(self._results)))]),
            "timing": self._timing(),
            "configurations": self._configurations(),
            "versions": list(versions.items()),
        }

    def _subtitle(self) -> str:
        recordings = len({one.recording for one in self._results})
        pairs = sum(summary.pairs for summary in self._summaries)
        return (
            f"{len(self._results)} result{'s' * (len(self._results) > 1)} on {recordings} recording"
            f"{'s' * (recordings > 1)}, {pairs} pairs with truth. Millimetres; axes are those of the world frame."
        )

    def _key_figures(self) -> list[dict[str, Any]]:
        if len(self._results) > MOST_KEY_FIGURES:
            return []
        return [
            {"name": name, "facts": key_figures(summary)}
            for name, summary in zip(self._names, self._summaries, strict=True)
        ]

    def _paper_table(self) -> dict[str, Any]:
        columns = tuple(column for column in BLOCKS[0][1] if column[0] in _PAPER_COLUMNS)
        return self._table("", columns, PAPER_ROW)

    def _tables(self, *, in_space: bool) -> Iterable[dict[str, Any]]:
        for title, columns in BLOCKS:
            if not title.startswith("in space"):
                shown = tuple(column for column in columns if not column[0].startswith(("2-D", "model")))
                yield self._table("Poses: missing, false, marked", shown)
            elif in_space:
                yield self._table("Errors in space, mm", columns)

    def _table(self, heading: str, columns: Columns, *last: Row) -> dict[str, Any]:
        by_name = dict(zip(self._names, self._summaries, strict=True))
        rows = [table_row(name, asdict(summary), columns) for name, summary in by_name.items()]
        for name, members in mean_groups(self._results).items():
            rows.append(table_row(name, mean_row([by_name[member] for member in members]), columns, "mean"))
        titles = ["sequence", *(title for title, _ in columns)]
        return {"heading": heading, "titles": titles, "rows": [*rows, *last]}

    def _comparison(self) -> EmbeddedPicture | None:
        if len(self._results) < 2:
            return None
        keyed = {(one.recording, one.result): s for one, s in zip(self._results, self._summaries, strict=True)}
        return self._picture("comparison", comparison_figure(keyed), "Shorter is better.")

    def _recordings(self, drawn: Sequence[Figures]) -> list[dict[str, Any]]:
        recordings = []
        for recording in dict.fromkeys(one.recording for one in self._results):
            numbers = [number for number, one in enumerate(self._results) if one.recording == recording]
            # Figures side by side are compared by eye: one scale for all.
            for name in {name for number in numbers for name in drawn[number]}:
                share_scale([drawn[number][name][0] for number in numbers if name in drawn[number]])
            results = [self._result(number, drawn[number]) for number in numbers]
            recordings.append({"name": recording, "anchor": _slug(recording), "results": results})
        return recordings

    def _result(self, number: int, figures: Figures) -> dict[str, Any]:
        one = self._results[number]
        slug = _slug(self._names[number])
        began = datetime.fromtimestamp(one.scores[0].stamp_ns / 1e9, UTC)
        return {
            "name": one.result,
            "span": f"{len(one.scores)} pairs in {one.times_s[-1]:.1f} s, from {began:%Y-%m-%d %H:%M:%S} UTC.",
            "figures": [self._picture(f"{slug}_{name}", *drawn) for name, drawn in figures.items()],
            "axes": axis_rows(one.scores) if "axes" in figures else [],
            "worst": list(self._worst_frames(number, slug)),
        }

    def _worst_frames(self, number: int, slug: str) -> Iterable[EmbeddedPicture]:
        for place, frame in enumerate(self._worst[number], start=1):
            write_png(self._directory / f"{slug}_worst_{place}.png", frame.picture)
            # Films are photographs: as PNG they would make the page ten times as large.
            yield embedded_jpeg(frame.picture, _worst_caption(frame.score))

    def _timing(self) -> EmbeddedPicture | None:
        timed = {n: one.timing for n, one in zip(self._names, self._results, strict=True) if one.timing is not None}
        if not timed:
            return None
        figure = timing_figure({name: timing.milliseconds for name, timing in timed.items()}, title="Time per pair")
        return self._picture("timing", figure, "; ".join(dict.fromkeys(timing.what for timing in timed.values())))

    def _configurations(self) -> list[dict[str, Any]]:
        known: dict[str, Mapping[str, Value]] = {}
        for one in self._results:
            if one.configuration is not None:
                known.setdefault(one.result, one.configuration)
        return [
            {
                "name": name,
                "changed": [
                    (key, _value(value), _value(default))
                    for key, (value, default) in _changed_parameters(configuration).items()
                ],
                "parameters": [(key, _value(value)) for key, value in configuration.items()],
            }
            for name, configuration in known.items()
        ]

    def _picture(self, name: str, figure: Any, caption: str) -> EmbeddedPicture:
        path = self._directory / f"{name}.png"
        save_figure(figure, path)
        return embedded_png(path, caption)


def _figures(one: Evaluated) -> Figures:
    """A result's plots with their captions, by name."""
    scores = one.scores
    flags = PairFlags.of(scores)
    figures: Figures = {}
    static = missing_as_nan([score.static_error_mm for score in scores])
    if np.isfinite(static).any():
        compensated = missing_as_nan([score.target_error_mm for score in scores])
        figure = compensation_figure(static, compensated, flags, title="Target error, static and compensated")
        figures["target_error"] = figure, "Mean over the points on the atrium."
    errors = errors_2d_mm(scores)
    if any(np.isfinite(values).any() for values in errors.values()):
        figure = error_figure(errors, flags, title="2-D error of every frame")
        figures["error_2d"] = figure, "As the paper's Fig. 3."
    true, found = displacements_mm(scores)
    if np.isfinite(true).any():
        figure = motion_figure(
            one.times_s, found, true, flags.in_place, title="Motion at the lasso since the reference"
        )
        figures["motion"] = figure, "Displacement of the loop's centre, world axes."
        figure = axis_figure(true, residuals_mm(scores), title="Residual against static error")
        figures["axes"] = figure, "Error of the loop's centre, axis by axis."
    return figures


def _worst_caption(score: PairScore) -> str:
    words = [f"Pair {score.index}", score.state or "state unknown"]
    error = error_mm(score)
    if error is not None:
        words.append(f"{'centre' if score.centre_m is not None else '2-D'} {error:.2f} mm off")
    words += [f"2-D {plane.upper()} {value:.2f} mm" for plane, value in score.error_2d_mm.items()]
    if score.false_pose:
        words.append("false: the lasso was " + ("hidden" if score.hidden else "in another place"))
    return ", ".join(words) + "."


def _value(value: Value) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _slug(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", name).strip("_") or "result"


def _changed_parameters(configuration: Mapping[str, Value]) -> dict[str, tuple[Value, Value]]:
    """Parameters that differ from their defaults: name → (value, default)."""
    defaults = {spec.name: spec.default for spec in parameter_table(StreamConfig)}
    return {
        name: (value, defaults[name])
        for name, value in configuration.items()
        if name in defaults and value != defaults[name]
    }
