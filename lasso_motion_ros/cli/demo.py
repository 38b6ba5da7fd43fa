"""`lasso-motion demo`: the whole graph, live over DDS, on a recording; video, plots and a table of it."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np

from lasso_motion_ros.cli.main import EXIT_DONE
from lasso_motion_ros.cli.web import DEFAULT_HOST, DEFAULT_PORT, port
from lasso_motion_ros.config.parameters import load_configuration
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import LassoMotionError, RecordingError
from lasso_motion_ros.core.json_output import write_json
from lasso_motion_ros.core.progress import busy
from lasso_motion_ros.core.share import bundled_recording, share_file
from lasso_motion_ros.evaluation.measures import Truth
from lasso_motion_ros.evaluation.summary import Summary, report
from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane
from lasso_motion_ros.nodes.running import require_ros
from lasso_motion_ros.overlay.atrium import atrium_at_ostium, left_atrium_surface
from lasso_motion_ros.overlay.surface import TriangleMesh, write_stl
from lasso_motion_ros.overlay.windowing import RgbImage
from lasso_motion_ros.reports.demo_artefacts import DemoArtefacts, DemoRun, write_demo_artefacts
from lasso_motion_ros.stream.recorded_pairs import recorded_pairs
from msg_adapters.messages import stamp_to_ns
from msg_adapters.recordings.evaluation_input import read_estimates, read_truth
from msg_adapters.recordings.reader import RecordingReader, check_tracking_topics
from msg_adapters.topics import overlay_topic, seed_topic

HELP = """Play a recording in real time to the tracker and the overlay, each a process of its own, over DDS on this
machine, and write what comes over the wire: a video of the overlay, plots, and a table of the errors. With --web:
play it over and over instead, with a page in the browser to look at it and to click."""

LIMITS: Mapping[str, float] = {
    "missing": 0,
    "lost_in_silence": 0,
    "error_2d_a_mm": 1.0,
    "error_2d_b_mm": 1.0,
    "target_error_mm": 1.5,
}
"""What the bundled recording's table may show at most: every pair has a pose, no pose is more than 2 mm off, and the
2-D error is no larger than the published method's (1.0 mm in each plane)."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("--bag", type=Path, metavar="FILE", help="the recording to play (default: the bundled one)")
    parser.add_argument(
        "--out", type=Path, default=Path("demo_output"), metavar="DIR", help="where to write (default: demo_output)"
    )
    parser.add_argument("--config", type=Path, metavar="FILE", help="tracker parameters (default: config/tracker.yaml)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every measure, pair by pair")
    parser.add_argument("--web", action="store_true", help="a page in the browser; plays over and over until stopped")
    parser.add_argument(
        "--port", type=port, default=DEFAULT_PORT, help=f"with --web: TCP port (default {DEFAULT_PORT})"
    )


def run(args: argparse.Namespace) -> int:
    """Run the demonstration; returns the exit status, 0 when every pair was answered and no limit is exceeded."""
    require_ros()
    from lasso_motion_ros.tools.demonstration import DemonstrationInput, run_graph

    recording: Path = args.bag or bundled_recording()
    configuration: Path = args.config or share_file("config/tracker.yaml")
    if args.web:
        return _run_page(args, recording, configuration)
    pairs = read_pairs(recording, load_configuration(configuration, StreamConfig))
    truth = _truth(recording)
    surface = demo_surface(truth)
    args.out.mkdir(parents=True, exist_ok=True)
    surface_file = args.out / "left_atrium.stl"
    write_stl(surface_file, surface, "mm")
    given = DemonstrationInput(
        recording=recording,
        configuration=configuration,
        surface=surface_file,
        whole_pairs=sum(pair.a is not None and pair.b is not None for pair in pairs),
        pictures={plane: sum(pair.frame(plane) is not None for pair in pairs) for plane in PLANES},
        directory=args.out,
    )
    live = run_graph(given, (lambda line: None) if args.quiet else print)
    demo = DemoRun(
        name=recording.stem,
        pairs=pairs,
        estimates=read_estimates(live),
        overlays=read_pictures(live),
        surface=surface,
        truth=truth,
    )
    with busy("writing video, plots and table", args.quiet):
        artefacts = write_demo_artefacts(demo, args.out)
    if args.json is not None and artefacts.scores:
        write_json(args.json, report({demo.name: artefacts.scores}))
    _report(demo, artefacts, live)
    exceeded = exceeded_limits(artefacts.summary) if args.bag is None else []
    if exceeded:
        raise LassoMotionError(f"the table is above its limits: {'; '.join(exceeded)}")
    return EXIT_DONE


