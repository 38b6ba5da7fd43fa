"""`lasso-motion track`: a recording in, what the node would publish out; offline and deterministic."""

from __future__ import annotations

import argparse
import sys

from lasso_motion_ros.cli.archives import ARCHIVE_HELP, add_workers, archive_files, only_recording, run_over_archive
from lasso_motion_ros.cli.arguments import CommandParser, add_remap, is_archive, parse_remap
from lasso_motion_ros.cli.main import EXIT_DONE, EXIT_PART
from lasso_motion_ros.config.parameters import load_configuration
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.core.output_files import write_json
from lasso_motion_ros.core.share import share_file
from lasso_motion_ros.tools.archive_tracking import TrackingWork
from lasso_motion_ros.tools.offline_tracking import DEFAULT_CONFIG, counts, describe, track_recording
from msg_adapters.recordings.recording_search import find_recordings
from msg_adapters.seeds import CALIBRATION_HELP, SEEDS_HELP

HELP = """Follow the lasso through a recording, offline: the node's own tracker, without DDS and without a clock.
Writes the topics that the node would publish, at plane A's stamps; two runs write the same file."""


def add_arguments(parser: CommandParser) -> None:
    """Declare the command's own arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = f"{SEEDS_HELP}\n{CALIBRATION_HELP}\n{ARCHIVE_HELP}"
    parser.add_input(
        "recordings", nargs="+", metavar="IN.mcap", help="recording: MCAP file or bag directory; folders with --workers"
    )
    parser.add_output(
        "-o",
        "--output",
        many=archive_files(".mcap"),
        required=True,
        metavar="OUT.mcap",
        help="file to write; with --workers or --scheduler a folder",
    )
    add_workers(parser)
    parser.add_input("--config", metavar="FILE", help=f"parameters (default: {DEFAULT_CONFIG})")
    parser.add_input("--seeds", metavar="FILE", help="clicks, for a recording without (or instead)")
    parser.add_argument(
        "--automatic",
        action="store_true",
        help="no clicks: the first pair that shows the ring well is the seed pair; recorded clicks are not heard",
    )
    parser.add_input("--calibration", metavar="FILE", help="projections, for a recording without")
    add_remap(parser, "read the recorded topic FROM as TO (/cath/frontal:=/plane_a/image_raw)")
    parser.add_output("--json", metavar="FILE", help="write the counts of pairs, poses, states, problems")


def run(args: argparse.Namespace) -> int:
    """Track; returns the exit status (3 where the recording could be read in part only)."""
    if is_archive(args):
        return _archive(args)
    summary = track_recording(
        only_recording(args.recordings),
        args.output,
        args.config,
        seeds=args.seeds,
        calibration=args.calibration,
        remap=parse_remap(args.remap),
        overwrite=args.overwrite,
        quiet=args.quiet,
        automatic=args.automatic,
    )
    for line in summary.problem_lines:
        print(f"lasso-motion track: {line}", file=sys.stderr)
    if summary.damage is not None:
        print(f"lasso-motion track: {summary.damage}", file=sys.stderr)
    if not args.quiet:
        for line in summary.remark_lines:
            print(line)
        print(f"{args.output}: {describe(summary.statistics)}")
    if args.json is not None:
        write_json(args.json, counts(summary))
    return EXIT_DONE if summary.damage is None else EXIT_PART


def _archive(args: argparse.Namespace) -> int:
    if args.automatic and args.seeds is not None:
        raise ConfigurationError("clicks from a file and a ring that is found without them exclude each other")
    config = load_configuration(args.config or share_file(DEFAULT_CONFIG), StreamConfig)
    seeds, calibration = (None if path is None else path.absolute() for path in (args.seeds, args.calibration))
    remap = parse_remap(args.remap)
    named = [
        (
            TrackingWork(found.path, config, seeds, calibration, remap, args.automatic),
            str(found.path),
            f"{found.name}.mcap",
        )
        for found in find_recordings(args.recordings, without=[args.output])
    ]
    return run_over_archive(args, named, "tracking")
