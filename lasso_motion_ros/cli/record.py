"""`lasso-motion record`: record a live graph so that a crash costs little; repair a recording that was cut short."""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from lasso_motion_ros.cli.arguments import CommandParser, not_negative
from lasso_motion_ros.cli.main import EXIT_BAD_INPUT, EXIT_DONE, EXIT_PART
from lasso_motion_ros.core.errors import LassoMotionError, RecordingError
from lasso_motion_ros.core.output_checks import check_free
from lasso_motion_ros.core.output_files import EarlierFile, write_json
from lasso_motion_ros.core.progress import busy, counting
from lasso_motion_ros.core.signals import held_signals
from lasso_motion_ros.nodes.ros_start import require_ros
from lasso_motion_ros.tools.listened_topics import lacking_topics, live_topics, stand_ins
from msg_adapters.recordings.repair import repair_recording
from msg_adapters.recordings.writer import RecordingWriter

if TYPE_CHECKING:
    from lasso_motion_ros.tools.recorder import RecordSummary

HELP = """Record the tracker's inputs and outputs (images, calibrations, clicks, motion, state, diagnostics, truth where
it is published) as they come over the wire, until Ctrl-C. Every half second all of it is handed to the operating
system: killed at any moment, the file is read by our commands up to there, and --repair makes it whole for other
readers. Exit status: 0 done; 2 nothing came, or the file cannot be written; 3 recorded, but messages were lost."""


def add_arguments(parser: CommandParser) -> None:
    """Declare the command's arguments."""
    what = parser.add_mutually_exclusive_group(required=True)
    parser.add_output("output", group=what, nargs="?", metavar="OUT.mcap", help="the recording to write")
    parser.add_input(
        "--repair", group=what, metavar="FILE", help="write index, summary and footer of a recording that was cut short"
    )
    # A topic's name has no dot, which OUT.mcap has.
    parser.add_several("--topics", lambda word: "." not in word, metavar="NAME", help="record these too")
    parser.add_argument(
        "--namespace", default="", metavar="NS", help="of the nodes (/lab); it is left out of the recorded names"
    )
    parser.add_argument("--duration", type=not_negative, metavar="S", help="end after S seconds")
    parser.add_argument(
        "--compression", choices=("none", "zstd"), default="none", help="zstd halves the file and costs a core"
    )
    parser.add_output("--json", metavar="FILE", help="write what was recorded, lost and dropped")


def run(args: argparse.Namespace) -> int:
    """Record, or repair, and say what is in the file."""
    if args.repair is not None:
        return _repair(args)
    require_ros()
    summary = _record(args)
    if args.json is not None:
        figures = {"messages": summary.counts, "seconds": summary.seconds, "lost": summary.lost}
        write_json(args.json, {**figures, "dropped": dict(summary.dropped), "left_out": summary.left_out})
    if not args.quiet:
        _print_counts(args.output, summary.counts, summary.seconds)
    for topic, type_name in summary.left_out.items():
        print(f"lasso-motion record: left out {topic}: {type_name} is not installed", file=sys.stderr)
    if missing := lacking_topics([name for name, count in summary.counts.items() if count]):
        print(f"lasso-motion record: nothing came on {', '.join(missing)}", file=sys.stderr)
    for topic, count in summary.lost.items():
        print(
            f"lasso-motion record: {topic}: {count} messages were published and did not come; publish reliably, or"
            " with the profile config/fastdds.xml",
            file=sys.stderr,
        )
    for topic, count in summary.dropped.items():
        print(f"lasso-motion record: {topic}: {count} messages dropped, the disk is too slow", file=sys.stderr)
    return EXIT_PART if summary.lost or summary.dropped else EXIT_DONE


def _record(args: argparse.Namespace) -> RecordSummary:
    """Record in place, for a crash at any moment; an earlier recording goes only when the new one is done."""
    from lasso_motion_ros.tools.recorder import record

    with held_signals() as interrupted:
        check_free(args.output, args.overwrite)  # again: another recorder may have begun there since
        earlier = EarlierFile(args.output)
        written = 0
        try:
            with RecordingWriter(args.output, compression=args.compression) as writer:
                if not args.quiet:
                    print(f"recording into {args.output}; Ctrl-C ends it", flush=True)
                try:
                    with counting("recorded", args.quiet) as show:
                        topics = live_topics(args.namespace, args.topics)
                        instead = stand_ins(topics, args.topics)
                        summary = record(writer, topics, instead, interrupted, args.duration, show)
                finally:
                    written = sum(writer.counts.values())
            if not written:
                raise RecordingError(
                    f"no message came in {summary.seconds:.0f} s; lasso-motion check looks at who publishes what"
                )
        except BaseException as error:
            if not written:
                earlier.bring_back()
            elif (kept := earlier.keep()) is not None:
                said = f"the earlier recording is kept as {kept}"
                if isinstance(error, LassoMotionError):
                    raise RecordingError(f"{error}; {said}") from error
                print(f"lasso-motion record: {said}", file=sys.stderr)
            raise
        earlier.drop()
    return summary


def _repair(args: argparse.Namespace) -> int:
    path, quiet = args.repair, args.quiet
    with busy(f"reading and writing {path.name} anew", quiet):
        repaired = repair_recording(path)
    if args.json is not None:
        write_json(args.json, asdict(repaired))
    if repaired.damage is None:
        print(f"{path} is whole; nothing was changed")
        return EXIT_DONE
    if not quiet:
        print(repaired.damage)
        _print_counts(path, repaired.counts, repaired.seconds)
    return EXIT_DONE if repaired.counts else EXIT_BAD_INPUT


def _print_counts(path: Path, counts: dict[str, int], seconds: float) -> None:
    size = path.stat().st_size / 1e6
    print(f"{path}: {sum(counts.values())} messages on {len(counts)} topics in {seconds:.1f} s, {size:.1f} MB")
    for topic in sorted(counts):
        print(f"  {counts[topic]:7d}  {topic}")
