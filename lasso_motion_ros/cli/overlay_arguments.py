"""The arguments by which a command is told what to draw over the film."""

from __future__ import annotations

import argparse

from lasso_motion_ros.cli.arguments import CommandParser
from lasso_motion_ros.config.overlay import OverlayConfig
from lasso_motion_ros.config.parameters import configuration_from_values, configuration_values, load_configuration
from lasso_motion_ros.core.share import share_file

DEFAULT_CONFIG = "config/overlay.yaml"


def add_overlay_arguments(parser: CommandParser, *, required: bool) -> None:
    """Declare `--volume` and what goes with it.

    Args:
        parser: the command's.
        required: whether there must be one.
    """
    parser.add_input(
        "--volume",
        type=str,
        required=required,
        metavar="FILE",
        help="surface (STL, PLY, OBJ, VTK, VTP) or volume (NIfTI, NRRD, MHA, a folder with a DICOM series)",
    )
    parser.add_argument(
        "--units", choices=("mm", "m"), help="unit of the file's coordinates; must be given for surfaces"
    )
    parser.add_argument(
        "--axes", choices=("lps", "ras"), help="a surface file's axes (default: as it states, else LPS)"
    )
    parser.add_input(
        "--registration",
        type=str,
        metavar="NUMBERS|FILE",
        help="volume to world, metres: 'x y z qx qy qz qw' or the 16 numbers of a matrix (default: identity)",
    )
    parser.add_argument("--level", type=float, metavar="VALUE", help="of a volume: the surface lies at this value")
    parser.add_argument("--label", type=int, metavar="N", help="of a volume: the surface of the voxels with this value")
    parser.add_argument("--projection", action="store_true", help="of a volume: its translucent projection, no surface")


def overlay_configuration(args: argparse.Namespace) -> OverlayConfig:
    """The overlay's parameters: those of the file, with what the command line says.

    Raises:
        ConfigurationError: a file or a value that is not allowed.
    """
    config = load_configuration(args.config or share_file(DEFAULT_CONFIG), OverlayConfig, "lasso_overlay")
    values = configuration_values(config) | given_overlay_values(args)
    return configuration_from_values(OverlayConfig, values)


def given_overlay_values(args: argparse.Namespace) -> dict[str, str | float]:
    """What the command line says, by parameter."""
    given = {
        "volume_file": args.volume,
        "units": args.units,
        "axes": args.axes,
        "registration": args.registration,
        "volume.level": args.level,
        "volume.label": args.label,
        "volume.display": "projection" if args.projection else None,
    }
    return {name: value for name, value in given.items() if value is not None}
