"""A benchmark's page: one HTML file with the entries' tables and a figure, ready to be published.

The page's words and order are in `templates/benchmark_report.html.j2`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from lasso_motion_ros.core.output_files import write_text
from lasso_motion_ros.reports.comparison_figures import failures_figure
from lasso_motion_ros.reports.figure_panels import save_figure
from lasso_motion_ros.reports.page_templates import page_template
from lasso_motion_ros.reports.picture_files import embedded_png
from lasso_motion_ros.reports.report_tables import Row

BENCHMARK_PAGE, BENCHMARK_FIGURE = "benchmark.html", "benchmark.png"
BENCHMARK_FILES = (BENCHMARK_PAGE, BENCHMARK_FIGURE)
"""What a benchmark's report consists of."""
TEMPLATE = "benchmark_report.html.j2"


@dataclass(frozen=True)
class PageTable:
    """A table of measures.

    Attributes:
        titles: of its columns, that of the rows' names first.
        rows: in order.
    """

    titles: Sequence[str]
    rows: Sequence[Row]


@dataclass(frozen=True)
class BenchmarkPage:
    """What the page shows.

    Attributes:
        identity: of the benchmark: name, version, seed.
        sequences: how many it has.
        pairs: how many pairs.
        entries: a row for each entry, over all pairs.
        classes: a row for each event class and entry.
        shares: by entry and class, the share of wrong poses and of plain pairs without one, see `failures_figure`.
        labels: each event class in words, by its name.
        remarks: what entries lack.
        rendered_with: versions of what rendered the benchmark, by name.
        scored_with: versions of what scored it.
    """

    identity: str
    sequences: int
    pairs: int
    entries: PageTable
    classes: PageTable
    shares: Mapping[str, Mapping[str, tuple[float | None, float | None]]]
    labels: Sequence[tuple[str, str]]
    remarks: Sequence[str]
    rendered_with: Mapping[str, str]
    scored_with: Mapping[str, str]


def write_benchmark_page(directory: Path, page: BenchmarkPage) -> Path:
    """Write the page and its figure into an empty directory.

    Returns:
        The page's path.

    Raises:
        RecordingError: it cannot be written.
    """
    path, drawn = directory / BENCHMARK_PAGE, directory / BENCHMARK_FIGURE
    save_figure(failures_figure(page.shares), drawn)
    figure = embedded_png(drawn, "Shorter is better; a wrong pose is worse than none.")
    write_text(path, page_template(TEMPLATE).render(page=page, figure=figure))
    return path
