"""The report's tables and key figures: measures as text, with those marked that should be zero."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lasso_motion_ros.evaluation.axes import axis_errors
from lasso_motion_ros.evaluation.measures import PairScore
from lasso_motion_ros.evaluation.summary import Columns, Summary, Values

_BAD_UNLESS_ZERO = {"missing", "silent", "false"}


@dataclass(frozen=True)
class Fact:
    """A key figure at the top of the page."""

    name: str
    value: str
    is_bad: bool = False


@dataclass(frozen=True)
class Cell:
    """A cell of a table of measures."""

    text: str
    is_bad: bool = False


@dataclass(frozen=True)
class Row:
    """A row of a table of measures; `kind` is its style: empty, `mean` or `paper`."""

    name: str
    cells: Sequence[Cell]
    kind: str = ""


PAPER_ROW = Row(
    "Brost et al. 2009, clinical",
    [Cell(text) for text in ("231 frames", "1.0 ± 0.5", "1.0 ± 0.5", "0.6", "0.6")],
    "paper",
)


def key_figures(summary: Summary) -> list[Fact]:
    """The key figures of one result."""
    removed = "–" if summary.removed_share is None else f"{100 * summary.removed_share:.0f} %"
    errors_2d = f"{_millimetres(summary.error_2d_a_mm)}, {_millimetres(summary.error_2d_b_mm)}"
    return [
        Fact("2-D error A, B (mm)", errors_2d),
        Fact("target error (mm)", _millimetres(summary.target_error_mm)),
        Fact("static overlay (mm)", _millimetres(summary.static_error_mm)),
        Fact("removed", removed),
        Fact("lost in silence", _count(summary.lost_in_silence), bool(summary.lost_in_silence)),
        Fact("missing", _count(summary.missing), bool(summary.missing)),
    ]


def table_row(name: str, values: Values, columns: Columns, kind: str = "") -> Row:
    """A row of measures, one cell for each column."""
    texts = [(title, cell(values)) for title, cell in columns]
    cells = [Cell(text, title in _BAD_UNLESS_ZERO and text not in {"0", "–"}) for title, text in texts]
    return Row(name, cells, kind)


def axis_rows(scores: Sequence[PairScore]) -> list[tuple[str, ...]]:
    """Axis, static and residual error (rms), constant offset and jitter, mm; empty where no pair tells."""
    axes = axis_errors(scores)
    if axes is None:
        return []
    return [
        (
            name,
            f"{axes.static_mm[i]:.2f}",
            f"{axes.residual_mm[i]:.2f}",
            f"{axes.constant_mm[i]:+.2f}",
            f"{axes.jitter_mm[i]:.2f}",
        )
        for i, name in enumerate("xyz")
    ]


def _millimetres(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def _count(value: int | None) -> str:
    return "–" if value is None else str(value)
