"""`lasso-motion evaluate`: tracking against truth, one row a recording, like the paper's Table 1."""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from lasso_motion_ros.cli.main import EXIT_DONE, EXIT_PART
from lasso_motion_ros.cli.progress import progress
from lasso_motion_ros.errors import LassoMotionError, RecordingError
from lasso_motion_ros.evaluation import DETECTOR_M, PairEstimate, PairScore, score_pairs
from lasso_motion_ros.evaluation_report import format_table, report, summarise
from msg_adapters.evaluation_input import read_estimates, read_truth

HELP = """Score tracking against the truth in recordings. Without --result each recording is tracked first, offline.
Millimetres are at the loop's depth; the reference pair gives the model error and is left out of the means."""

FOOTNOTE = """
2-D A, B: mean ± sd distance of the projected curve from the true centreline; model: the same in the reference pair;
centre: of the loop in 3-D, constant part and jitter apart; TRE: target registration error; static: uncompensated;
silent: poses more than 2 mm off or (false) without a lasso in its place; missing: pairs without a due pose;
in 68/95 %: centre errors inside that ellipsoid of the published covariance; sigma: its size."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's own arguments."""
    parser.add_argument("recordings", nargs="+", type=Path, metavar="IN.mcap", help="recording with truth")
    parser.add_argument("--result", type=Path, metavar="OUT.mcap", help="what the tracker published on the recording")
    parser.add_argument("--config", type=Path, metavar="FILE", help="tracker parameters (default: config/tracker.yaml)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every measure, pair by pair")
    parser.add_argument(
        "--sid",
        type=float,
        default=DETECTOR_M,
        metavar="METRES",
        help="source-detector distance assumed for millimetres on the detector (default %(default)s)",
    )


def run(args: argparse.Namespace) -> int:
    """Evaluate; returns the exit status (0, or 3 where a recording was only read in part)."""
    if args.result is not None and len(args.recordings) != 1:
        raise LassoMotionError(f"--result belongs to one recording, found {len(args.recordings)}")
    if args.result is not None and args.config is not None:
        raise LassoMotionError("--config is for tracking; with --result nothing is tracked")
    if not args.sid > 0.0:
        raise LassoMotionError(f"--sid must be positive, found {args.sid}")
    complete = True
    scores: dict[str, tuple[PairScore, ...]] = {}
    for recording in progress(args.recordings, len(args.recordings), "evaluating", args.quiet):
        read = read_truth(recording)
        if read.damage is not None:
            print(f"lasso-motion evaluate: {read.damage}", file=sys.stderr)
            complete = False
        estimates = _tracked(recording, args.config) if args.result is None else read_estimates(args.result)
        scores[_unused_name(recording, scores)] = score_pairs(read.truth, estimates, source_detector_m=args.sid)
    print(format_table({name: summarise(pairs) for name, pairs in scores.items()}))
    if not args.quiet:
        print(FOOTNOTE)
    if args.json is not None:
        write_json(args.json, scores)
    return EXIT_DONE if complete else EXIT_PART


def write_json(path: Path, scores: dict[str, tuple[PairScore, ...]]) -> None:
    """Write all measures of all recordings.

    Raises:
        RecordingError: the file cannot be written.
    """
    try:
        path.write_text(json.dumps(report(scores), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {error.strerror}") from error


def _tracked(recording: Path, config: Path | None) -> list[PairEstimate]:
    """What the offline tracker answers on a recording, by way of a file: what is scored is what gets written."""
    from lasso_motion_ros.cli.track import track_recording

    with tempfile.TemporaryDirectory(prefix="lasso_motion_") as directory:
        result = Path(directory) / "result.mcap"
        summary = track_recording(recording, result, config)
        if summary.statistics.poses == 0:
            # A table of dashes would leave the reader to guess.
            why = "; ".join(problem.text for problem in summary.problems)
            print(f"lasso-motion evaluate: {recording}: no pair got a pose: {why}", file=sys.stderr)
        return read_estimates(result)


def _unused_name(recording: Path, taken: Mapping[str, object]) -> str:
    """A row's name: the file's, or the whole path where two files share it."""
    return str(recording) if recording.stem in taken else recording.stem
