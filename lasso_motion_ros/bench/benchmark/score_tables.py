"""A benchmark's score as text, as JSON values, and as what its page shows."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from lasso_motion_ros.bench.benchmark.score import BenchmarkScore, EntryScore
from lasso_motion_ros.bench.suite.clinic_classes import CLASSES
from lasso_motion_ros.bench.suite.clinic_tables import ALL, ClassMeasures, format_clinic
from lasso_motion_ros.bench.suite.judged_scores import begun_classes
from lasso_motion_ros.bench.suite.suite_tables import percent, table_cell
from lasso_motion_ros.evaluation.summary import pair_record
from lasso_motion_ros.reports.benchmark_report import BenchmarkPage, PageTable
from lasso_motion_ros.reports.report_tables import Cell, Row

UNSTARTED = "sequences without a pose"
COLUMNS = ("seq.", "pairs", "plain", "poses", "wrong", "missing", "in 68 %", "in 95 %", "NEES", "centre", "TRE")


def format_score(score: BenchmarkScore) -> str:
    """The table for people, and below it what else is to be said of each entry."""
    manifest = score.manifest
    found = {one.entry.name: one.classes for one in score.entries}
    head = f"{manifest.identity}: {len(manifest.sequences)} sequences, {manifest.pairs} pairs"
    notes = [f"{one.entry.name}: {text}" for one in score.entries for text in _remarks(one)]
    return "\n".join([head, format_clinic(found, "entry", UNSTARTED), *notes])


def score_record(score: BenchmarkScore) -> dict[str, Any]:
    """Everything measured, as JSON values: per entry its measures by class and its pairs."""
    record = {
        "benchmark": score.manifest.identity,
        "sequences": len(score.manifest.sequences),
        "pairs": score.manifest.pairs,
        "entries": {one.entry.name: _entry_record(one) for one in score.entries},
    }
    return {key: _finite(value) for key, value in record.items()}


def score_page(score: BenchmarkScore, versions: dict[str, str]) -> BenchmarkPage:
    """What the page shows.

    Args:
        score: of all entries.
        versions: what the figures were made with, by name.
    """
    manifest = score.manifest
    names = [name for name in CLASSES if any(name in one.classes for one in score.entries)]
    entries = []
    for one in score.entries:
        median, most = _latency_ms(one)
        times = [Cell("–" if value is None else f"{value:.1f}") for value in (median, most)]
        entries.append(Row(one.entry.name, [*_cells(one.classes[ALL]), *times]))
    classes = [
        Row(name if number == 0 else "", [Cell(one.entry.name), *_cells(one.classes[name])])
        for name in names
        for number, one in enumerate(score.entries)
    ]
    return BenchmarkPage(
        identity=manifest.identity,
        sequences=len(manifest.sequences),
        pairs=manifest.pairs,
        entries=PageTable(("entry", *COLUMNS, "ms", "ms, 95 %"), entries),
        classes=PageTable(("class", "entry", *COLUMNS), classes),
        shares={one.entry.name: {name: _shares(one.classes[name]) for name in names} for one in score.entries},
        labels=[(name, CLASSES[name].label) for name in names],
        remarks=[f"{one.entry.name}: {text}" for one in score.entries for text in _gaps(one)],
        rendered_with=dict(manifest.made_with),
        scored_with=versions,
    )


def _shares(one: ClassMeasures) -> tuple[float | None, float | None]:
    """Wrong ones of the poses, and missing ones of the plain pairs."""
    return (one.wrong / one.poses if one.poses else None, one.missing / one.plain if one.plain else None)


def _cells(one: ClassMeasures) -> list[Cell]:
    cells = [Cell(str(count)) for count in (one.sequences, one.pairs, one.plain, one.poses)]
    cells += [Cell(str(count), count > 0) for count in (one.wrong, one.missing)]
    nees = "–" if one.nees is None else f"{one.nees:.3g}"
    texts = [percent(one.inside_68), percent(one.inside_95), nees, table_cell(one.centre_mm), table_cell(one.target_mm)]
    return [*cells, *map(Cell, texts)]


def _latency_ms(one: EntryScore) -> tuple[float | None, float | None]:
    """Median and 95th percentile; None where the files do not tell."""
    latencies = one.entry.latencies_ms
    if not len(latencies):
        return None, None
    median, most = np.percentile(latencies, [50.0, 95.0]).tolist()
    return median, most


def _remarks(one: EntryScore) -> list[str]:
    median, most = _latency_ms(one)
    if median is None:
        return _gaps(one)
    answers = len(one.entry.latencies_ms)
    return [f"latency {median:.1f} ms (median), {most:.1f} ms (95 %) of {answers} answers", *_gaps(one)]


def _gaps(one: EntryScore) -> list[str]:
    """What an entry lacks, in words."""
    gaps = list(one.entry.damage)
    if one.unanswered:
        shown = ", ".join(one.unanswered[:10]) + (" …" if len(one.unanswered) > 10 else "")
        gaps.append(f"no answer at all on {len(one.unanswered)} of the sequences ({shown}): their pairs have no pose")
    return gaps


def _entry_record(one: EntryScore) -> dict[str, Any]:
    median, most = _latency_ms(one)
    return {
        "classes": {name: asdict(measures) for name, measures in one.classes.items()},
        "latency_ms": {"answers": len(one.entry.latencies_ms), "median": median, "percentile_95": most},
        "unanswered": list(one.unanswered),
        "damage": list(one.entry.damage),
        "sequences": {
            name: [
                pair_record(score) | {"classes": sorted(begun_classes(judged.since, score.index)), "plain": plain}
                for score, plain in zip(judged.scores, judged.plain, strict=True)
            ]
            for name, judged in one.sequences.items()
        },
    }


def _finite(value: Any) -> Any:
    """JSON knows no infinity, which is the normalised error under a covariance that claims to be exact."""
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
