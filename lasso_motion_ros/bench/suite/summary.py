"""The suite's measures: per sequence and in all, the states against the truth, and how fast events are noticed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.bench.suite.run import SequenceResult
from lasso_motion_ros.evaluation.measures import PairScore
from lasso_motion_ros.evaluation.summary import CHI_SQUARE_68, CHI_SQUARE_95, mean_of, pair_record, percentile_95
from lasso_motion_ros.tracking.tracker import TrackerState

Array = npt.NDArray[np.float64]

TRUE_CLASSES = ("both planes", "one plane", "hidden or gone", "displaced")


@dataclass(frozen=True)
class Measures:
    """Measures of one sequence, or of many taken together pair by pair; None where there is nothing to measure.

    The reference pair is left out of all but the model error.

    Attributes:
        pairs: pairs after the reference.
        expected: of these, pairs that show the lasso in its place.
        poses: poses published.
        silent: poses more than 2 mm off, or without a lasso in its place.
        missing: expected pairs without a pose.
        degraded: poses that were DEGRADED.
        centre_mean_mm: distance of the ring's centre from the truth.
        centre_max_mm: its maximum.
        target_mean_mm: target registration error.
        target_p95_mm: its 95th percentile.
        error_2d_mm: 2-D error at the loop's depth, both planes.
        model_mm: the same in the reference pair.
        inside_68: share of the centre's errors inside their 68 % ellipsoid.
        inside_95: inside the 95 % ellipsoid.
        sigma_mm: mean size of that covariance, root of its trace.
    """

    pairs: int
    expected: int
    poses: int
    silent: int
    missing: int
    degraded: int
    centre_mean_mm: float | None
    centre_max_mm: float | None
    target_mean_mm: float | None
    target_p95_mm: float | None
    error_2d_mm: float | None
    model_mm: float | None
    inside_68: float | None
    inside_95: float | None
    sigma_mm: float | None


@dataclass(frozen=True)
class EventTiming:
    """How one event was noticed.

    Attributes:
        sequence: name of the sequence.
        kind: hide, remove or move.
        pairs_to_silence: poses published after it before the first pair without one; 0 is at once.
        pairs_to_recovery: pairs from the lasso's return to the first pose; None where it did not return or recover.
        pairs_to_displaced: pairs from the first displaced one to DISPLACED; None where it was not said.
        returned: whether the sequence goes on after it with the lasso in its place.
    """

    sequence: str
    kind: str
    pairs_to_silence: int | None
    pairs_to_recovery: int | None
    pairs_to_displaced: int | None
    returned: bool


def measures(scores: Sequence[PairScore]) -> Measures:
    """Measures of the pairs of one sequence or of several."""
    after = [score for score in scores if not score.is_reference]
    tracked = [score for score in after if score.has_pose]

    def values(among: Sequence[PairScore], name: str) -> Array:
        known = [getattr(score, name) for score in among]
        return np.array([value for value in known if value is not None], dtype=np.float64)

    def curves(among: Sequence[PairScore]) -> Array:
        return np.array([error for score in among for error in score.error_2d_mm.values()])

    centre, target, nees = (values(tracked, name) for name in ("centre_error_mm", "target_error_mm", "nees"))
    return Measures(
        pairs=len(after),
        expected=sum(score.expected for score in after),
        poses=len(tracked),
        silent=sum(score.lost_in_silence for score in after),
        missing=sum(score.missing for score in after),
        degraded=sum(score.state == TrackerState.DEGRADED.value for score in tracked),
        centre_mean_mm=mean_of(centre),
        centre_max_mm=float(centre.max()) if centre.size else None,
        target_mean_mm=mean_of(target),
        target_p95_mm=percentile_95(target),
        error_2d_mm=mean_of(curves(tracked)),
        model_mm=mean_of(curves([score for score in scores if score.is_reference])),
        inside_68=mean_of(nees <= CHI_SQUARE_68),
        inside_95=mean_of(nees <= CHI_SQUARE_95),
        sigma_mm=mean_of(values(tracked, "centre_sigma_mm")),
    )


def confusion(results: Sequence[SequenceResult]) -> dict[str, dict[str, int]]:
    """Counts of pairs by what the truth is and what the state was; refused seeds count as no state."""
    counts: dict[str, dict[str, int]] = {name: {} for name in TRUE_CLASSES}
    for result in results:
        for score in result.scores:
            if score.is_reference:
                continue
            row = counts[_true_class(score, result)]
            state = score.state or TrackerState.WAITING_FOR_SEED.value
            row[state] = row.get(state, 0) + 1
    return counts


def _true_class(score: PairScore, result: SequenceResult) -> str:
    if score.hidden:
        return "hidden or gone"
    if score.displaced:
        return "displaced"
    return "one plane" if score.index in result.halves else "both planes"


def event_timings(results: Sequence[SequenceResult]) -> tuple[EventTiming, ...]:
    """How every hidden, removed or moved lasso was noticed, in the sequences whose seed was taken."""
    timings = []
    for result in results:
        for event in result.scenario.events:
            if result.refused or event.kind not in ("hide", "remove", "move"):
                continue
            absent = [score for score in result.scores if score.hidden or score.displaced]
            if not absent:
                continue
            back = [score for score in result.scores if score.index > absent[-1].index]
            timings.append(
                EventTiming(
                    sequence=result.scenario.name,
                    kind=event.kind,
                    pairs_to_silence=_first([not score.has_pose for score in absent]),
                    pairs_to_recovery=_first([score.has_pose for score in back]) if event.kind == "hide" else None,
                    pairs_to_displaced=_first([score.state == TrackerState.DISPLACED.value for score in absent])
                    if event.kind == "move"
                    else None,
                    returned=bool(back),
                )
            )
    return tuple(timings)


def timing_distribution(timings: Sequence[EventTiming]) -> dict[str, dict[str, int]]:
    """How many events took how many pairs, by what was waited for; "never" where it did not come.

    Pairs are counted from the one that had the event: 0 is in that very pair. A lasso that is hidden till the end
    of its sequence, or is not seen again for another reason, has no recovery to wait for.
    """
    waits = {
        "to no pose, hidden or taken out": [t.pairs_to_silence for t in timings if t.kind != "move"],
        "to no pose, moved": [t.pairs_to_silence for t in timings if t.kind == "move"],
        "to DISPLACED, moved": [t.pairs_to_displaced for t in timings if t.kind == "move"],
        "from the return to a pose, hidden": [t.pairs_to_recovery for t in timings if t.kind == "hide" and t.returned],
    }
    distribution: dict[str, dict[str, int]] = {}
    for name, pairs in waits.items():
        names = [str(count) for count in sorted({count for count in pairs if count is not None})]
        counts = {count: sum(str(value) == count for value in pairs) for count in names}
        if None in pairs:
            counts["never"] = pairs.count(None)
        distribution[name] = counts
    return distribution


def suite_report(results: Sequence[SequenceResult]) -> dict[str, Any]:
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


def sequence_counts(results: Sequence[SequenceResult]) -> dict[str, int]:
    """In how many sequences something went wrong at least once."""
    every = [measures(result.scores) for result in results]
    return {
        "sequences": len(results),
        "refused": sum(bool(result.refused) for result in results),
        "silent": sum(one.silent > 0 for one in every),
        "missing": sum(one.missing > 0 for one in every),
        "degraded": sum(one.degraded > 0 for one in every),
        "centre above 0.5 mm": sum((one.centre_max_mm or 0.0) > 0.5 for one in every),
    }


def format_report(results: Sequence[SequenceResult]) -> str:
    """The tables for people."""
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


def format_sweep(label: str, found: Mapping[str, Mapping[float, Measures]]) -> str:
    """The table of one sweep.

    Args:
        label: what was varied.
        found: measures by configuration and value.
    """
    lines = [[label, "config", "poses", "silent", "missing", "degr.", "centre", "max", "TRE", "in 95", "sigma"]]
    for config, by_value in found.items():
        for value, one in by_value.items():
            counts = [f"{one.poses}/{one.expected}", *map(str, (one.silent, one.missing, one.degraded))]
            lengths = map(table_cell, (one.centre_mean_mm, one.centre_max_mm, one.target_mean_mm))
            lines.append([f"{value:g}", config, *counts, *lengths, percent(one.inside_95), table_cell(one.sigma_mm)])
    return text_table(lines)


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


def _first(flags: Sequence[bool]) -> int | None:
    return next((number for number, flag in enumerate(flags) if flag), None)


def table_cell(value: float | None) -> str:
    """A length for a table."""
    return "–" if value is None else f"{value:.2f}"


def percent(value: float | None) -> str:
    """A share for a table."""
    return "–" if value is None else f"{100 * value:.0f} %"
