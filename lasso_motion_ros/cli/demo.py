"""`lasso-motion demo`: the whole graph, live over DDS, on a recording; video, plots and a table of it."""

from __future__ import annotations

import argparse
from pathlib import Path

from lasso_motion_ros.cli.arguments import CommandParser, port
from lasso_motion_ros.cli.main import EXIT_DONE
from lasso_motion_ros.cli.web import DEFAULT_HOST, DEFAULT_PORT
from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.output_files import write_json
from lasso_motion_ros.core.share import bundled_recording, share_file
from lasso_motion_ros.evaluation.summary import evaluation_record
from lasso_motion_ros.nodes.ros_start import require_ros
from lasso_motion_ros.tools.child_graph import LOGS
from lasso_motion_ros.tools.demonstration import (
    DEMO_FILES,
    demonstrate,
    demonstrate_page,
    describe,
    exceeded_limits,
)

HELP = """Play a recording in real time to the tracker and the overlay, each a process of its own, over DDS on this
machine, and write what comes over the wire: a video of the overlay, plots, and a table of the errors. With --web:
play it over and over instead, with a page in the browser to look at it and to click."""


def add_arguments(parser: CommandParser) -> None:
    """Declare the command's arguments."""
    parser.add_input("--bag", metavar="FILE", help="the recording to play (default: the bundled one)")
    parser.add_output(
        "--out",
        directory=True,
        owned=DEMO_FILES,
        ignored=(LOGS,),
        unless="web",
        default=Path("demo_output"),
        metavar="DIR",
        help="where to write (default: demo_output)",
    )
    parser.add_input("--config", metavar="FILE", help="tracker parameters (default: config/tracker.yaml)")
    parser.add_output("--json", metavar="FILE", help="write every measure, pair by pair")
    parser.add_argument("--web", action="store_true", help="a page in the browser; plays over and over until stopped")
    parser.add_argument(
        "--port", type=port, default=DEFAULT_PORT, help=f"with --web: TCP port (default {DEFAULT_PORT})"
    )


def run(args: argparse.Namespace) -> int:
    """Run the demonstration; returns the exit status, 0 when every pair was answered and no limit is exceeded."""
    require_ros()
    recording: Path = args.bag or bundled_recording()
    configuration: Path = args.config or share_file("config/tracker.yaml")
    if args.web:
        # The address is a result: without it --quiet would start a page that nobody finds.
        demonstrate_page(recording, configuration, args.out, print, host=DEFAULT_HOST, port=args.port, quiet=args.quiet)
        return EXIT_DONE
    say = (lambda line: None) if args.quiet else print
    shown = demonstrate(recording, configuration, args.out, say, quiet=args.quiet)
    artefacts = shown.artefacts
    if args.json is not None and artefacts.scores:
        write_json(args.json, evaluation_record({shown.run.name: artefacts.scores}))
    print("\n".join(describe(shown)))
    exceeded = exceeded_limits(artefacts.summary) if args.bag is None else []
    if exceeded:
        raise LassoMotionError(f"the table is above its limits: {'; '.join(exceeded)}")
    return EXIT_DONE
