"""`lasso-motion evaluate`: tracking against truth, one row a recording, like the paper's Table 1; the report."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from lasso_motion_ros.cli.archives import add_workers, worker_pool
from lasso_motion_ros.cli.arguments import CommandParser, is_archive
from lasso_motion_ros.cli.main import EXIT_DONE, EXIT_PART
from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.output_files import write_json
from lasso_motion_ros.core.share import share_file
from lasso_motion_ros.evaluation.evaluated import Evaluated, mean_groups, row_names
from lasso_motion_ros.evaluation.measures import DETECTOR_M
from lasso_motion_ros.evaluation.summary import evaluation_record, format_table, summarise
from lasso_motion_ros.reports.evaluation_report import REPORT_FILES
from lasso_motion_ros.tools.archive_evaluation import archived_results, is_result_folder, score_archive
from lasso_motion_ros.tools.archive_rows import write_table
from lasso_motion_ros.tools.evaluation_runs import evaluate_recordings, write_evaluation_report
from msg_adapters.recordings.recording_search import find_recordings, is_collection

HELP = """Score tracking against the truth in recordings. Without --result each recording is tracked first, offline; a
folder that track has filled with an archive's results is scored against the recordings that they were made of.
Millimetres are at the loop's depth; the reference pair gives the model error and is left out of the means."""

FOOTNOTE = """
2-D A, B: mean ± sd distance of the projected curve from the true centreline; model: the same in the reference pair;
centre: of the loop in 3-D, constant part and jitter apart; TRE: target registration error; static: uncompensated;
silent: poses more than 2 mm off or (false) without a lasso in its place; missing: pairs without a due pose;
in 68/95 %: centre errors inside that ellipsoid of the published covariance; sigma: its size."""

DEFAULT_CONFIG = "config/tracker.yaml"
DEFAULT_WORST = 3


def add_arguments(parser: CommandParser) -> None:
    """Declare the command's own arguments."""
    parser.add_input(
        "recordings",
        nargs="*",
        metavar="IN.mcap",
        help="recording with truth, a folder or pattern of some, or a folder of results",
    )
    parser.add_input(
        "--result",
        fits=lambda word: True,
        metavar="OUT.mcap",
        help="what the tracker published: several results of one recording, or one for each recording; the recordings"
        " stand before it",
    )
    parser.add_input(
        "--config",
        fits=lambda word: not names_recording(word),
        metavar="FILE",
        help=f"tracker parameters, several stand side by side (default: {DEFAULT_CONFIG})",
    )
    parser.add_argument(
        "--automatic", action="store_true", help="track without clicks: the ring is found, as in track --automatic"
    )
    add_workers(parser)
    parser.add_output("--json", metavar="FILE", help="write every measure, pair by pair")
    parser.add_output("--csv", metavar="FILE", help="write the summary, a row a result")
    parser.add_output(
        "--report",
        directory=True,
        owned=REPORT_FILES,
        metavar="DIR",
        help="write a page with tables, plots and pictures",
    )
    parser.add_argument(
        "--worst",
        type=int,
        default=DEFAULT_WORST,
        metavar="N",
        help="worst frames shown of each result in the report (default %(default)s)",
    )
    parser.add_argument(
        "--sid",
        type=float,
        default=DETECTOR_M,
        metavar="METRES",
        help="source-detector distance assumed for millimetres on the detector (default %(default)s)",
    )


def run(args: argparse.Namespace) -> int:
    """Evaluate; returns the exit status (0, or 3 where a recording was read in part, or left out)."""
    args.recordings = [one for path in args.recordings for one in _recordings(path)]
    _check(args)
    if any(is_result_folder(path) for path in args.recordings):
        return _archive(args)
    if is_archive(args):
        raise LassoMotionError(
            "--workers and --scheduler are for results of an archive: lasso-motion track IN … -o OUTDIR --workers N,"
            " then lasso-motion evaluate OUTDIR --workers N"
        )
    results, complete = evaluate_recordings(
        args.recordings,
        args.result,
        args.config or [share_file(DEFAULT_CONFIG)],
        args.sid,
        _say,
        quiet=args.quiet,
        automatic=args.automatic,
    )
    scores = dict(zip(row_names(results), (one.scores for one in results), strict=True))
    print(format_table({name: summarise(pairs) for name, pairs in scores.items()}, mean_groups(results)))
    if not args.quiet:
        print(FOOTNOTE)
    if args.json is not None:
        write_json(args.json, evaluation_record(scores))
    if args.csv is not None:
        write_table(args.csv, [{"name": name, **asdict(summarise(pairs))} for name, pairs in scores.items()])
    _report(args, results)
    return EXIT_DONE if complete else EXIT_PART


def _archive(args: argparse.Namespace) -> int:
    """Score the results of an archive."""
    if args.result or args.config or args.automatic:
        raise LassoMotionError("--result, --config and --automatic: an archive's results are scored as they are")
    results = archived_results(args.recordings, args.sid)
    scored = score_archive(results, worker_pool(args), _say, quiet=args.quiet)
    scores = {one.archived.name: one.scores for one in scored if one.scores}
    print(format_table({name: summarise(pairs) for name, pairs in scores.items()}))
    if not args.quiet:
        print(FOOTNOTE)
    if args.json is not None:
        write_json(args.json, evaluation_record(scores))
    if args.csv is not None:
        write_table(args.csv, [one.cells() for one in scored])
    if args.report is not None:
        _report(args, [one.evaluated() for one in scored if one.scores])
    return EXIT_PART if any(one.failure or one.damage for one in scored) else EXIT_DONE


def _report(args: argparse.Namespace, results: Sequence[Evaluated]) -> None:
    if args.report is None:
        return
    page = write_evaluation_report(args.report, results, args.worst, quiet=args.quiet)
    if not args.quiet:
        print(f"\nreport: {page}")


def _recordings(path: Path) -> list[Path]:
    """What a path stands for: itself, or the recordings of a folder or a pattern."""
    if is_result_folder(path) or not is_collection(path):
        return [path]
    return [found.path for found in find_recordings([path])]


def names_recording(word: str) -> bool:
    """Whether an argument is a recording: an MCAP file or a bag directory."""
    return word.endswith(".mcap") or Path(word).is_dir()


def _check(args: argparse.Namespace) -> None:
    recordings, results = len(args.recordings), len(args.result)
    if not recordings:
        raise LassoMotionError("no recording: name IN.mcap, and before --result, which takes every file behind it")
    if results and recordings > 1 and results != recordings:
        raise LassoMotionError(
            f"--result belongs to one recording, or there is one for each: found {results} for {recordings} recordings"
        )
    if results and args.config:
        raise LassoMotionError("--config is for tracking; with --result nothing is tracked")
    if results and args.automatic:
        raise LassoMotionError("--automatic is for tracking; with --result nothing is tracked")
    if not args.sid > 0.0:
        raise LassoMotionError(f"--sid must be positive, found {args.sid}")
    if args.worst < 0:
        raise LassoMotionError(f"--worst must not be negative, found {args.worst}")


def _say(line: str) -> None:
    print(f"lasso-motion evaluate: {line}", file=sys.stderr)
