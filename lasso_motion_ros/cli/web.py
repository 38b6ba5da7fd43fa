"""`lasso-motion web`: the page in the browser, live or to draw centrelines into a recording."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from lasso_motion_ros.cli.arguments import CommandParser, add_remap, parse_remap, port
from lasso_motion_ros.cli.main import EXIT_DONE, EXIT_PART
from lasso_motion_ros.cli.overlay_arguments import (
    DEFAULT_CONFIG,
    add_overlay_arguments,
    given_overlay_values,
    overlay_configuration,
)
from lasso_motion_ros.config.web import AUTO_AXES, UNKNOWN_AXES
from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.share import share_file
from lasso_motion_ros.geometry.patient_axes import patient_axes
from lasso_motion_ros.nodes.ros_start import require_ros
from lasso_motion_ros.tools.processes import stay_on_this_machine

HELP = """A page in the browser: both planes live with overlay and tracked loop, state, motion and latency; clicking
along the loop in both planes starts the tracker. With IN.mcap the recording is played over and over to a tracker of its
own; with --volume an overlay draws it at its static and at its compensated place, over the recording or over the graph
that is running. With --annotate, the same tool draws the loop's centrelines into a
copy of a recording, frame by frame, as /ground_truth/plane_x/catheter; that needs no ROS. Only this machine reaches
page and graph, unless --host and ROS_AUTOMATIC_DISCOVERY_RANGE say otherwise."""

DEFAULT_HOST = "127.0.0.1"
DEFAULT_PORT = 8080
TRACKER_CONFIG = "config/tracker.yaml"


def add_arguments(parser: CommandParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("--host", default=DEFAULT_HOST, help=f"address to listen on (default {DEFAULT_HOST})")
    parser.add_argument("--port", type=port, default=DEFAULT_PORT, help=f"TCP port (default {DEFAULT_PORT}; 0: any)")
    parser.add_argument(
        "--allow-host", action="append", default=[], metavar="NAME", help="a further name browsers may ask for it by"
    )
    parser.add_input(
        "recording", nargs="?", metavar="IN.mcap", help="a recording to play (default: the graph as it is)"
    )
    add_overlay_arguments(parser, required=False)
    parser.add_input(
        "--config",
        metavar="FILE",
        help=f"with IN.mcap or --volume: parameters (default: {TRACKER_CONFIG}, {DEFAULT_CONFIG})",
    )
    parser.add_input("--annotate", metavar="IN.mcap", help="draw centrelines into a copy of a recording")
    parser.add_output("-o", "--output", metavar="OUT.mcap", help="with --annotate: the copy")
    parser.add_argument(
        "--world-axes",
        default=AUTO_AXES,
        metavar="LPS",
        help="where in the patient the world's x, y and z point (default: LPS, if both calibrations look like it)",
    )
    add_remap(parser, "with --annotate: read the recorded topic FROM as TO")
    parser.add_argument(
        "--ros-args", nargs=argparse.REMAINDER, default=[], help="what follows goes to ROS (-r __ns:=/lab, -p …)"
    )


def run(args: argparse.Namespace) -> int:
    """Serve the page until stopped; returns the exit status."""
    if args.annotate is not None and args.recording is None and args.volume is None:
        return _annotate(args)
    if args.output is not None:
        raise LassoMotionError("-o goes with --annotate IN.mcap")
    if given_overlay_values(args) and args.volume is None:
        raise LassoMotionError("--units, --axes, --registration and what else tells of a volume go with --volume FILE")
    if args.world_axes not in (AUTO_AXES, UNKNOWN_AXES):
        patient_axes(args.world_axes)  # refuses bad input before anything starts
    if args.recording is not None or args.volume is not None:
        return _show(args)
    if args.config is not None:
        raise LassoMotionError(
            "--config goes with IN.mcap or --volume; the page's own is --ros-args --params-file FILE"
        )
    require_ros()
    stay_on_this_machine()
    from lasso_motion_ros.nodes.executables import lasso_web

    values = {
        "host": args.host,
        "port": args.port,
        "allowed_hosts": " ".join(args.allow_host),
        "axes": args.world_axes,
    }
    # Quotes: a host of digits must stay a text.
    words = [word for name, value in values.items() for word in ("-p", f"{name}:={_yaml(value)}")]
    return lasso_web(["--ros-args", *words, *args.ros_args])


def _show(args: argparse.Namespace) -> int:
    """The page with tracker and overlay of its own, as far as they are asked for."""
    if args.annotate is not None:
        raise LassoMotionError("--annotate draws centrelines; IN.mcap and --volume show a recording: one of both")
    if args.ros_args and args.recording is not None:
        raise LassoMotionError("--ros-args is for a graph that is running, not for IN.mcap")
    overlay = None if args.volume is None else overlay_configuration(args)
    configuration = None if args.recording is None else args.config or share_file(TRACKER_CONFIG)
    require_ros()
    from lasso_motion_ros.tools.demonstration import check_page_input
    from lasso_motion_ros.tools.page_demonstration import PageInput, run_page

    seeded = configuration is not None and check_page_input(args.recording, configuration)
    page = ["--host", args.host, "--port", str(args.port), "--world-axes", args.world_axes]
    page += [word for name in args.allow_host for word in ("--allow-host", name)]
    # Crops and stamps are for the page, too, where the file's section is for all nodes.
    ros = args.ros_args if args.config is None else [*args.ros_args, "--params-file", str(args.config)]
    with tempfile.TemporaryDirectory(prefix="lasso_motion_") as logs:
        run_page(PageInput(args.recording, configuration, overlay, seeded, page, Path(logs), ros), print)
    return EXIT_DONE


def _annotate(args: argparse.Namespace) -> int:
    from lasso_motion_ros.web.annotation import annotate

    if args.output is None:
        raise LassoMotionError("--annotate needs -o OUT.mcap, the copy to draw into")
    damage = annotate(
        args.annotate,
        args.output,
        host=args.host,
        port=args.port,
        names=tuple(args.allow_host),
        remap=parse_remap(args.remap),
        overwrite=args.overwrite,
        quiet=args.quiet,
    )
    if damage is not None:
        print(f"lasso-motion web: {damage}", file=sys.stderr)
        return EXIT_PART
    return EXIT_DONE


def _yaml(value: str | int) -> str:
    return f"'{value}'" if isinstance(value, str) else str(value)
