"""`lasso-motion evaluate`: tracking against truth, one row a recording, like the paper's Table 1; the report."""

from __future__ import annotations

import argparse
import platform
import sys
from collections.abc import Sequence
from importlib.metadata import version as installed_version
from pathlib import Path

import cv2
import numpy as np

from lasso_motion_ros.cli.arguments import CommandParser
from lasso_motion_ros.cli.main import EXIT_DONE, EXIT_PART
from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.output_files import write_json
from lasso_motion_ros.core.progress import progress
from lasso_motion_ros.core.share import share_file, version
from lasso_motion_ros.evaluation.evaluated import Evaluated, mean_groups, row_names
from lasso_motion_ros.evaluation.measures import DETECTOR_M
from lasso_motion_ros.evaluation.recorded_input import read_truth
from lasso_motion_ros.evaluation.summary import format_table, report, summarise
from lasso_motion_ros.tools.evaluation_runs import evaluated_file, evaluated_tracking, worst_frames

HELP = """Score tracking against the truth in recordings. Without --result each recording is tracked first, offline.
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
    parser.add_argument("recordings", nargs="*", type=Path, metavar="IN.mcap", help="recording with truth")
    parser.add_several(
        "--result",
        lambda word: True,
        type=Path,
        metavar="OUT.mcap",
        help="what the tracker published: several results of one recording, or one for each recording; the recordings"
        " stand before it",
    )
    parser.add_several(
        "--config",
        lambda word: not names_recording(word),
        type=Path,
        metavar="FILE",
        help=f"tracker parameters, several stand side by side (default: {DEFAULT_CONFIG})",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every measure, pair by pair")
    parser.add_argument("--report", type=Path, metavar="DIR", help="write a page with tables, plots and pictures")
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
    """Evaluate; returns the exit status (0, or 3 where a recording was only read in part)."""
    _check(args)
    one_by_one = len(args.recordings) > 1
    complete = True
    results: list[Evaluated] = []
    for number, recording in enumerate(
        progress(args.recordings, len(args.recordings), "evaluating", args.quiet or not one_by_one)
    ):
        read = read_truth(recording)
        if read.damage is not None:
            print(f"lasso-motion evaluate: {read.damage}", file=sys.stderr)
            complete = False
        name = _unused_name(recording, {one.recording for one in results})
        if args.result:
            files = [args.result[number]] if one_by_one else args.result
            for file, result in zip(files, _distinct(files), strict=True):
                results.append(evaluated_file(name, recording, read, file, result, args.sid))
        else:
            files = args.config or [share_file(DEFAULT_CONFIG)]
            for file, result in zip(files, _distinct(files), strict=True):
                quiet = args.quiet or one_by_one
                results.append(evaluated_tracking(name, recording, read, file, result, args.sid, quiet))
    scores = dict(zip(row_names(results), (one.scores for one in results), strict=True))
    print(format_table({name: summarise(pairs) for name, pairs in scores.items()}, mean_groups(results)))
    if not args.quiet:
        print(FOOTNOTE)
    if args.json is not None:
        write_json(args.json, report(scores))
    if args.report is not None:
        page = _write_report(args.report, results, args.worst, args.quiet)
        if not args.quiet:
            print(f"\nreport: {page}")
    return EXIT_DONE if complete else EXIT_PART


def names_recording(word: str) -> bool:
    """Whether an argument is a recording: an MCAP file or a bag directory."""
    return word.endswith(".mcap") or Path(word).is_dir()


def versions() -> dict[str, str]:
    """What figures were made with, by name."""
    return {
        "lasso_motion_ros": version(),
        "Python": platform.python_version(),
        "numpy": np.__version__,
        "SciPy": installed_version("scipy"),
        "OpenCV": cv2.__version__,
        "machine": f"{platform.system()} {platform.machine()}",
    }


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
    if not args.sid > 0.0:
        raise LassoMotionError(f"--sid must be positive, found {args.sid}")
    if args.worst < 0:
        raise LassoMotionError(f"--worst must not be negative, found {args.worst}")


def _write_report(directory: Path, results: Sequence[Evaluated], count: int, quiet: bool) -> Path:
    from lasso_motion_ros.reports.evaluation_report import write_report

    worst = [worst_frames(one, count) for one in progress(results, len(results), "worst frames", quiet)]
    return write_report(
        directory, results, worst, versions(), lambda numbers: progress(numbers, len(numbers), "plots", quiet)
    )


def _distinct(files: Sequence[Path]) -> list[str]:
    """A name for each file beside the others: its stem where that tells them apart, else its whole path."""
    stems = [file.stem for file in files]
    return stems if len(set(stems)) == len(stems) else [str(file) for file in files]


def _unused_name(recording: Path, taken: set[str]) -> str:
    """A recording's name: the file's, or the whole path where two files share it."""
    return str(recording) if recording.stem in taken else recording.stem
