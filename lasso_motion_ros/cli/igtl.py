"""`lasso-motion igtl`: motion and state to an OpenIGTLink server, from a live graph or from a tracker's result."""

from __future__ import annotations

import argparse

from lasso_motion_ros.cli.arguments import CommandParser, positive
from lasso_motion_ros.cli.main import EXIT_DONE, EXIT_INTERRUPTED
from lasso_motion_ros.config.igtl import IgtlConfig
from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.signals import held_signals
from lasso_motion_ros.nodes.ros_start import require_ros
from lasso_motion_ros.tools.processes import stay_on_this_machine
from msg_adapters.openigtlink import IgtlMessages, server_address

HELP = """Send the motion to an OpenIGTLink server, 3D Slicer's or Plus', as a TRANSFORM in RAS and millimetres, and the
state as a STRING. Without a transform the state is none of TRACKING and DEGRADED. With RESULT.mcap it sends what a
tracker has published, in real time, and needs no ROS; without, what a live graph publishes. It connects anew when the
server comes back, and nothing old is sent then."""

DEFAULTS = IgtlConfig()


def add_arguments(parser: CommandParser) -> None:
    """Declare the command's arguments."""
    parser.add_input("result", nargs="?", metavar="RESULT.mcap", help="what a tracker published (default: live)")
    parser.add_argument("--to", required=True, metavar="HOST:PORT", help="the server; 3D Slicer listens on port 18944")
    parser.add_argument("--device", default=DEFAULTS.device, help="name of the transform (default %(default)s)")
    parser.add_argument(
        "--axes",
        default=DEFAULTS.axes,
        help="where in the patient the world's x, y and z point, of R, L, A, P, S, I (default %(default)s)",
    )
    parser.add_argument("--rate", type=positive, help="with RESULT.mcap: times its speed (default 1)")
    parser.add_argument(
        "--ros-args", nargs=argparse.REMAINDER, default=[], help="what follows goes to ROS (-r __ns:=/lab, -p …)"
    )


def run(args: argparse.Namespace) -> int:
    """Send until stopped, or until the result ends; returns the exit status."""
    address = server_address(args.to)
    messages = IgtlMessages(args.device, args.axes)  # refuses bad input before anything starts
    if args.result is not None:
        return _replay(args, messages, address)
    if args.rate is not None:
        raise LassoMotionError("--rate goes with RESULT.mcap")
    require_ros()
    stay_on_this_machine()
    from lasso_motion_ros.nodes.executables import lasso_igtl

    values = {"to": args.to, "device": args.device, "axes": args.axes}
    words = [word for name, value in values.items() for word in ("-p", f"{name}:='{value}'")]
    return lasso_igtl(["--ros-args", *words, *args.ros_args])


def _replay(args: argparse.Namespace, messages: IgtlMessages, address: tuple[str, int]) -> int:
    from lasso_motion_ros.tools.igtl_replay import replay

    if args.ros_args:
        raise LassoMotionError("--ros-args is for a live graph, not for RESULT.mcap")

    def say(line: str) -> None:
        if not args.quiet:
            print(line, flush=True)

    with held_signals() as interrupted:
        sent = replay(args.result, messages, address, say, interrupted, rate=args.rate or 1.0)
        say(f"sent {sent.transforms} transforms and {sent.states} states of {sent.pairs} pairs")
        return EXIT_INTERRUPTED if interrupted.is_set() else EXIT_DONE
