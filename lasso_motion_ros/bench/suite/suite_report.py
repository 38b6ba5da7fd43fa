"""What the suite leaves in a directory: tables as text, and figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from lasso_motion_ros.bench.suite.sequence import SequenceResult
from lasso_motion_ros.bench.suite.suite_measures import Measures
from lasso_motion_ros.bench.suite.suite_tables import format_suite, format_sweep
from lasso_motion_ros.bench.suite.sweeps import SWEEPS
from lasso_motion_ros.core.output_files import write_text


def write_suite_report(directory: Path, results: Mapping[str, Sequence[SequenceResult]]) -> None:
    """Write a table for each configuration, and one figure.

    Args:
        directory: where; it must be there.
        results: by the configuration's name.

    Raises:
        RecordingError: a file cannot be written.
    """
    from lasso_motion_ros.bench.suite.suite_figures import suite_figure
    from lasso_motion_ros.reports.figure_panels import save_figure

    for name, of_config in results.items():
        write_text(directory / f"suite_{name}.txt", format_suite(of_config) + "\n")
    save_figure(suite_figure(results), directory / "suite.png")


def write_sweeps_report(directory: Path, found: Mapping[str, Mapping[str, Mapping[float, Measures]]]) -> None:
    """Write the tables of all sweeps, and one figure.

    Args:
        directory: where; it must be there.
        found: measures by name of the sweep, configuration and value.

    Raises:
        RecordingError: a file cannot be written.
    """
    from lasso_motion_ros.bench.suite.suite_figures import sweeps_figure
    from lasso_motion_ros.reports.figure_panels import save_figure

    tables = [format_sweep(SWEEPS[name], of_sweep) for name, of_sweep in found.items()]
    write_text(directory / "sweeps.txt", "\n\n".join(tables) + "\n")
    capture = [sweep.label for sweep in SWEEPS.values() if sweep.is_capture]
    figure = sweeps_figure({SWEEPS[name].label: one for name, one in found.items()}, capture)
    save_figure(figure, directory / "sweeps.png")
