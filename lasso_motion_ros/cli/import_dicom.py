"""`lasso-motion import`: a pair of DICOM XA objects into a recording."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from lasso_motion_ros.cli.archives import add_workers, archive_files, run_over_archive
from lasso_motion_ros.cli.arguments import CommandParser, is_archive
from lasso_motion_ros.cli.main import EXIT_DONE
from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.output_files import write_json
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.tools.archive_work import ImportWork
from lasso_motion_ros.tools.dicom_import import ImportOptions, conventions, describe, import_dicom, report
from msg_adapters.dicom.given_geometry import GEOMETRY_HELP
from msg_adapters.dicom.pair_search import find_pairs

HELP = """Bring DICOM XA (classic or Enhanced, one object a plane) into a recording: pictures, stamps, a calibration for
every frame, R peaks where they are marked. Says what it takes for granted, and refuses by tag what is missing."""


def add_arguments(parser: CommandParser) -> None:
    """Declare the command's own arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = GEOMETRY_HELP
    parser.add_input(
        "objects",
        nargs="+",
        metavar="A.dcm B.dcm",
        help="plane A's object and plane B's; with --workers folders, of which each has the two of a recording",
    )
    parser.add_output(
        "-o",
        "--output",
        many=archive_files(".mcap"),
        required=True,
        metavar="OUT.mcap",
        help="recording to write; with --workers or --scheduler a folder",
    )
    add_workers(parser)
    parser.add_input("--geometry", metavar="FILE", help="what the objects leave open or have wrong (below)")
    parser.add_argument(
        "--plane-b-offset",
        type=_finite,
        metavar="S",
        help="how much later plane B begins than plane A, seconds (default: by the objects' clocks, or the pictures)",
    )
    parser.add_argument("--voi-lut", action="store_true", help="apply the objects' window or VOI LUT to the pictures")
    parser.add_argument(
        "--identity",
        action="store_true",
        help="keep the patient's name and numbers, the day, and pictures with text burnt in (default: none of them)",
    )
    parser.add_output(
        "--export", metavar="FILE", help="write every projection as OpenCV, RTK and DiffDRR have it (JSON)"
    )
    parser.add_output("--json", metavar="FILE", help="write what was imported and taken for granted")


def run(args: argparse.Namespace) -> int:
    """Import; returns the exit status."""
    geometry = None if args.geometry is None else args.geometry.absolute()
    options = ImportOptions(geometry, args.plane_b_offset, args.voi_lut, args.identity)
    if is_archive(args):
        return _archive(args, options)
    if len(args.objects) != 2:
        raise LassoMotionError(f"expected two objects, plane A's and plane B's, found {len(args.objects)}")
    paths: dict[Plane, Path] = dict(zip(PLANES, args.objects, strict=True))
    pair = import_dicom(paths, args.output, options, overwrite=args.overwrite, quiet=args.quiet)
    if args.export is not None:
        write_json(args.export, conventions(pair))
    if args.json is not None:
        write_json(args.json, report(pair))
    if not args.quiet:
        print(
            "\n".join(
                [*describe(pair), f"{args.output}: written; it has no clicks yet (lasso-motion web, track --seeds)"]
            )
        )
    return EXIT_DONE


def _archive(args: argparse.Namespace, options: ImportOptions) -> int:
    """A recording of each pair in folders."""
    if args.export is not None:
        raise LassoMotionError("--export is for one pair")
    named = [
        (ImportWork(pair, options), str(pair.paths[0].parent), f"{pair.name}.mcap")
        for pair in find_pairs(args.objects, without=[args.output])
    ]
    return run_over_archive(args, named, "importing")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"expected seconds, found {text}")
    return value
