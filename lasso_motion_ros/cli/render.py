"""`lasso-motion render`: the overlay offline, as video or as frames, from a recording and a tracker's result."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lasso_motion_ros.cli.arguments import CommandParser, add_remap, parse_remap
from lasso_motion_ros.cli.main import EXIT_DONE, EXIT_PART
from lasso_motion_ros.config.overlay import OverlayConfig
from lasso_motion_ros.config.parameters import configuration_from_values, configuration_values, load_configuration
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import LassoMotionError, RecordingError
from lasso_motion_ros.core.json_output import write_json
from lasso_motion_ros.core.progress import busy, progress
from lasso_motion_ros.core.share import share_file
from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.overlay.overlay_object import read_overlay_object
from lasso_motion_ros.overlay.painter import OverlayPainter
from lasso_motion_ros.overlay.style import overlay_style
from lasso_motion_ros.reports.offline_overlay import VIEWS, DrawnPair, OfflineOverlay, View, video_picture
from lasso_motion_ros.reports.png import write_png
from lasso_motion_ros.reports.video import VideoWriter
from lasso_motion_ros.stream.outputs import Problem, problem_lines
from lasso_motion_ros.stream.recorded_pairs import recorded_pairs
from msg_adapters.recordings.evaluation_input import read_estimates
from msg_adapters.recordings.reader import RecordingReader, check_tracking_topics
from msg_adapters.recordings.writer import check_free

HELP = """Draw the overlay over a recording, offline, with the motion of a tracker's result: what the overlay node draws
live. OUT.mp4 becomes a video of both planes, any other name a directory of PNG frames, one a plane and pair."""

DEFAULT_CONFIG = "config/overlay.yaml"
CELL_PX = 768


def add_arguments(parser: CommandParser) -> None:
    """Declare the command's own arguments."""
    parser.add_argument("recording", type=Path, metavar="IN.mcap", help="recording with the images")
    parser.add_argument("result", type=Path, metavar="RESULT.mcap", help="what a tracker published on it")
    parser.add_argument(
        "--volume",
        required=True,
        metavar="FILE",
        help="surface (STL, PLY, OBJ, VTK, VTP) or volume (NIfTI, NRRD, MHA, a folder with a DICOM series)",
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT", help="OUT.mp4, or a directory")
    parser.add_argument(
        "--units", choices=("mm", "m"), help="unit of the file's coordinates; must be given for surfaces"
    )
    parser.add_argument(
        "--axes", choices=("lps", "ras"), help="a surface file's axes (default: as it states, else LPS)"
    )
    parser.add_argument(
        "--registration",
        metavar="NUMBERS|FILE",
        help="volume to world, metres: 'x y z qx qy qz qw' or the 16 numbers of a matrix (default: identity)",
    )
    parser.add_argument("--level", type=float, metavar="VALUE", help="of a volume: the surface lies at this value")
    parser.add_argument("--label", type=int, metavar="N", help="of a volume: the surface of the voxels with this value")
    parser.add_argument("--projection", action="store_true", help="of a volume: its translucent projection, no surface")
    parser.add_argument(
        "--view",
        choices=VIEWS,
        default="compensated",
        help="both: static and compensated side by side (default %(default)s)",
    )
    parser.add_argument("--config", type=Path, metavar="FILE", help=f"overlay parameters (default: {DEFAULT_CONFIG})")
    parser.add_argument("--rate", type=float, metavar="FPS", help="of the video (default: the recording's own)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write what was drawn, pair by pair")
    add_remap(parser, "read the recorded topic FROM as TO")
    parser.add_argument("--overwrite", action="store_true", help="replace OUT if it exists")


def run(args: argparse.Namespace) -> int:
    """Render; returns the exit status (3 where the recording could be read in part only)."""
    video = is_video(args.output)
    if args.rate is not None and not video:
        raise LassoMotionError("--rate is for a video: name the output OUT.mp4")
    if args.rate is not None and not args.rate > 0.0:
        raise LassoMotionError(f"--rate must be positive, found {args.rate}")
    check_free(args.output, args.overwrite)
    config = overlay_configuration(args)
    with busy(f"reading {args.volume}", args.quiet):
        shown = read_overlay_object(config)
    if not args.quiet:
        print(shown.description)
    reader = RecordingReader(args.recording, parse_remap(args.remap))
    check_tracking_topics(reader.path, reader.topics)
    estimates = read_estimates(args.result)
    painter = OverlayPainter(shown.drawn, overlay_style(config.style))
    overlay = OfflineOverlay(painter, config, estimates, args.view)
    problems: Counter[Problem] = Counter()
    pairs = recorded_pairs(reader, replace(StreamConfig(), sync=config.sync), problems)
    records: list[dict[str, Any]] = []
    with _Output(args) as output:
        for number, pair in enumerate(progress(pairs, len(estimates) or None, "rendering", args.quiet)):
            drawn = overlay.draw(pair)
            output.write(number, pair, drawn)
            records.append({"stamp_ns": pair.stamp_ns, "compensated": drawn.compensated, "status": drawn.status})
    wrong = problem_lines(problems)
    if not records:
        raise RecordingError(f"{args.recording}: no image pair could be made{': ' if wrong else ''}{'; '.join(wrong)}")
    for line in wrong:
        print(f"lasso-motion render: {line}", file=sys.stderr)
    compensated = sum(record["compensated"] for record in records)
    if not args.quiet:
        print(
            f"{args.output}: {len(records)} pairs, {compensated} compensated, {len(records) - compensated} static only"
        )
    if args.json is not None:
        write_json(args.json, {"shown": shown.description, "compensated": compensated, "pairs": records})
    if reader.damage is not None:
        print(f"lasso-motion render: {reader.damage}", file=sys.stderr)
        return EXIT_PART
    return EXIT_DONE


def overlay_configuration(args: argparse.Namespace) -> OverlayConfig:
    """The overlay's parameters: those of the file, with what the command line says.

    Raises:
        ConfigurationError: a file or a value that is not allowed.
    """
    config = load_configuration(args.config or share_file(DEFAULT_CONFIG), OverlayConfig, "lasso_overlay")
    given = {
        "volume_file": args.volume,
        "units": args.units,
        "axes": args.axes,
        "registration": args.registration,
        "volume.level": args.level,
        "volume.label": args.label,
        "volume.display": "projection" if args.projection else None,
    }
    values = configuration_values(config) | {name: value for name, value in given.items() if value is not None}
    return configuration_from_values(OverlayConfig, values)


class _Output:
    """The video, or the directory of frames, as a context manager."""

    def __init__(self, args: argparse.Namespace) -> None:
        self._path: Path = args.output
        self._view: View = args.view
        self._rate: float | None = args.rate
        self._video: VideoWriter | None = None
        self._first: tuple[int, DrawnPair] | None = None
        self._start_ns = 0
        if not is_video(self._path):
            try:
                self._path.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise RecordingError(f"{self._path}: cannot be made: {error.strerror}") from error

    def __enter__(self) -> _Output:
        return self

    def __exit__(self, *_: object) -> None:
        if self._path.is_dir():
            with suppress(OSError):  # refused where a picture is in it, as it should be
                self._path.rmdir()
        if self._first is not None:  # a recording of one pair has no rate of its own
            self._add_frame(*self._first, self._rate or 1.0)
        if self._video is not None:
            self._video.close()

    def write(self, number: int, pair: FramePair, drawn: DrawnPair) -> None:
        if not is_video(self._path):
            for plane, picture in drawn.planes.items():
                write_png(self._path / f"plane_{plane}_{number:05d}.png", picture)
            return
        if self._video is None and self._first is None:
            self._first, self._start_ns = (pair.stamp_ns, drawn), pair.stamp_ns
            return
        # The first two stamps tell how fast the video plays; until the second comes the first waits.
        rate = self._rate or float(np.clip(1e9 / max(pair.stamp_ns - self._start_ns, 1), 0.2, 60.0))
        if self._first is not None:
            first, self._first = self._first, None
            self._add_frame(*first, rate)
        self._add_frame(pair.stamp_ns, drawn, rate)

    def _add_frame(self, stamp_ns: int, drawn: DrawnPair, rate: float) -> None:
        if self._video is None:
            self._video = VideoWriter(self._path, rate)
        words = f"t = {1e-9 * (stamp_ns - self._start_ns):.2f} s   "
        words += "compensated" if drawn.compensated else "not compensated"
        words += f"   {drawn.status}" if drawn.status else ""
        self._video.write(video_picture(drawn, self._view, CELL_PX, words))


def is_video(path: Path) -> bool:
    """Whether an output's name asks for a video."""
    return path.suffix.lower() == ".mp4"
