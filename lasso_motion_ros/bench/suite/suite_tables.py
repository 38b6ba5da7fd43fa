"""What the suite measured, as tables for people and as JSON values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from lasso_motion_ros.bench.suite.event_timings import event_timings, timing_distribution
from lasso_motion_ros.bench.suite.sequence import SequenceResult
from lasso_motion_ros.bench.suite.suite_measures import Measures, confusion, measures, sequence_counts
from lasso_motion_ros.bench.suite.sweeps import Sweep, capture_range
from lasso_motion_ros.evaluation.summary import pair_record
from lasso_motion_ros.tracking.tracker import TrackerState


def suite_record(results: Sequence[SequenceResult]) -> dict[str, Any]:
    """Everything measured, as JSON values."""
    return {
        "sequences": [
            {
                "name": result.scenario.name,
                "description": result.scenario.description,
                "refused": result.refused,
                "measures": asdict(measures(result.scores)),
                "pairs": [
                    pair_record(score) | {"reason": reason}
                    for score, reason in zip(result.scores, _padded(result), strict=True)
                ],
            }
            for result in results
        ],
        "all": asdict(measures([score for result in results for score in result.scores])),
        "sequences_with": sequence_counts(results),
        "confusion": confusion(results),
        "events": [asdict(timing) for timing in event_timings(results)],
        "pairs_waited": timing_distribution(event_timings(results)),
    }


def format_suite(results: Sequence[SequenceResult]) -> str:
    """The tables as text."""
    rows = [(r.scenario.name, measures(r.scores), r.refused or r.scenario.description) for r in results]
    rows.append(("all pairs", measures([score for r in results for score in r.scores]), ""))
    header = ["sequence", "pairs", "silent", "missing", "degr.", "centre", "max", "TRE", "p95", "2-D", "model"]
    lines = [[*header, "in 68", "in 95", "sigma", ""]]
    for name, one, text in rows:
        counts = [str(value) for value in (one.pairs, one.silent, one.missing, one.degraded)]
        lengths = [
            table_cell(v) for v in (one.centre_mean_mm, one.centre_max_mm, one.target_mean_mm, one.target_p95_mm)
        ]
        lengths += [table_cell(one.error_2d_mm), table_cell(one.model_mm)]
        lines.append(
            [name, *counts, *lengths, percent(one.inside_68), percent(one.inside_95), table_cell(one.sigma_mm), text]
        )
    wrong = ", ".join(f"{name} {count}" for name, count in sequence_counts(results).items())
    parts = [text_table(lines), f"sequences with: {wrong}"]
    parts.append(_confusion_table(confusion(results)))
    timings = event_timings(results)
    if timings:
        timing_lines = [["event", "", "poses before silence", "pairs to recovery", "pairs to DISPLACED"]]
        for t in timings:
            cells = (t.pairs_to_silence, t.pairs_to_recovery, t.pairs_to_displaced)
            timing_lines.append([t.sequence, t.kind, *("–" if value is None else str(value) for value in cells)])
        parts.append(text_table(timing_lines))
        waits = timing_distribution(timings)
        found = {count for counts in waits.values() for count in counts}
        columns = sorted(found - {"never"}, key=int) + sorted(found & {"never"})
        wait_lines = [["pairs waited", *columns]]
        wait_lines += [[name, *(str(of.get(count, 0)) for count in columns)] for name, of in waits.items() if of]
        parts.append(text_table(wait_lines))
    return "\n\n".join(parts)


def format_sweep(sweep: Sweep, found: Mapping[str, Mapping[float, Measures]]) -> str:
    """The table of one sweep, with the capture range where that is the question.

    Args:
        sweep: what was varied.
        found: measures by configuration and value.
    """
    rows = [[sweep.label, "config", "poses", "silent", "missing", "degr.", "centre", "max", "TRE", "in 95", "sigma"]]
    for config, by_value in found.items():
        for value, one in by_value.items():
            counts = [f"{one.poses}/{one.expected}", *map(str, (one.silent, one.missing, one.degraded))]
            lengths = map(table_cell, (one.centre_mean_mm, one.centre_max_mm, one.target_mean_mm))
            rows.append([f"{value:g}", config, *counts, *lengths, percent(one.inside_95), table_cell(one.sigma_mm)])
    lines = [text_table(rows)]
    for config, by_value in found.items() if sweep.is_capture else ():
        reached = capture_range(by_value)
        largest = " (the largest tried)" if reached == max(by_value) else ""
        words = "nowhere" if reached is None else f"up to {reached:g} mm{largest}"
        lines.append(f"{config}: a pose within 2 mm in 95 % of the trials {words}")
    return "\n".join(lines)


def sweeps_record(found: Mapping[str, Mapping[str, Mapping[float, Measures]]]) -> dict[str, Any]:
    """Measures by name of the sweep, configuration and value, as JSON values."""
    return {
        sweep: {
            config: {str(value): asdict(one) for value, one in by_value.items()}
            for config, by_value in by_config.items()
        }
        for sweep, by_config in found.items()
    }


def _confusion_table(counts: Mapping[str, Mapping[str, int]]) -> str:
    states = [state.value for state in TrackerState if any(state.value in row for row in counts.values())]
    lines = [["truth", *states]]
    lines += [[name, *(str(row.get(state, 0)) for state in states)] for name, row in counts.items()]
    return text_table(lines)


def text_table(lines: Sequence[Sequence[str]]) -> str:
    """Columns of text: the first to the left, numbers to the right, prose at the end of a wide table to the left."""
    widths = [max(len(line[column]) for line in lines) for column in range(len(lines[0]))]
    text = []
    for line in lines:
        cells = [line[0].ljust(widths[0])]
        # The last column of the big table is prose; all others are numbers.
        cells += [
            part if column == len(line) - 1 and len(line) > 12 else part.rjust(width)
            for column, (part, width) in enumerate(zip(line[1:], widths[1:], strict=True), 1)
        ]
        text.append("  ".join(cells).rstrip())
    return "\n".join(text)


def _padded(result: SequenceResult) -> list[str]:
    """One reason a pair; a refused seed leaves none."""
    return [*result.reasons, *[""] * (len(result.scores) - len(result.reasons))]


def table_cell(value: float | None) -> str:
    """A length for a table."""
    return "–" if value is None else f"{value:.2f}"


def percent(value: float | None) -> str:
    """A share for a table."""
    return "–" if value is None else f"{100 * value:.0f} %"
