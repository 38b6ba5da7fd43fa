"""The evaluation's report: one HTML page that holds its own pictures, and the same pictures as PNG files."""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.parameters import Value
from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.evaluation.axes import axis_errors, displacements_mm, residuals_mm
from lasso_motion_ros.evaluation.evaluated import Evaluated, changed_parameters, mean_groups, row_names
from lasso_motion_ros.evaluation.measures import PairScore
from lasso_motion_ros.evaluation.summary import BLOCKS, Columns, Values, mean_row, summarise
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.reports.picture_files import jpeg_bytes, write_png
from lasso_motion_ros.reports.plots import error_figure, motion_figure, save_figure, share_scale
from lasso_motion_ros.reports.report_figures import axis_figure, comparison_figure, compensation_figure, timing_figure
from lasso_motion_ros.reports.worst_frames import WorstFrame, error_mm

Array = npt.NDArray[np.float64]
Figures = dict[str, tuple[Any, str]]
"""Plots (matplotlib Figures) and captions, by name."""

PAGE = "report.html"
PAPER = "Brost et al. 2009"
PAPER_VALUES = ("231 frames", "1.0 ± 0.5", "1.0 ± 0.5", "0.6", "0.6")

STYLE = """
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, "Segoe UI", sans-serif; color: #1f2733; background: #f4f6f8; margin: 0; }
main { max-width: 1240px; margin: 0 auto; padding: 24px 28px 60px; }
h1 { font-size: 27px; margin: 0 0 4px; }
h2 { font-size: 20px; margin: 38px 0 10px; border-bottom: 2px solid #d5dce4; padding-bottom: 4px; }
h3 { font-size: 16px; margin: 20px 0 6px; }
p.note, figcaption { color: #566273; font-size: 13.5px; }
p.warning { background: #fff4dd; border-left: 5px solid #ffb000; padding: 8px 14px; }
.facts { display: flex; flex-wrap: wrap; gap: 12px; margin: 18px 0; }
.fact { background: #fff; border: 1px solid #dfe5ec; border-radius: 8px; padding: 10px 16px; min-width: 150px; }
.fact b { display: block; font-size: 23px; font-weight: 600; }
.fact.bad b { color: #b3261e; }
.fact span { color: #566273; font-size: 13px; }
table { border-collapse: collapse; background: #fff; margin: 8px 0; font-variant-numeric: tabular-nums; }
th, td { padding: 5px 12px; border: 1px solid #dfe5ec; text-align: right; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
thead th { background: #e9eef3; }
tr.mean td { font-weight: 600; border-top: 2px solid #93a1b1; }
tr.paper td { color: #566273; font-style: italic; }
td.bad { color: #b3261e; font-weight: 600; }
.wide { overflow-x: auto; }
.beside { display: grid; grid-template-columns: repeat(auto-fit, minmax(520px, 1fr)); gap: 18px; }
section.result { background: #fff; border: 1px solid #dfe5ec; border-radius: 8px; padding: 10px 18px 18px; }
figure { margin: 12px 0; }
figure img { max-width: 100%; height: auto; display: block; }
details { margin: 10px 0; }
summary { cursor: pointer; color: #1f6fb4; }
"""

GLOSSARY = """2-D A, B: mean ± standard deviation of the symmetric mean distance between the projected curve and the
true centreline, in millimetres at the loop's depth; model: the same in the reference pair, where nothing was tracked.
The reference pair is left out of every mean. Silent: poses more than 2 mm off, or (false) published without a lasso in
its place; missing: pairs that show the lasso in its place and got no pose; degraded: share of the poses so marked.
Centre: distance of the loop's centre from the truth, its constant part and its jitter apart; TRE: target registration
error, mean over points on the atrium; static: the same without compensation; in 68/95 %: centre errors inside that
ellipsoid of the published covariance; sigma: the covariance's size."""


