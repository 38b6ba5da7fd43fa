"""The clinic suite's table: what a tracker is worth in each event class."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from lasso_motion_ros.bench.suite.clinic_classes import CLASSES
from lasso_motion_ros.bench.suite.clinic_runs import ClinicResult
from lasso_motion_ros.bench.suite.judged_scores import JudgedScores, begun_classes
from lasso_motion_ros.bench.suite.suite_measures import measures
from lasso_motion_ros.bench.suite.suite_tables import percent, table_cell, text_table
from lasso_motion_ros.evaluation.measures import PairScore
from lasso_motion_ros.evaluation.summary import pair_record

ALL = "all pairs"

CLINIC_NOTE = """
mm; a pair of two classes counts in both, one before its class has begun for the core; plain: due pairs in which both
planes plainly show the true electrodes; wrong: poses more than 2 mm off, or with the ring hidden, gone or displaced;
missing: plain pairs without a pose; in 68/95: centre errors inside that ellipsoid of the covariance; NEES: mean of
the centre's normalised error squared, 3 if the covariance is true; centre: of the ring in 3-D; TRE: target
registration error."""
"""What stands under such a table."""


@dataclass(frozen=True)
class ClassMeasures:
    """What a tracker made of one event class; a pair of two classes counts in both. None: nothing to measure.

    Attributes:
        sequences: that have the class.
        refused: of these, whose seed was refused.
        pairs: after the reference.
        plain: of these, due ones in which both planes plainly show the ring.
        poses: published.
        wrong: poses more than 2 mm off, or with the ring hidden, gone or displaced.
        missing: pairs of `plain` without a pose.
        inside_68: share of the centre's errors inside their 68 % ellipsoid.
        inside_95: inside the 95 % ellipsoid.
        nees: mean normalised error squared of the centre (3 if the covariance is true).
        centre_mm: mean error of the ring's centre.
        target_mm: mean target registration error.
    """

    sequences: int
    refused: int
    pairs: int
    plain: int
    poses: int
    wrong: int
    missing: int
    inside_68: float | None
    inside_95: float | None
    nees: float | None
    centre_mm: float | None
    target_mm: float | None


def class_measures(results: Sequence[JudgedScores]) -> dict[str, ClassMeasures]:
    """Measures by event class, in the table's order, and of all pairs."""
    rows = {}
    for name in (*CLASSES, ALL):
        pairs = [
            (score, plain)
            for one in results
            for score, plain in zip(one.scores, one.plain, strict=True)
            if not score.is_reference and (name == ALL or name in begun_classes(one.since, score.index))
        ]
        having = [one for one in results if name == ALL or name in one.since]
        if pairs:
            rows[name] = _measured(pairs, len(having), sum(one.refused for one in having))
    return rows


def _measured(pairs: Sequence[tuple[PairScore, bool]], sequences: int, refused: int) -> ClassMeasures:
    scores = [score for score, _ in pairs]
    shown = [score for score, plain in pairs if plain and score.expected]
    together = measures(scores)
    nees = np.array([score.nees for score in scores if score.nees is not None])
    return ClassMeasures(
        sequences=sequences,
        refused=refused,
        pairs=len(scores),
        plain=len(shown),
        poses=together.poses,
        wrong=together.silent,
        missing=sum(score.missing for score in shown),
        inside_68=together.inside_68,
        inside_95=together.inside_95,
        nees=float(nees.mean()) if nees.size else None,
        centre_mm=together.centre_mean_mm,
        target_mm=together.target_mean_mm,
    )


def format_clinic(
    found: Mapping[str, Mapping[str, ClassMeasures]], kind: str = "config", unstarted: str = "seeds refused"
) -> str:
    """The table for people: a line for every class and configuration.

    Args:
        found: measures by configuration and class.
        kind: what is compared, the column's title.
        unstarted: what is said of sequences in which the tracker did not start.
    """
    head = ["class", kind, "seq.", "pairs", "plain", "poses", "wrong", "missing", "in 68", "in 95", "NEES"]
    lines = [[*head, "centre", "TRE", ""]]
    names = [name for name in (*CLASSES, ALL) if any(name in of for of in found.values())]
    for name in names:
        for config, by_class in found.items():
            one = by_class[name]
            counts = [one.sequences, one.pairs, one.plain, one.poses, one.wrong, one.missing]
            label = CLASSES[name].label if name in CLASSES else ""
            refused = f"; {one.refused} {unstarted}" if one.refused else ""
            nees = "–" if one.nees is None else f"{one.nees:.3g}"
            cells = [name, config, *map(str, counts), percent(one.inside_68), percent(one.inside_95), nees]
            cells += [table_cell(one.centre_mm), table_cell(one.target_mm)]
            lines.append([*cells, (label + refused).lstrip("; ")])
    return text_table(lines)


def clinic_record(results: Sequence[ClinicResult]) -> dict[str, Any]:
    """Everything measured with one configuration, as JSON values."""
    return {
        "classes": {name: asdict(one) for name, one in class_measures([one.judged for one in results]).items()},
        "sequences": [
            {
                "name": one.drawn.scenario.name,
                "description": one.drawn.scenario.description,
                "since": dict(one.drawn.since),
                "refused": one.result.refused,
                "pairs": [_pair(one, score) for score in one.result.scores],
            }
            for one in results
        ],
    }


def _pair(one: ClinicResult, score: PairScore) -> dict[str, Any]:
    reasons = one.result.reasons
    return pair_record(score) | {
        "classes": sorted(one.drawn.classes(score.index)),
        "plain": one.plain[score.index],
        "reason": reasons[score.index] if score.index < len(reasons) else "",
    }
