"""A recording's measures from those of its pairs, and the table to read (after the paper's Table 1)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.evaluation.measures import PairScore
from lasso_motion_ros.geometry.frames import Plane

Array = npt.NDArray[np.float64]
Values = Mapping[str, float | int | None]
Columns = tuple[tuple[str, Callable[[Values], str]], ...]

# Below these lies the squared Mahalanobis distance of 68 % and 95 % of normally distributed 3-D errors.
CHI_SQUARE_68, CHI_SQUARE_95 = 3.505882355768179, 7.814727903251179


@dataclass(frozen=True)
class Summary:
    """A recording's measures; None where the recording does not tell. Means leave the reference pair out.

    Attributes:
        pairs: pairs with truth.
        expected: pairs that show the lasso in its place after the reference.
        poses: poses published, the reference's left out.
        missing: expected pairs without a pose.
        lost_in_silence: poses that mislead: more than 2 mm off, or false.
        false_poses: poses while the lasso was hidden, gone or displaced.
        degraded_share: share of the poses that were DEGRADED.
        model_error_a_mm: 2-D error in the reference pair, plane A.
        model_error_b_mm: the same in plane B.
        error_2d_a_mm: mean 2-D error in plane A at the loop's depth.
        error_2d_a_sd_mm: its standard deviation.
        error_2d_b_mm: mean 2-D error in plane B.
        error_2d_b_sd_mm: its standard deviation.
        detector_error_a_mm: mean 2-D error in plane A on the detector.
        detector_error_b_mm: the same in plane B.
        centre_error_mm: mean distance of the loop's centre from the truth.
        centre_error_p95_mm: its 95th percentile.
        centre_constant_mm: length of the mean error vector.
        centre_jitter_mm: root mean square of the error about that mean.
        respiratory_error_mm: mean distance of the centre under `motion` from where breathing alone carries it.
        target_error_mm: mean target registration error.
        target_error_p95_mm: its 95th percentile over the pairs.
        static_error_mm: mean target error without compensation, in the pairs with a pose.
        removed_share: share of the static error that compensation removed.
        covariance_68_share: share of the centre's errors inside their 68 % ellipsoid.
        covariance_95_share: share inside the 95 % ellipsoid.
        centre_sigma_mm: mean square root of the covariance's trace.
    """

    pairs: int
    expected: int
    poses: int
    missing: int
    lost_in_silence: int | None
    false_poses: int
    degraded_share: float | None
    model_error_a_mm: float | None
    model_error_b_mm: float | None
    error_2d_a_mm: float | None
    error_2d_a_sd_mm: float | None
    error_2d_b_mm: float | None
    error_2d_b_sd_mm: float | None
    detector_error_a_mm: float | None
    detector_error_b_mm: float | None
    centre_error_mm: float | None
    centre_error_p95_mm: float | None
    centre_constant_mm: float | None
    centre_jitter_mm: float | None
    respiratory_error_mm: float | None
    target_error_mm: float | None
    target_error_p95_mm: float | None
    static_error_mm: float | None
    removed_share: float | None
    covariance_68_share: float | None
    covariance_95_share: float | None
    centre_sigma_mm: float | None


def summarise(scores: Sequence[PairScore]) -> Summary:
    """The measures of a recording from those of its pairs."""
    tracked = [score for score in scores if score.has_pose and not score.is_reference]
    model = [score for score in scores if score.has_pose and score.is_reference]

    def curve(plane: Plane, among: Sequence[PairScore], detector: bool = False) -> Array:
        per_pair = [score.error_detector_mm if detector else score.error_2d_mm for score in among]
        return np.array([errors[plane] for errors in per_pair if plane in errors])

    def values(*names: str) -> tuple[Array, ...]:
        rows = [tuple(getattr(score, name) for name in names) for score in tracked]
        rows = [row for row in rows if None not in row]
        return tuple(np.array([row[at] for row in rows], dtype=np.float64) for at in range(len(names)))

    vectors = np.array([score.centre_error_m for score in tracked if score.centre_error_m is not None]).reshape(-1, 3)
    centre = 1e3 * np.linalg.norm(vectors, axis=1)
    constant = vectors.mean(axis=0) if len(vectors) else np.zeros(3)
    jitter = np.sum((vectors - constant) ** 2, axis=1)
    target, static = values("target_error_mm", "static_error_mm")
    nees, sigma = values("nees", "centre_sigma_mm")
    judged = any(score.true_centre_m is not None or score.hidden for score in scores)
    mean_static = mean_of(static)
    return Summary(
        pairs=len(scores),
        expected=sum(score.expected for score in scores),
        poses=len(tracked),
        missing=sum(score.missing for score in scores),
        lost_in_silence=sum(score.lost_in_silence for score in scores) if judged else None,
        false_poses=sum(score.false_pose for score in scores),
        degraded_share=mean_of(np.array([score.state == "DEGRADED" for score in tracked])),
        model_error_a_mm=mean_of(curve("a", model)),
        model_error_b_mm=mean_of(curve("b", model)),
        error_2d_a_mm=mean_of(curve("a", tracked)),
        error_2d_a_sd_mm=_spread(curve("a", tracked)),
        error_2d_b_mm=mean_of(curve("b", tracked)),
        error_2d_b_sd_mm=_spread(curve("b", tracked)),
        detector_error_a_mm=mean_of(curve("a", tracked, detector=True)),
        detector_error_b_mm=mean_of(curve("b", tracked, detector=True)),
        centre_error_mm=mean_of(centre),
        centre_error_p95_mm=percentile_95(centre),
        centre_constant_mm=1e3 * float(np.linalg.norm(constant)) if len(vectors) else None,
        centre_jitter_mm=1e3 * float(np.sqrt(jitter.mean())) if len(vectors) else None,
        respiratory_error_mm=mean_of(values("respiratory_error_mm")[0]),
        target_error_mm=mean_of(target),
        target_error_p95_mm=percentile_95(target),
        static_error_mm=mean_static,
        removed_share=float(1.0 - target.mean() / mean_static) if mean_static else None,
        covariance_68_share=mean_of(nees <= CHI_SQUARE_68),
        covariance_95_share=mean_of(nees <= CHI_SQUARE_95),
        centre_sigma_mm=mean_of(sigma),
    )


def mean_of(values: npt.NDArray[np.float64] | npt.NDArray[np.bool_]) -> float | None:
    """The mean of an array (N,); None where it is empty."""
    return float(values.mean()) if values.size else None


def _spread(values: Array) -> float | None:
    return float(values.std()) if values.size else None


def percentile_95(values: Array) -> float | None:
    """The 95th percentile of an array (N,); None where it is empty."""
    return float(np.percentile(values, 95.0)) if values.size else None


def pair_record(score: PairScore) -> dict[str, Any]:
    """One pair's measures as JSON values: lists for vectors (metres), null where undefined."""
    record: dict[str, Any] = {}
    for name, value in asdict(score).items():
        record[name] = value.tolist() if isinstance(value, np.ndarray) else value
    record |= {
        "centre_error_mm": score.centre_error_mm,
        "missing": score.missing,
        "false_pose": score.false_pose,
        "lost_in_silence": score.lost_in_silence,
    }
    return record


