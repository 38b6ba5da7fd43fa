"""`lasso-motion suite`: many short random sequences of the phantom, rendered, tracked and scored in memory."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from lasso_motion_ros.cli.main import EXIT_DONE
from lasso_motion_ros.cli.progress import progress
from lasso_motion_ros.configuration import ProductConfig, load_configuration
from lasso_motion_ros.errors import LassoMotionError, RecordingError
from lasso_motion_ros.share import share_file
from lasso_motion_ros.suite import DEFAULT_SEED, DEFAULT_SEQUENCES, suite_scenarios
from lasso_motion_ros.suite_report import format_report, suite_report
from lasso_motion_ros.suite_run import SequenceResult, render_sequence, run_sequence

HELP = """Track a suite of random phantom sequences (every orientation, dose, motion, calibration error, event) and
score it, per sequence and in all. The same seed gives the same sequences; each is rendered once for all
configurations."""

FOOTNOTE = """
mm; centre: of the ring in 3-D, mean and maximum; TRE: target registration error; 2-D: both planes, at its depth;
silent: poses more than 2 mm off or without a lasso in its place; missing: no pose though the lasso is in its place;
degr.: poses that were DEGRADED; in 68/95: centre errors inside that ellipsoid of the covariance; sigma: its size."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's own arguments."""
    parser.add_argument("--sequences", type=int, default=DEFAULT_SEQUENCES, metavar="N", help="default %(default)s")
    parser.add_argument("--seed", type=int, default=DEFAULT_SEED, metavar="S", help="default %(default)s")
    parser.add_argument("--only", type=int, nargs="+", metavar="K", help="only these sequences, by number")
    parser.add_argument(
        "--config", type=Path, nargs="+", metavar="FILE", help="tracker parameters (default: config/tracker.yaml)"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every measure, pair by pair")
    parser.add_argument("--report", type=Path, metavar="DIR", help="write tables and plots")


def run(args: argparse.Namespace) -> int:
    """Run the suite with every configuration."""
    if args.sequences < 1 or args.seed < 0:
        raise LassoMotionError("--sequences must be positive and --seed not negative")
    scenarios = suite_scenarios(args.seed, args.sequences)
    if args.only:
        beyond = [number for number in args.only if not 0 <= number < len(scenarios)]
        if beyond:
            raise LassoMotionError(f"--only: expected 0 to {len(scenarios) - 1}, found {beyond[0]}")
        scenarios = tuple(scenarios[number] for number in args.only)
    files = args.config or [share_file("config/tracker.yaml")]
    configs = {str(file): load_configuration(file, ProductConfig) for file in files}
    results: dict[str, list[SequenceResult]] = {name: [] for name in configs}
    for scenario in progress(scenarios, len(scenarios), "suite", args.quiet):
        sequence = render_sequence(scenario)
        for name, config in configs.items():
            results[name].append(run_sequence(sequence, config))
    for name, of_config in results.items():
        print(f"{Path(name).name}, seed {args.seed}\n{format_report(of_config)}\n")
    if not args.quiet:
        print(FOOTNOTE.lstrip())
    if args.json is not None:
        _write(args.json, json.dumps({Path(n).name: suite_report(r) for n, r in results.items()}, indent=1))
    if args.report is not None:
        _write_report(args.report, {Path(name).stem: of_config for name, of_config in results.items()})
    return EXIT_DONE


def _write_report(directory: Path, results: dict[str, list[SequenceResult]]) -> None:
    from lasso_motion_ros.rendering.plots import save_figure
    from lasso_motion_ros.rendering.suite_plots import suite_figure

    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"{directory}: cannot be made: {error.strerror}") from error
    for name, of_config in results.items():
        _write(directory / f"suite_{name}.txt", format_report(of_config) + "\n")
    save_figure(suite_figure(results), directory / "suite.png")


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {error.strerror}") from error