def write_report(
    directory: Path,
    results: Sequence[Evaluated],
    worst: Sequence[Sequence[WorstFrame]],
    versions: Mapping[str, str],
    show: Callable[[Sequence[int]], Iterable[int]] = iter,
) -> Path:
    """Write `report.html` and its pictures into a directory, replacing those of an earlier report.

    Args:
        directory: made if it does not exist.
        results: in the order of the rows; several of one recording stand side by side.
        worst: for each result its worst frames, the worst first.
        versions: what the figures were made with, by name.
        show: goes through the results' numbers and may tell how far it is.

    Returns:
        The page.

    Raises:
        RecordingError: something cannot be written.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
        page = _Page(directory, results, worst, show)
        (directory / PAGE).write_text(page.text(versions), encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"{error.filename or directory}: cannot be written: {error.strerror}") from error
    return directory / PAGE


class _Page:
    """Builds the page part by part; pictures are written as they are placed."""

    def __init__(
        self,
        directory: Path,
        results: Sequence[Evaluated],
        worst: Sequence[Sequence[WorstFrame]],
        show: Callable[[Sequence[int]], Iterable[int]],
    ) -> None:
        self._show = show
        self._directory = directory
        self._results = results
        self._worst = worst
        self._names = row_names(results)
        self._summaries = [summarise(one.scores) for one in results]

    def text(self, versions: Mapping[str, str]) -> str:
        parts = [
            "<!doctype html>",
            '<html lang="en"><head><meta charset="utf-8"><title>Lasso tracking: evaluation</title>',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<style>{STYLE}</style></head><body><main>",
            "<h1>Lasso tracking: evaluation</h1>",
            f'<p class="note">{html.escape(self._subtitle())}</p>',
            self._contents(),
            '<p class="warning">Research use only. This is not a medical device.</p>',
            self._facts(),
            "<h2>Table 1, as in the paper</h2>",
            self._paper_table(),
            *self._tables(),
            f'<p class="note">{html.escape(GLOSSARY)}</p>',
        ]
        if len(self._results) > 1:
            keyed = {(one.recording, one.result): s for one, s in zip(self._results, self._summaries, strict=True)}
            parts += ["<h2>Comparison</h2>", self._figure("comparison", comparison_figure(keyed), "Shorter is better.")]
        drawn = [self._figures(number) for number in self._show(range(len(self._results)))]
        for recording in dict.fromkeys(one.recording for one in self._results):
            numbers = [number for number, one in enumerate(self._results) if one.recording == recording]
            # What stands side by side is compared by eye.
            for name in {name for number in numbers for name in drawn[number]}:
                share_scale([drawn[number][name][0] for number in numbers if name in drawn[number]])
            parts.append(f'<h2 id="{_slug(recording)}">{html.escape(recording)}</h2>')
            parts += ['<div class="beside">', *(self._result(number, drawn[number]) for number in numbers), "</div>"]
        parts += [self._timing(), self._configurations(), _versions(versions), "</main></body></html>\n"]
        return "\n".join(part for part in parts if part)

    def _subtitle(self) -> str:
        recordings = len({one.recording for one in self._results})
        pairs = sum(summary.pairs for summary in self._summaries)
        return (
            f"{len(self._results)} result{'s' * (len(self._results) > 1)} on {recordings} recording"
            f"{'s' * (recordings > 1)}, {pairs} pairs with truth. Millimetres; axes are those of the world frame."
        )

    def _contents(self) -> str:
        recordings = dict.fromkeys(one.recording for one in self._results)
        if len(recordings) == 1:
            return ""
        links = " · ".join(f'<a href="#{_slug(name)}">{html.escape(name)}</a>' for name in recordings)
        return f'<p class="note">{links}</p>'

    def _facts(self) -> str:
        """What one wants to know first, of the only result or of each."""
        blocks = []
        for name, summary in zip(self._names, self._summaries, strict=True):
            facts = [
                _fact("2-D error A, B (mm)", _joined(summary.error_2d_a_mm, summary.error_2d_b_mm)),
                _fact("target error (mm)", _plain(summary.target_error_mm)),
                _fact("static overlay (mm)", _plain(summary.static_error_mm)),
                _fact("removed", "–" if summary.removed_share is None else f"{100 * summary.removed_share:.0f} %"),
                _fact("lost in silence", _count(summary.lost_in_silence), bool(summary.lost_in_silence)),
                _fact("missing", _count(summary.missing), bool(summary.missing)),
            ]
            heading = f"<h3>{html.escape(name)}</h3>" if len(self._results) > 1 else ""
            blocks.append(f'{heading}<div class="facts">{"".join(facts)}</div>')
            if len(self._results) > 3:
                return ""
        return "".join(blocks)

    def _paper_table(self) -> str:
        columns: Columns = tuple(
            column for column in BLOCKS[0][1] if column[0] in {"pairs", "2-D A", "2-D B", "model A", "model B"}
        )
        paper = f'<tr class="paper"><td>{PAPER}, clinical</td>' + "".join(f"<td>{v}</td>" for v in PAPER_VALUES)
        return self._table("sequence", columns, paper + "</tr>")

    def _tables(self) -> Iterable[str]:
        for title, columns in BLOCKS:
            in_space = title.startswith("in space")
            if in_space and all(summary.centre_error_mm is None for summary in self._summaries):
                yield '<p class="note">No truth in space in these recordings: errors in the images only.</p>'
                continue
            shown = columns if in_space else tuple(c for c in columns if not c[0].startswith(("2-D", "model")))
            yield f"<h2>{'Errors in space, mm' if in_space else 'Poses: missing, false, marked'}</h2>"
            yield self._table("sequence", shown)

    def _table(self, corner: str, columns: Columns, last_row: str = "") -> str:
        head = "".join(f"<th>{html.escape(name)}</th>" for name in (corner, *(name for name, _ in columns)))
        rows = [_row(name, asdict(s), columns) for name, s in zip(self._names, self._summaries, strict=True)]
        by_name = dict(zip(self._names, self._summaries, strict=True))
        for name, members in mean_groups(self._results).items():
            rows.append(_row(name, mean_row([by_name[member] for member in members]), columns, "mean"))
        body = "\n".join([*rows, last_row])
        return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'

    def _figures(self, number: int) -> Figures:
        """A result's plots with their captions, by name."""
        one = self._results[number]
        scores = one.scores
        has_pose = np.array([score.has_pose for score in scores])
        in_place = np.array([not (score.hidden or score.displaced) for score in scores])
        reference = np.array([score.is_reference for score in scores])
        figures: Figures = {}
        static = _missing_as_nan([score.static_error_mm for score in scores])
        if np.isfinite(static).any():
            compensated = _missing_as_nan([score.target_error_mm for score in scores])
            figure = compensation_figure(
                static, compensated, reference, has_pose, in_place, title="Target error, static and compensated"
            )
            figures["target_error"] = figure, "Mean over the points on the atrium."
        errors = {plane: _missing_as_nan([score.error_2d_mm.get(plane) for score in scores]) for plane in PLANES}
        if any(np.isfinite(values).any() for values in errors.values()):
            figure = error_figure(errors, reference, has_pose, in_place, title="2-D error of every frame")
            figures["error_2d"] = figure, "As the paper's Fig. 3."
        true, found = displacements_mm(scores)
        if np.isfinite(true).any():
            figure = motion_figure(one.times_s, found, true, in_place, title="Motion at the lasso since the reference")
            figures["motion"] = figure, "Displacement of the loop's centre, world axes."
            figure = axis_figure(true, residuals_mm(scores), title="Residual against static error")
            figures["axes"] = figure, "Error of the loop's centre, axis by axis."
        return figures

    def _result(self, number: int, figures: Figures) -> str:
        one = self._results[number]
        slug = _slug(self._names[number])
        began = datetime.fromtimestamp(one.scores[0].stamp_ns / 1e9, UTC)
        span = f"{len(one.scores)} pairs in {one.times_s[-1]:.1f} s, from {began:%Y-%m-%d %H:%M:%S} UTC."
        parts = [f'<section class="result"><h3>{html.escape(one.result)}</h3>', f'<p class="note">{span}</p>']
        parts += [self._figure(f"{slug}_{name}", figure, caption) for name, (figure, caption) in figures.items()]
        if "axes" in figures:
            parts.append(_axis_table(one.scores))
        parts.append(self._worst_frames(number, slug))
        return "\n".join([*parts, "</section>"])

    def _worst_frames(self, number: int, slug: str) -> str:
        if not self._worst[number]:
            return ""
        parts = ["<h3>Worst frames</h3>"]
        for place, frame in enumerate(self._worst[number], start=1):
            path = self._directory / f"{slug}_worst_{place}.png"
            write_png(path, frame.picture)
            parts.append(_image("jpeg", jpeg_bytes(frame.picture), _worst_caption(frame.score)))
        return "\n".join(parts)

    def _timing(self) -> str:
        timed = {n: one.timing for n, one in zip(self._names, self._results, strict=True) if one.timing is not None}
        if not timed:
            return "<h2>Timing</h2><p class='note'>The results do not tell how long the answers took.</p>"
        figure = timing_figure({name: timing.milliseconds for name, timing in timed.items()}, title="Time per pair")
        what = "; ".join(dict.fromkeys(timing.what for timing in timed.values()))
        return f"<h2>Timing</h2>{self._figure('timing', figure, what)}"

    def _configurations(self) -> str:
        known: dict[str, Mapping[str, Value]] = {}
        for one in self._results:
            if one.configuration is not None:
                known.setdefault(one.result, one.configuration)
        parts = ["<h2>Configuration</h2>"]
        if not known:
            parts.append('<p class="note">The result does not tell by which parameters it was made.</p>')
        for name, configuration in known.items():
            parts.append(f"<h3>{html.escape(name)}</h3>")
            changed = changed_parameters(configuration)
            if changed:
                rows = "".join(
                    f"<tr><td>{html.escape(key)}</td><td>{_value(value)}</td><td>{_value(default)}</td></tr>"
                    for key, (value, default) in changed.items()
                )
                parts.append(
                    f"<table><thead><tr><th>parameter</th><th>value</th><th>default</th></tr></thead>{rows}</table>"
                )
            else:
                parts.append('<p class="note">All parameters have their default values.</p>')
            rows = "".join(
                f"<tr><td>{html.escape(key)}</td><td>{_value(value)}</td></tr>" for key, value in configuration.items()
            )
            parts.append(
                f"<details><summary>all {len(configuration)} parameters</summary><table>{rows}</table></details>"
            )
        return "\n".join(parts)

    def _figure(self, name: str, figure: object, caption: str) -> str:
        path = self._directory / f"{name}.png"
        save_figure(figure, path)
        return _image("png", path.read_bytes(), caption)


