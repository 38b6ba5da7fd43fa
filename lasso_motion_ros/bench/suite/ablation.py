"""Ablation: every idea of the tracker switched off in turn, and what that costs on the suite and in the traps."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from lasso_motion_ros.bench.suite.ideas import Idea
from lasso_motion_ros.bench.suite.sequence import RenderedSequence, SequenceResult, run_sequence
from lasso_motion_ros.bench.suite.suite_measures import Measures, measures
from lasso_motion_ros.bench.suite.suite_tables import percent, table_cell
from lasso_motion_ros.bench.suite.trap_measures import TrapMeasures, trap_measures
from lasso_motion_ros.bench.suite.traps import TRAPS, Trap
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.stream.tracker_factory import create_tracker
from lasso_motion_ros.tracking.wrapped_tracker import TimedTracker


@dataclass(frozen=True)
class NotableChange:
    """Changes smaller than these are not called a cost or a gain.

    Attributes:
        share: of a length.
        mm: of a length, however small it is.
        coverage: of the share of errors inside an ellipsoid.
        time: of the time a pair.
        target_mm: of a sequence's target error; also of a trap's, however small it is.
        trap_share: of a trap's lengths: it has a few sequences only.
    """

    share: float = 0.03
    mm: float = 0.003
    coverage: float = 0.02
    time: float = 0.10
    target_mm: float = 0.02
    trap_share: float = 0.10


NOTABLE = NotableChange()


@dataclass(frozen=True, eq=False)
class Variant:
    """What a tracker, whole or with one idea switched off, made of one sequence.

    Attributes:
        result: its scores.
        milliseconds: processor time of each pair.
    """

    result: SequenceResult
    milliseconds: tuple[float, ...]


@dataclass
class Outcome:
    """What the tracker made of the suite, whole or with one idea switched off.

    Attributes:
        idea: what was switched off; None: nothing.
        results: sequence by sequence.
        spent_s: processor time of tracking.
        pairs: pairs that it was spent on.
        trapped: by name of the trap, sequence by sequence; none of it is in `results` or the time.
    """

    idea: Idea | None
    results: list[SequenceResult] = field(default_factory=list)
    spent_s: float = 0.0
    pairs: int = 0
    trapped: dict[str, list[SequenceResult]] = field(default_factory=dict)

    def add(self, variant: Variant, trap: Trap | None = None) -> None:
        """Count what became of another sequence, a random one or a trap's."""
        if trap is not None:
            self.trapped.setdefault(trap.name, []).append(variant.result)
            return
        self.results.append(variant.result)
        self.spent_s += 1e-3 * sum(variant.milliseconds)
        self.pairs += len(variant.milliseconds)

    @property
    def ms(self) -> float:
        """Processor time a pair, milliseconds."""
        return 1e3 * self.spent_s / max(self.pairs, 1)

    @property
    def measures(self) -> Measures:
        """Of all pairs."""
        return measures([score for result in self.results for score in result.scores])

    @property
    def traps(self) -> dict[str, TrapMeasures]:
        """Of each trap."""
        return {name: trap_measures(TRAPS[name], results) for name, results in self.trapped.items()}


def track_variants(sequence: RenderedSequence, ideas: Iterable[Idea], config: StreamConfig) -> list[Variant]:
    """Track a sequence with all ideas, then with each of these switched off.

    Args:
        sequence: rendered.
        ideas: those to be switched off.
        config: the whole tracker's.
    """
    return [_variant(idea, sequence, config) for idea in (None, *ideas)]


def _variant(without: Idea | None, sequence: RenderedSequence, config: StreamConfig) -> Variant:
    tracker = create_tracker(config) if without is None else without.tracker(config)
    timed = TimedTracker(tracker, time.process_time)
    return Variant(run_sequence(sequence, timed), tuple(timed.milliseconds))


