"""`lasso-motion render`: the overlay offline, as video or as frames, from a recording and a tracker's result."""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict
from pathlib import Path

from lasso_motion_ros.cli.archives import add_workers, archive_files, run_over_archive
from lasso_motion_ros.cli.arguments import CommandParser, add_remap, is_archive, parse_remap
from lasso_motion_ros.cli.main import EXIT_DONE, EXIT_PART
from lasso_motion_ros.cli.overlay_arguments import DEFAULT_CONFIG, add_overlay_arguments, overlay_configuration
from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.output_files import write_json
from lasso_motion_ros.reports.offline_overlay import OVERLAY_VIEWS
from lasso_motion_ros.tools.archive_rows import DONE, needed_rows
from lasso_motion_ros.tools.archive_work import RenderWork
from lasso_motion_ros.tools.rendering import FRAMES, is_video, render_recording

HELP = """Draw the overlay over a recording, offline, with the motion of a tracker's result: what the overlay node draws
live. OUT.mp4 becomes a video of both planes, any other name a directory of PNG frames, one a plane and pair."""


def add_arguments(parser: CommandParser) -> None:
    """Declare the command's own arguments."""
    parser.add_input(
        "recording",
        metavar="IN.mcap",
        help="recording with the images; with --workers a folder that track has filled with an archive's results",
    )
    parser.add_input("result", nargs="?", metavar="RESULT.mcap", help="what a tracker published on it")
    add_overlay_arguments(parser, required=True)
    parser.add_output(
        "-o",
        "--output",
        directory=lambda path: not is_video(path),
        owned=FRAMES,
        many=archive_files(".mp4"),
        required=True,
        metavar="OUT",
        help="OUT.mp4, or a directory; with --workers or --scheduler a directory with a video of each",
    )
    add_workers(parser)
    parser.add_argument(
        "--view",
        choices=OVERLAY_VIEWS,
        default="compensated",
        help="both: static and compensated side by side (default %(default)s)",
    )
    parser.add_input("--config", metavar="FILE", help=f"overlay parameters (default: {DEFAULT_CONFIG})")
    parser.add_argument("--rate", type=float, metavar="FPS", help="of the video (default: the recording's own)")
    parser.add_output("--json", metavar="FILE", help="write what was drawn, pair by pair")
    add_remap(parser, "read the recorded topic FROM as TO")


def run(args: argparse.Namespace) -> int:
    """Render; returns the exit status (3 where the recording could be read in part only)."""
    video = is_archive(args) or is_video(args.output)
    if args.rate is not None and not video:
        raise LassoMotionError("--rate is for a video: name the output OUT.mp4")
    if args.rate is not None and not args.rate > 0.0:
        raise LassoMotionError(f"--rate must be positive, found {args.rate}")
    if is_archive(args):
        return _archive(args)
    if args.result is None:
        raise LassoMotionError("no result: name IN.mcap and RESULT.mcap, or a folder of results with --workers N")
    config = overlay_configuration(args)
    say = (lambda line: None) if args.quiet else print
    summary = render_recording(
        args.recording,
        args.result,
        args.output,
        config,
        say,
        view=args.view,
        rate_hz=args.rate,
        remap=parse_remap(args.remap),
        quiet=args.quiet,
    )
    for line in summary.problems:
        print(f"lasso-motion render: {line}", file=sys.stderr)
    count = len(summary.pairs)
    if not args.quiet:
        print(
            f"{args.output}: {count} pairs, {summary.compensated} compensated, "
            f"{count - summary.compensated} static only"
        )
    if args.json is not None:
        pairs = [asdict(pair) for pair in summary.pairs]
        write_json(args.json, {"shown": summary.shown, "compensated": summary.compensated, "pairs": pairs})
    if summary.damage is not None:
        print(f"lasso-motion render: {summary.damage}", file=sys.stderr)
        return EXIT_PART
    return EXIT_DONE


def _archive(args: argparse.Namespace) -> int:
    """A video of each result of an archive."""
    if args.result is not None:
        raise LassoMotionError("--workers and --scheduler: name the folder of results alone; it tells the recordings")
    args.volume = str(Path(args.volume).absolute())
    if args.registration is not None and Path(args.registration).is_file():
        args.registration = str(Path(args.registration).absolute())
    config, remap = overlay_configuration(args), parse_remap(args.remap)
    folder = args.recording.absolute()
    named = [
        (
            RenderWork(Path(row.recording), folder / row.result, config, args.view, args.rate, remap),
            row.recording,
            str(Path(row.result).with_suffix(".mp4")),
        )
        for row in needed_rows(folder)
        if row.status == DONE
    ]
    return run_over_archive(args, named, "rendering")
