"""`lasso-motion synth`: renders a biplane sequence with exact truth into a recording."""

from __future__ import annotations

import argparse

from lasso_motion_ros.cli.arguments import CommandParser
from lasso_motion_ros.cli.main import EXIT_DONE
from lasso_motion_ros.core.errors import ScenarioError
from lasso_motion_ros.tools.synthesis import list_scenarios, synthesise

HELP = "Render a biplane sequence of the phantom, with seeds and exact truth, into an MCAP recording."
EASIEST = "01_clear_view"


def add_arguments(parser: CommandParser) -> None:
    """Declare the command's arguments."""
    parser.add_output("output", metavar="OUT.mcap", nargs="?", help="recording to write")
    parser.add_input(
        "--scenario",
        type=str,
        default=EASIEST,
        metavar="NAME|FILE",
        help=f"one of --list, or a YAML file (default {EASIEST})",
    )
    parser.add_argument("--seed", type=int, metavar="N", help="instead of the scenario's seed")
    parser.add_argument("--frames", type=int, metavar="N", help="number of pairs instead of the scenario's")
    parser.add_input("--volume", type=str, metavar="FILE", help="CT volume (NIfTI, NRRD, MHA) as the patient's body")
    parser.add_argument(
        "--volume-centre",
        nargs=3,
        type=float,
        metavar=("X", "Y", "Z"),
        help="left atrium in the volume, mm in its LPS coordinates (default: its middle)",
    )
    parser.add_argument("--list", action="store_true", help="list the scenarios that come with the package")


def run(args: argparse.Namespace) -> int:
    """Render, or list the scenarios; returns the exit status."""
    if args.list:
        print("\n".join(list_scenarios()))
        return EXIT_DONE
    if args.output is None:
        raise ScenarioError("no output given: expected OUT.mcap (or --list)")
    scenario = synthesise(
        args.output,
        args.scenario,
        seed=args.seed,
        pairs=args.frames,
        volume=args.volume,
        volume_centre_mm=args.volume_centre,
        overwrite=args.overwrite,
        quiet=args.quiet,
    )
    if not args.quiet:
        print(f"{args.output}: scenario {scenario.name}, {scenario.pairs} pairs at {scenario.rate_hz:g}/s")
    return EXIT_DONE