def evaluation_record(recordings: Mapping[str, Sequence[PairScore]]) -> dict[str, Any]:
    """Everything measured, as JSON values: per recording its summary and its pairs, and the mean row.

    Args:
        recordings: the pairs' scores by the recording's name, in the order of the rows.
    """
    summaries = {name: summarise(scores) for name, scores in recordings.items()}
    return {
        "recordings": {
            name: {"summary": asdict(summaries[name]), "pairs": [pair_record(score) for score in scores]}
            for name, scores in recordings.items()
        },
        "mean": mean_row(list(summaries.values())),
    }


def mean_row(summaries: Sequence[Summary]) -> dict[str, float | int | None]:
    """Mean of every measure over the recordings that have it; counts of pairs are added up instead."""
    row: dict[str, float | int | None] = {}
    for name in (entry.name for entry in fields(Summary)):
        known = [value for value in (getattr(summary, name) for summary in summaries) if value is not None]
        if not known:
            row[name] = None
        elif name in COUNTS:
            row[name] = sum(known)
        else:
            row[name] = float(np.mean(known))
    return row


def format_table(summaries: Mapping[str, Summary], groups: Mapping[str, Sequence[str]] | None = None) -> str:
    """Two blocks of text, in the images and in space: one row a recording, then the means (counts are added up).

    Args:
        summaries: by the recording's name, in the order of the rows.
        groups: the rows that each mean is over, by the mean row's name; None: one mean over all rows, if several.
    """
    rows: list[tuple[str, Values]] = [(name, asdict(summary)) for name, summary in summaries.items()]
    if groups is None:
        groups = {MEAN_ROW: list(summaries)} if len(rows) > 1 else {}
    rows += [(name, mean_row([summaries[member] for member in members])) for name, members in groups.items()]
    return "\n\n".join(_block(title, columns, rows, len(summaries)) for title, columns in BLOCKS)


