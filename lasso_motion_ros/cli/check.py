"""`lasso-motion check`: look at a live graph or a recording, say what is wrong and how to mend it."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import asdict

from lasso_motion_ros.cli.arguments import CommandParser, add_remap, parse_remap, positive
from lasso_motion_ros.cli.main import EXIT_BAD_INPUT, EXIT_DONE, EXIT_PART
from lasso_motion_ros.config.parameters import load_configuration
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.output_files import write_json
from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.nodes.ros_start import require_ros
from lasso_motion_ros.tools.recorded_examination import describe_facts, describe_offset, examine_recording
from msg_adapters.checks.examination import Examination
from msg_adapters.checks.graph_checks import TopicFacts
from msg_adapters.checks.issue import Issue
from msg_adapters.sync.plane_source import PlaneSource, plane_sources

HELP = """Look at a live graph (for some seconds), or at a recording, as an integrator would: topics, types, quality of
service, stamps, pairing, calibration, images, clicks. Prints one line for each thing found: `error` keeps the tracker
from working, `warning` costs frames or accuracy, `note` is for information; behind -> stands how to mend it. Exit
status: 0 nothing keeps the tracker from working; 2 at least one error, or nothing to look at; 3 nothing does, as far
as a recording that was cut short can tell."""

DEFAULT_SECONDS = 5.0


def add_arguments(parser: CommandParser) -> None:
    """Declare the command's arguments."""
    parser.add_input(
        "recording",
        nargs="?",
        type=str,
        metavar="IN.mcap",
        help="a recording (MCAP file or bag directory); none: the live graph",
    )
    parser.add_argument(
        "--seconds",
        type=positive,
        default=DEFAULT_SECONDS,
        metavar="N",
        help="live: how long to look, once somebody is found (default 5)",
    )
    parser.add_argument("--namespace", default="", metavar="NS", help="live: of the nodes (/lab)")
    parser.add_input("--config", metavar="FILE", help="the tracker's parameters: the crops of frame grabbers' pictures")
    parser.add_argument(
        "--offset",
        action="store_true",
        help="measure by how much one plane's stamps are later than the other's, from what moves in both films",
    )
    add_remap(parser, "read the recorded topic FROM as TO")
    parser.add_output("--json", metavar="FILE", help="write facts and findings")


def run(args: argparse.Namespace) -> int:
    """Look, and say what was found."""
    if args.recording is None:
        if args.remap:
            raise LassoMotionError("--remap is for recordings; live, the nodes are remapped (--ros-args -r from:=to)")
        examination, topics, cut = _look_live(args)
    else:
        examination, topics, cut = _look_at_recording(args)
    issues = [*cut, *examination.issues(topics)]
    works = all(issue.severity != "error" for issue in issues)
    facts = examination.facts()
    if not args.quiet:
        print("\n".join(describe_facts(facts)))
        if args.offset:
            print(describe_offset(facts))
    for issue in issues:
        if issue.severity != "note" or not args.quiet:
            print(issue)
    if not args.quiet:
        print("nothing keeps the tracker from working" if works else "the tracker cannot work with this")
    if args.json is not None:
        write_json(args.json, {"works": works, "facts": facts, "findings": [asdict(one) for one in issues]})
    if not works:
        return EXIT_BAD_INPUT
    return EXIT_PART if cut else EXIT_DONE


def _sources(args: argparse.Namespace) -> Mapping[Plane, PlaneSource] | None:
    return None if args.config is None else plane_sources(load_configuration(args.config, StreamConfig))


def _look_live(args: argparse.Namespace) -> tuple[Examination, Mapping[str, TopicFacts], list[Issue]]:
    require_ros()
    from lasso_motion_ros.core.signals import held_signals
    from lasso_motion_ros.tools.examiner import examine

    namespace = f"/{args.namespace.strip('/')}" if args.namespace.strip("/") else ""
    with held_signals() as interrupted:
        examination, topics = examine(args.seconds, namespace, interrupted, _sources(args), offset=args.offset)
        if interrupted.is_set():
            raise interrupted.interrupt()
    return examination, topics, []


def _look_at_recording(args: argparse.Namespace) -> tuple[Examination, Mapping[str, TopicFacts], list[Issue]]:
    examination, topics, damage = examine_recording(
        args.recording, parse_remap(args.remap), sources=_sources(args), offset=args.offset, quiet=args.quiet
    )
    cut = [] if damage is None else [Issue("warning", "recording", damage, "lasso-motion record --repair FILE")]
    return examination, topics, cut