def ablation_record(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Everything measured, as JSON values, in the order of the outcomes."""
    return [
        {
            "without": outcome.idea and outcome.idea.without,
            "ms": outcome.ms,
            "measures": asdict(outcome.measures),
            "traps": {name: asdict(one) for name, one in outcome.traps.items()},
        }
        for outcome in outcomes
    ]


def changes(whole: Outcome, outcome: Outcome) -> tuple[list[str], list[str]]:
    """What is notably worse and what is notably better than with all ideas, in a few words each."""
    before, after = whole.measures, outcome.measures
    worse: list[str] = []
    better: list[str] = []

    def note(text: str, *, is_worse: bool) -> None:
        (worse if is_worse else better).append(text)

    refused = sum(bool(r.refused) for r in outcome.results) - sum(bool(r.refused) for r in whole.results)
    for name, more in (
        ("seeds refused", refused),
        ("silent", after.silent - before.silent),
        ("missing", after.missing - before.missing),
        ("degraded", after.degraded - before.degraded),
    ):
        if more:
            note(f"{name} {more:+d}", is_worse=more > 0)
    for name, attribute in (
        ("centre", "centre_mean_mm"),
        ("largest", "centre_max_mm"),
        ("TRE", "target_mean_mm"),
        ("TRE 95 %", "target_p95_mm"),
        ("2-D", "error_2d_mm"),
        ("model", "model_mm"),
    ):
        old, new = getattr(before, attribute), getattr(after, attribute)
        if old and new and abs(new - old) > max(NOTABLE.share * old, NOTABLE.mm):
            note(f"{name} {100.0 * (new / old - 1.0):+.0f} %", is_worse=new > old)
    if before.inside_95 and after.inside_95 and abs(after.inside_95 - before.inside_95) > NOTABLE.coverage:
        text = f"in 95 {100.0 * (after.inside_95 - before.inside_95):+.0f} points"
        note(text, is_worse=after.inside_95 < before.inside_95)
    if abs(outcome.ms / whole.ms - 1.0) > NOTABLE.time:
        note(f"time {100.0 * (outcome.ms / whole.ms - 1.0):+.0f} %", is_worse=outcome.ms > whole.ms)
    for text, is_worse in _trap_changes(whole, outcome):
        note(text, is_worse=is_worse)
    return worse, better


def _trap_changes(whole: Outcome, outcome: Outcome) -> Iterator[tuple[str, bool]]:
    """What is notably different in each trap, and whether it is worse."""
    after = outcome.traps
    for name, old in whole.traps.items():
        new = after[name]
        for kind, more in (
            ("seeds refused", new.refused - old.refused),
            ("silent", new.measures.silent - old.measures.silent),
            ("missing", new.measures.missing - old.measures.missing),
            ("unsaid", new.unsaid - old.unsaid),
        ):
            if more:
                yield f"{name}: {kind} {more:+d}", more > 0
        for kind, attribute in (("TRE", "target_mean_mm"), ("2-D", "error_2d_mm")):
            before, now = getattr(old.measures, attribute), getattr(new.measures, attribute)
            if before and now and abs(now - before) > max(NOTABLE.trap_share * before, NOTABLE.target_mm):
                yield f"{name}: {kind} {100.0 * (now / before - 1.0):+.0f} %", now > before


def format_ablation(outcomes: Sequence[Outcome]) -> str:
    """The table in Markdown; the first outcome is the whole tracker's."""
    whole = outcomes[0]
    head = ["switched off", "silent", "missing", "degraded", "centre", "largest", "TRE", "95 %", "2-D", "model"]
    head += ["in 68", "in 95", "sigma", "ms", "sequences worse / better"]
    head += ["traps: silent", "missing", "unsaid", "what is worse", "what is better"]
    lines = [_row(head), _row(["---"] * len(head))]
    idle = []
    for outcome in outcomes:
        one = outcome.measures
        name = "nothing" if outcome.idea is None else outcome.idea.without
        counts = [str(count) for count in (one.silent, one.missing, one.degraded)]
        lengths = [one.centre_mean_mm, one.centre_max_mm, one.target_mean_mm, one.target_p95_mm]
        lengths += [one.error_2d_mm, one.model_mm]
        cells = [name, *counts, *map(table_cell, lengths), percent(one.inside_68), percent(one.inside_95)]
        cells += [table_cell(one.sigma_mm), f"{outcome.ms:.1f}"]
        traps = outcome.traps.values()
        in_traps = [sum(trap.measures.silent for trap in traps), sum(trap.measures.missing for trap in traps)]
        in_traps.append(sum(trap.unsaid for trap in traps))
        if outcome is whole:
            lines.append(_row([*cells, "", *map(str, in_traps), "", ""]))
            continue
        worse, better = changes(whole, outcome)
        more, less = _by_sequence(whole, outcome)
        cells += [f"{more} / {less}", *map(str, in_traps)]
        lines.append(_row([*cells, ", ".join(worse) or "–", ", ".join(better) or "–"]))
        if not worse:
            idle.append(name)
    text = "\n".join(lines)
    if idle:
        text += "\n\nNothing is worse without: " + "; ".join(idle) + "."
    return text


def _by_sequence(whole: Outcome, outcome: Outcome) -> tuple[int, int]:
    """In how many sequences something is worse, in how many better: bad or missing poses first, then the TRE."""
    worse = better = 0
    for before, after in zip(whole.results, outcome.results, strict=True):
        old, new = measures(before.scores), measures(after.scores)
        wrong = (new.silent + new.missing) - (old.silent + old.missing)
        off = (new.target_mean_mm or 0.0) - (old.target_mean_mm or 0.0)
        worse += wrong > 0 or (wrong == 0 and off > NOTABLE.target_mm)
        better += wrong < 0 or (wrong == 0 and off < -NOTABLE.target_mm)
    return worse, better


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"
