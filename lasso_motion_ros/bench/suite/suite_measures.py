"""The suite's measures: of one sequence or of many, and the states against the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.bench.suite.sequence import SequenceResult
from lasso_motion_ros.evaluation.measures import PairScore
from lasso_motion_ros.evaluation.summary import CHI_SQUARE_68, CHI_SQUARE_95, mean_of, percentile_95
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
