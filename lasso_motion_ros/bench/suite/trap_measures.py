"""Results on the traps: counted as in the suite, except for what a trap does not ask, or asks in addition."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from lasso_motion_ros.bench.suite.sequence import SequenceResult
from lasso_motion_ros.bench.suite.state_strips import StateStrip, format_strips, state_strip
from lasso_motion_ros.bench.suite.suite_measures import Measures, measures
from lasso_motion_ros.bench.suite.suite_tables import percent, table_cell, text_table
from lasso_motion_ros.bench.suite.traps import TRAPS, Trap
from lasso_motion_ros.evaluation.measures import PairScore
from lasso_motion_ros.phantom import Scenario
from lasso_motion_ros.tracking.tracker import TrackerState

SHOWN_STATES = (TrackerState.TRACKING, TrackerState.DEGRADED, TrackerState.LOST, TrackerState.DISPLACED)


@dataclass(frozen=True)
class TrapMeasures:
    """Measures of a trap's sequences taken together.

    Attributes:
        measures: as in the suite; where no pose is due, none is missing.
        refused: seeds that were refused.
        unsaid: poses said to be TRACKING where doubt is due.
        absent: pairs with the lasso hidden, gone or displaced; displaced it is, too, where the C-arm moved unsaid so
            far that the loop is seen more than 3 mm from where the published geometry has it.
        false_poses: poses among these.
        states: pairs by state.
        strips: of each sequence, its states pair by pair.
    """

    measures: Measures
    refused: int
    unsaid: int
    absent: int
    false_poses: int
    states: Mapping[str, int]
    strips: tuple[StateStrip, ...]


def trap_measures(trap: Trap, results: Sequence[SequenceResult]) -> TrapMeasures:
    """What a tracker made of a trap's sequences."""
    scores = [score for result in results for score in _asked(trap, result)]
    after = [score for score in scores if not score.is_reference]
    return TrapMeasures(
        measures=measures(scores),
        refused=sum(bool(result.refused) for result in results),
        unsaid=sum(_is_unsaid(trap, score, result.scenario) for result in results for score in result.scores),
        absent=sum(score.hidden or score.displaced for score in after),
        false_poses=sum(score.false_pose for score in after),
        states=dict(Counter(score.state for score in after)),
        strips=tuple(state_strip(_asked(trap, result), refused=bool(result.refused)) for result in results),
    )


def traps_record(found: Mapping[str, Mapping[str, TrapMeasures]]) -> dict[str, Any]:
    """Measures by name of the trap and of the configuration, as JSON values."""
    return {trap: {config: asdict(one) for config, one in by_config.items()} for trap, by_config in found.items()}


def format_traps(found: Mapping[str, Mapping[str, TrapMeasures]]) -> str:
    """As text: a table with a line for every trap and configuration, and the course of every sequence.

    Args:
        found: measures by name of the trap and of the configuration.
    """
    strips = [
        (f"{trap} {number} {config}", strip)
        for trap, by_config in found.items()
        for config, one in by_config.items()
        for number, strip in enumerate(one.strips)
    ]
    return f"{_table(found)}\n\n{format_strips(strips)}"


def _table(found: Mapping[str, Mapping[str, TrapMeasures]]) -> str:
    head = ["trap", "config", "pairs", "silent", "missing", "unsaid", "false poses", "centre", "max", "TRE", "in 95"]
    lines = [[*head, *(state.value for state in SHOWN_STATES), ""]]
    for name, by_config in found.items():
        trap = TRAPS[name]
        for config, one in by_config.items():
            all_pairs = one.measures
            missing = "–" if not trap.pose_due and not all_pairs.missing else str(all_pairs.missing)
            cells = [name, config, str(all_pairs.pairs), str(all_pairs.silent), missing]
            cells += [str(one.unsaid) if trap.doubt_due else "–"]
            cells += [f"{one.false_poses}/{one.absent}" if one.absent else "–"]
            cells += map(table_cell, (all_pairs.centre_mean_mm, all_pairs.centre_max_mm, all_pairs.target_mean_mm))
            cells += [percent(all_pairs.inside_95), *(str(one.states.get(state.value, 0)) for state in SHOWN_STATES)]
            refused = f"; {one.refused} seeds refused" if one.refused else ""
            lines.append([*cells, trap.label + refused])
    return text_table(lines)


def _asked(trap: Trap, result: SequenceResult) -> tuple[PairScore, ...]:
    """The scores, with no pose expected where the trap asks none."""
    if trap.pose_due:
        return result.scores
    first = _first_pair(result.scenario)
    return tuple(
        dataclasses.replace(score, expected=False) if score.index >= first else score for score in result.scores
    )


def _is_unsaid(trap: Trap, score: PairScore, scenario: Scenario) -> bool:
    after = not score.is_reference and score.index >= _first_pair(scenario)
    return trap.doubt_due and after and score.has_pose and score.state == TrackerState.TRACKING.value


def _first_pair(scenario: Scenario) -> int:
    """From which on a trap holds: its event, or the first."""
    return min((event.first for event in scenario.events), default=0)