def _image(kind: str, file: bytes, caption: str) -> str:
    data = base64.b64encode(file).decode("ascii")
    words = html.escape(caption)
    return f'<figure><img alt="{words}" src="data:image/{kind};base64,{data}"><figcaption>{words}</figcaption></figure>'


def _row(name: str, values: Values, columns: Columns, css: str = "") -> str:
    cells = [f"<td>{html.escape(name)}</td>"]
    for title, cell in columns:
        text = cell(values)
        bad = title in {"missing", "silent", "false"} and text not in {"0", "–"}
        cells.append(f"<td{' class=bad' if bad else ''}>{html.escape(text)}</td>")
    return f"<tr{f' class={css}' if css else ''}>{''.join(cells)}</tr>"


def _axis_table(scores: Sequence[PairScore]) -> str:
    axes = axis_errors(scores)
    if axes is None:
        return ""
    rows = "".join(
        f"<tr><td>{name}</td><td>{axes.static_mm[i]:.2f}</td><td>{axes.residual_mm[i]:.2f}</td>"
        f"<td>{axes.constant_mm[i]:+.2f}</td><td>{axes.jitter_mm[i]:.2f}</td></tr>"
        for i, name in enumerate("xyz")
    )
    head = "<th>axis</th><th>static, rms</th><th>residual, rms</th><th>constant offset</th><th>jitter, sd</th>"
    return f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"