def _run_page(args: argparse.Namespace, recording: Path, configuration: Path) -> int:
    from lasso_motion_ros.tools.page_demonstration import PageInput, run_page

    topics = RecordingReader(recording).topics
    check_tracking_topics(recording, topics)
    seeded = all(seed_topic(plane).recorded_name in topics for plane in PLANES)
    load_configuration(configuration, StreamConfig)
    truth = _truth(recording)
    surface_file: Path | None = None
    args.out.mkdir(parents=True, exist_ok=True)
    if truth is not None and truth.loop is not None:
        surface_file = args.out / "left_atrium.stl"
        write_stl(surface_file, demo_surface(truth), "mm")
    elif not args.quiet:
        print("no overlay: the recording has no truth that tells where a made-up atrium would have to be")
    # The address is a result: without it --quiet would start a page that nobody finds.
    run_page(PageInput(recording, configuration, surface_file, seeded, DEFAULT_HOST, args.port, args.out), print)
    return EXIT_DONE


def read_pairs(recording: Path, config: StreamConfig) -> list[FramePair]:
    """The pairs in a recording, by the rule by which the node pairs them.

    Raises:
        RecordingError: the recording cannot be read, lacks a topic, or was cut short.
    """
    reader = RecordingReader(recording)
    check_tracking_topics(recording, reader.topics)
    pairs = list(recorded_pairs(reader, config))
    if reader.damage is not None:
        raise RecordingError(f"{reader.damage}: the demonstration needs a whole recording")
    return pairs


def write_demo_surface(recording: Path, path: Path) -> None:
    """Write the surface that fits a recording (see `demo_surface`) as STL, millimetres.

    Raises:
        SurfaceError: the file cannot be written.
    """
    write_stl(path, demo_surface(_truth(recording)), "mm")


def demo_surface(truth: Truth | None) -> TriangleMesh:
    """A left atrium with the lasso in the ostium of a vein; about the world's origin where no truth tells the place."""
    if truth is None or truth.loop is None:
        return left_atrium_surface()
    centre = truth.loop.mean(axis=0)
    _, _, axes = np.linalg.svd(truth.loop - centre)
    radius = float(np.linalg.norm(truth.loop - centre, axis=1).mean())
    return atrium_at_ostium(centre, axes[2], 2.0 * radius)


def exceeded_limits(summary: Summary | None) -> list[str]:
    """What in a table is above `LIMITS`, in words."""
    if summary is None:
        return ["there is no truth to measure against"]
    values = asdict(summary)
    return [
        f"{name} is {'unknown' if values[name] is None else format(values[name], '.3g')}, at most {limit:g} is allowed"
        for name, limit in LIMITS.items()
        if values[name] is None or values[name] > limit
    ]


def read_pictures(live: Path) -> dict[Plane, dict[int, RgbImage]]:
    """The overlay pictures in a live recording: per plane, by the image's stamp (ns), (H, W, 3) uint8 RGB."""
    plane_of: dict[str, Plane] = {overlay_topic(plane).recorded_name: plane for plane in PLANES}
    pictures: dict[Plane, dict[int, RgbImage]] = {plane: {} for plane in PLANES}
    for recorded in RecordingReader(live).messages(list(plane_of)):
        message = recorded.message
        picture = np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, 3)
        pictures[plane_of[recorded.topic]][stamp_to_ns(message.header.stamp)] = picture
    return pictures


def _truth(recording: Path) -> Truth | None:
    try:
        return read_truth(recording).truth
    except RecordingError:
        return None


def _report(demo: DemoRun, artefacts: DemoArtefacts, live: Path) -> None:
    if artefacts.table_text is not None:
        print(artefacts.table_text.read_text(encoding="utf-8"))
    files = (
        ("video", artefacts.video),
        ("motion", artefacts.motion_plot),
        ("2-D error", artefacts.error_plot),
        ("table", artefacts.table_text),
        ("table, JSON", artefacts.table_json),
        ("what came over the wire", live),
    )
    for what, path in files:
        if path is not None:
            print(f"{what}: {path}")
    poses = sum(estimate.motion_raw is not None for estimate in demo.estimates)
    line = f"{len(demo.pairs)} pairs played, {len(demo.estimates)} answered, {poses} with a pose"
    summary = artefacts.summary
    if summary is not None and summary.error_2d_a_mm is not None and summary.error_2d_b_mm is not None:
        line += f"; 2-D error {summary.error_2d_a_mm:.2f} mm in plane A, {summary.error_2d_b_mm:.2f} mm in plane B"
    if summary is not None and summary.target_error_mm is not None and summary.static_error_mm is not None:
        line += (
            f"; target error {summary.target_error_mm:.2f} mm, without compensation {summary.static_error_mm:.2f} mm"
        )
    print(line)