def _block(title: str, columns: Columns, rows: Sequence[tuple[str, Values]], recordings: int) -> str:
    lines = [[title, *(name for name, _ in columns)]]
    lines += [[name, *(cell(values) for _, cell in columns)] for name, values in rows]
    widths = [max(len(line[column]) for line in lines) for column in range(len(lines[0]))]
    text = []
    for number, line in enumerate(lines):
        if number in {1, recordings + 1}:
            text.append("-" * (sum(widths) + 2 * (len(widths) - 1)))
        cells = [part.rjust(width) for part, width in zip(line[1:], widths[1:], strict=True)]
        text.append("  ".join([line[0].ljust(widths[0]), *cells]))
    return "\n".join(text)


def _number(name: str, digits: int = 2) -> Callable[[Values], str]:
    def cell(values: Values) -> str:
        value = values[name]
        return "–" if value is None else f"{value:.{digits}f}"

    return cell


def _spread_cell(name: str) -> Callable[[Values], str]:
    def cell(values: Values) -> str:
        mean, spread = values[f"{name}_mm"], values[f"{name}_sd_mm"]
        return "–" if mean is None or spread is None else f"{mean:.2f} ± {spread:.2f}"

    return cell


def _percent(name: str) -> Callable[[Values], str]:
    def cell(values: Values) -> str:
        value = values[name]
        return "–" if value is None else f"{100 * value:.0f} %"

    return cell


MEAN_ROW = "mean (counts: sum)"
COUNTS = ("pairs", "expected", "poses", "missing", "lost_in_silence", "false_poses")
BLOCKS: tuple[tuple[str, Columns], ...] = (
    (
        "in the images, mm",
        (
            ("pairs", _number("pairs", 0)),
            ("2-D A", _spread_cell("error_2d_a")),
            ("2-D B", _spread_cell("error_2d_b")),
            ("model A", _number("model_error_a_mm")),
            ("model B", _number("model_error_b_mm")),
            ("missing", _number("missing", 0)),
            ("silent", _number("lost_in_silence", 0)),
            ("false", _number("false_poses", 0)),
            ("degraded", _percent("degraded_share")),
        ),
    ),
    (
        "in space, mm",
        (
            ("centre", _number("centre_error_mm")),
            ("constant", _number("centre_constant_mm")),
            ("jitter", _number("centre_jitter_mm")),
            ("TRE", _number("target_error_mm")),
            ("p95", _number("target_error_p95_mm")),
            ("static", _number("static_error_mm")),
            ("removed", _percent("removed_share")),
            ("in 68 %", _percent("covariance_68_share")),
            ("in 95 %", _percent("covariance_95_share")),
            ("sigma", _number("centre_sigma_mm")),
        ),
    ),
)