def _worst_caption(score: PairScore) -> str:
    words = [f"Pair {score.index}", score.state or "state unknown"]
    error = error_mm(score)
    if error is not None:
        words.append(f"{'centre' if score.centre_m is not None else '2-D'} {error:.2f} mm off")
    words += [f"2-D {plane.upper()} {value:.2f} mm" for plane, value in score.error_2d_mm.items()]
    if score.false_pose:
        words.append("false: the lasso was " + ("hidden" if score.hidden else "in another place"))
    return ", ".join(words) + "."


def _versions(versions: Mapping[str, str]) -> str:
    rows = "".join(f"<tr><td>{html.escape(k)}</td><td>{html.escape(v)}</td></tr>" for k, v in versions.items())
    return f"<h2>Versions</h2><table>{rows}</table>"


def _missing_as_nan(values: Sequence[float | None]) -> Array:
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def _fact(name: str, value: str, bad: bool = False) -> str:
    return f'<div class="fact{" bad" * bad}"><b>{value}</b><span>{name}</span></div>'


def _plain(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def _joined(*values: float | None) -> str:
    return ", ".join(_plain(value) for value in values)


def _count(value: int | None) -> str:
    return "–" if value is None else str(value)


def _value(value: Value) -> str:
    return html.escape(f"{value:g}" if isinstance(value, float) else str(value))


def _slug(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", name).strip("_") or "result"
