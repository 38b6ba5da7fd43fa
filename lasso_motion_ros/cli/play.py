"""`lasso-motion play`: publish a recording on its topics in real time."""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict

from lasso_motion_ros.cli.arguments import CommandParser, add_remap, not_negative, parse_remap, positive
from lasso_motion_ros.cli.main import EXIT_DONE, EXIT_INTERRUPTED, EXIT_PART
from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.core.output_files import write_json
from lasso_motion_ros.core.progress import counting
from lasso_motion_ros.core.signals import held_signals
from lasso_motion_ros.nodes.ros_start import require_ros
from lasso_motion_ros.tools.processes import stay_on_this_machine
from msg_adapters.recordings.reader import RecordingReader

DEFAULT_WAIT_S = 20.0

HELP = """Publish a recording on its topics, at its recorded timing, reliably, latched topics latched. What a tracker
has put out is left out, so that one can be run on it. It begins when every topic that a tracker listens to has a
subscriber: the clicks come with the first images, and who subscribes later never hears them. Only this machine sees
it, unless ROS_AUTOMATIC_DISCOVERY_RANGE says otherwise."""


def add_arguments(parser: CommandParser) -> None:
    """Declare the command's arguments."""
    parser.add_input("recording", type=str, metavar="IN.mcap", help="the recording: an MCAP file or a bag directory")
    parser.add_argument("--rate", type=positive, default=1.0, help="times the recorded speed (default 1)")
    parser.add_argument("--loop", action="store_true", help="begin again at the end, until interrupted")
    parser.add_argument(
        "--endless", action="store_true", help="likewise, but stamps go on: to the nodes it is one long stream"
    )
    parser.add_argument("--start", type=not_negative, default=0.0, metavar="S", help="leave out the first S seconds")
    parser.add_argument("--clock", action="store_true", help="publish /clock with the recording's time")
    parser.add_output("--json", metavar="FILE", help="write what was published, and how punctually")
    parser.add_argument("--all", action="store_true", help="publish a tracker's recorded outputs too")
    add_remap(parser, "publish the recorded topic FROM as TO")
    waiting = parser.add_mutually_exclusive_group()
    waiting.add_argument(
        "--wait",
        type=not_negative,
        metavar="S",
        help=f"wait for subscribers at most S seconds, and stop where one is missing (default: at most "
        f"{DEFAULT_WAIT_S:g} s, then say who is missing and play all the same)",
    )
    waiting.add_argument("--no-wait", action="store_true", help="begin at once, as `ros2 bag play` does")
    parser.add_argument(
        "--subscribers", type=int, default=1, metavar="N", help="wait for so many on each image topic (default 1)"
    )


def run(args: argparse.Namespace) -> int:
    """Play the recording and say what was published."""
    require_ros()
    stay_on_this_machine()
    from lasso_motion_ros.tools.player import PlayOptions, play

    reader = RecordingReader(args.recording, remap=parse_remap(args.remap))
    options = PlayOptions(
        rate=args.rate,
        loop=args.loop,
        endless=args.endless,
        start_s=args.start,
        clock=args.clock,
        everything=args.all,
        wait_s=0.0 if args.no_wait else DEFAULT_WAIT_S if args.wait is None else args.wait,
        insist=args.wait is not None,
        subscribers=args.subscribers,
    )
    with held_signals() as interrupted, counting("published", args.quiet) as show:
        summary = play(reader, options, interrupted, show, _say)
    if args.json is not None:
        write_json(args.json, asdict(summary))
    if not args.quiet:
        messages = sum(summary.published.values())
        print(
            f"published {messages} messages on {len(summary.published)} topics in {summary.seconds:.1f} s, "
            f"none later than {summary.latest_s * 1e3:.0f} ms"
        )
        for topic in summary.unknown:
            print(f"left out {topic}: its message type is not installed")
    if summary.unacknowledged:
        raise RecordingError(f"a subscriber did not acknowledge all of {', '.join(summary.unacknowledged)}")
    if interrupted.is_set():
        return EXIT_INTERRUPTED
    if summary.damage:
        print(f"lasso-motion play: {summary.damage}", file=sys.stderr)
        return EXIT_PART
    return EXIT_DONE


def _say(text: str) -> None:
    print(f"lasso-motion play: {text}", file=sys.stderr, flush=True)
