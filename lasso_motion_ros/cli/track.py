"""`lasso-motion track`: a recording in, what the node would publish out; offline and deterministic."""

from __future__ import annotations

import argparse
import sys

from lasso_motion_ros.cli.arguments import CommandParser, add_remap, parse_remap
from lasso_motion_ros.cli.main import EXIT_DONE, EXIT_PART
from lasso_motion_ros.core.output_files import write_json
from lasso_motion_ros.tools.offline_tracking import DEFAULT_CONFIG, counts, describe, track_recording
from msg_adapters.seeds import CALIBRATION_HELP, SEEDS_HELP

HELP = """Follow the lasso through a recording, offline: the node's own tracker, without DDS and without a clock.
Writes the topics that the node would publish, at plane A's stamps; two runs write the same file."""


def add_arguments(parser: CommandParser) -> None:
    """Declare the command's own arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = f"{SEEDS_HELP}\n{CALIBRATION_HELP}"
    parser.add_input("recording", metavar="IN.mcap", help="recording: MCAP file or bag directory")
    parser.add_output("-o", "--output", required=True, metavar="OUT.mcap", help="file to write")
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
    summary = track_recording(
        args.recording,
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
