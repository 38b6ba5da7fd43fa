"""`lasso-motion benchmark`: a benchmark that others can enter, written (`export`) and counted (`score`)."""

from __future__ import annotations

import argparse

from lasso_motion_ros.bench.benchmark.export import DEFAULT_SEED, DEFAULT_SEQUENCES, export_benchmark
from lasso_motion_ros.bench.benchmark.manifest import MANIFEST_FILE, OWNED, RECORDINGS
from lasso_motion_ros.bench.benchmark.score import score_benchmark
from lasso_motion_ros.bench.benchmark.score_tables import format_score, score_page, score_record
from lasso_motion_ros.bench.suite.clinic_tables import CLINIC_NOTE
from lasso_motion_ros.cli.archives import count
from lasso_motion_ros.cli.arguments import CommandParser
from lasso_motion_ros.cli.main import EXIT_DONE, EXIT_PART
from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.output_files import whole_directory, write_json
from lasso_motion_ros.reports.benchmark_report import BENCHMARK_FILES, write_benchmark_page
from lasso_motion_ros.tools.evaluation_runs import versions

HELP = "A benchmark that any tracker can enter: recordings without truth, truth apart, and a score."

EXPORT_HELP = """Render a versioned benchmark from the simulator of `suite --clinic`: recordings without truth, the
truth apart, card, licence and manifest. The same seed gives the same sequences."""

SCORE_HELP = """Score what trackers answered on a benchmark: MCAP with motion_with_covariance (or the tracker's own
results), or CSV (docs/benchmark.md). A folder is one tracker's, as are files of one folder that are named after
sequences (003.mcap); any other file is a tracker by itself. Exit status 3: something was answered in part."""


def add_arguments(parser: CommandParser) -> None:
    """Declare the command's own arguments."""
    parts = parser.add_subparsers(title="parts", metavar="export|score", required=True)
    export = parts.add_parser("export", help="render a benchmark into a directory", description=EXPORT_HELP)
    export.add_output("directory", directory=True, owned=OWNED, metavar="DIR", help="where")
    export.add_argument(
        "--sequences", type=int, default=DEFAULT_SEQUENCES, metavar="N", help="how many (default %(default)s)"
    )
    export.add_argument("--seed", type=int, default=DEFAULT_SEED, metavar="S", help="default %(default)s")
    export.add_argument("--workers", type=count, metavar="N", help="processes at a time (default: one a processor)")
    export.add_input(
        "--cache",
        metavar="DIR",
        help="keep what is rendered there (15 MB a sequence): an interrupted run goes on where it stopped",
    )
    score = parts.add_parser("score", help="score what trackers answered", description=SCORE_HELP)
    score.add_input("directory", metavar="DIR", help="an exported benchmark, with its truth")
    score.add_input("--result", fits=lambda word: True, metavar="FILES", help="files or folders; DIR stands before it")
    score.add_output("--json", metavar="FILE", help="write every measure, pair by pair")
    score.add_output("--report", directory=True, owned=BENCHMARK_FILES, metavar="DIR", help="write the page")
    for part, run_part in ((export, _export), (score, _score)):
        part.add_argument(
            "--quiet", action="store_true", default=argparse.SUPPRESS, help="print results and errors only"
        )
        part.set_defaults(run_part=run_part, parser=part)


def run(args: argparse.Namespace) -> int:
    """Export or score; returns the exit status."""
    status: int = args.run_part(args)
    return status


def _export(args: argparse.Namespace) -> int:
    manifest = export_benchmark(
        args.directory,
        seed=args.seed,
        sequences=args.sequences,
        cache=args.cache,
        workers=args.workers,
        quiet=args.quiet,
    )
    if not args.quiet:
        print(f"{args.directory}: {manifest.identity}, {len(manifest.sequences)} sequences, {manifest.pairs} pairs")
        print(f"for trackers: {args.directory / RECORDINGS}; digests of all files: {args.directory / MANIFEST_FILE}")
    return EXIT_DONE


def _score(args: argparse.Namespace) -> int:
    if not args.result:
        raise LassoMotionError("--result: name what a tracker answered, files or folders")
    score = score_benchmark(args.directory, args.result, quiet=args.quiet)
    print(format_score(score))
    if not args.quiet:
        print(CLINIC_NOTE)
    if args.json is not None:
        write_json(args.json, score_record(score))
    if args.report is not None:
        with whole_directory(args.report, BENCHMARK_FILES) as report:
            page = write_benchmark_page(report, score_page(score, versions()))
        if not args.quiet:
            print(f"\nreport: {args.report / page.name}")
    return EXIT_DONE if score.complete else EXIT_PART
