"""The demonstrations: a recording through the live graph, with video, plots and table, or with the page beside it."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from lasso_motion_ros.config.overlay import OverlayConfig
from lasso_motion_ros.config.parameters import load_configuration
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.core.output_files import whole_directory
from lasso_motion_ros.core.progress import busy
from lasso_motion_ros.evaluation.recorded_input import read_estimates
from lasso_motion_ros.evaluation.summary import Summary
from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane
from lasso_motion_ros.overlay.surface_files import write_stl
from lasso_motion_ros.overlay.windowing import RgbImage
from lasso_motion_ros.reports.demo_artefacts import ARTEFACTS, DemoArtefacts, DemoRun, write_demo_artefacts
from lasso_motion_ros.stream.recorded_pairs import recorded_pairs
from lasso_motion_ros.tools.child_graph import LOGS
from lasso_motion_ros.tools.demo_surface import demo_surface, truth_if_any
from msg_adapters.messages import stamp_to_ns
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.recordings.tracking_topics import check_tracking_topics
from msg_adapters.topics import overlay_topic, seed_topic

SURFACE = "left_atrium.stl"
LIVE_RECORDING = "live.mcap"
DEMO_FILES = (*ARTEFACTS, SURFACE, LIVE_RECORDING)
"""What the demonstration leaves in its directory, beside the logs."""
LIMITS: Mapping[str, float] = {
    "missing": 0,
    "lost_in_silence": 0,
    "error_2d_a_mm": 1.0,
    "error_2d_b_mm": 1.0,
    "target_error_mm": 1.5,
}
"""What the bundled recording's table may show at most: every pair has a pose, no pose is more than 2 mm off, and the
2-D error is no larger than the published method's (1.0 mm in each plane)."""


@dataclass(frozen=True, eq=False)
class Demonstration:
    """The outcome.

    Attributes:
        run: what was played, and what came over the wire.
        artefacts: what was written of it.
        live: the recording of what came over the wire.
    """

    run: DemoRun
    artefacts: DemoArtefacts
    live: Path


def demonstrate(
    recording: Path, configuration: Path, directory: Path, say: Callable[[str], None], *, quiet: bool = True
) -> Demonstration:
    """Play a recording through the live graph in real time; write video, plots and table, all or none.

    Args:
        recording: what is played; it must be whole.
        configuration: the tracker's parameter file.
        directory: where all goes; made if need be.
        say: takes one line of progress for the user.
        quiet: True shows no progress.

    Raises:
        LassoMotionError: a file that cannot be read or written, or a process that failed or did not answer in time.
        KeyboardInterrupt: interrupted; no process is left behind.
    """
    from lasso_motion_ros.tools.live_graph import DemonstrationInput, run_graph

    pairs = read_pairs(recording, load_configuration(configuration, StreamConfig))
    truth = truth_if_any(recording)
    surface = demo_surface(truth)
    with whole_directory(directory, DEMO_FILES) as staged:
        write_stl(staged / SURFACE, surface, "mm")
        live = staged / LIVE_RECORDING
        given = DemonstrationInput(
            recording=recording,
            configuration=configuration,
            surface=staged / SURFACE,
            whole_pairs=sum(pair.is_whole for pair in pairs),
            pictures={plane: sum(plane not in pair.missing for pair in pairs) for plane in PLANES},
            live=live,
            logs=directory / LOGS,
        )
        run_graph(given, say)
        run = DemoRun(
            name=recording.stem,
            pairs=pairs,
            estimates=read_estimates(live),
            overlays=read_pictures(live),
            surface=surface,
            truth=truth,
        )
        with busy("writing video, plots and table", quiet):
            artefacts = write_demo_artefacts(run, staged)
    return Demonstration(run, artefacts.moved(directory), directory / LIVE_RECORDING)


def demonstrate_page(
    recording: Path,
    configuration: Path,
    directory: Path,
    say: Callable[[str], None],
    *,
    host: str,
    port: int,
    quiet: bool = True,
) -> None:
    """Play a recording over and over, with a page in the browser beside it, until SIGINT or SIGTERM.

    Args:
        recording: what is played.
        configuration: the tracker's parameter file.
        directory: where the logs go; made if need be.
        say: takes a line for the user: where the page is.
        host: address of the page.
        port: TCP port of the page.
        quiet: True does not say why there is no overlay.

    Raises:
        LassoMotionError: a file that cannot be read or written, or a process that failed; none is left behind.
    """
    from lasso_motion_ros.tools.page_demonstration import PageInput, run_page

    seeded = check_page_input(recording, configuration)
    truth = truth_if_any(recording)
    with tempfile.TemporaryDirectory(prefix="lasso_motion_") as working:
        overlay: OverlayConfig | None = None
        if truth is not None and truth.loop is not None:
            surface = Path(working) / SURFACE
            write_stl(surface, demo_surface(truth), "mm")
            overlay = OverlayConfig(volume_file=str(surface), units="mm")
        elif not quiet:
            say("no overlay: the recording has no truth that tells where a made-up atrium would have to be")
        page = ("--host", host, "--port", str(port))
        run_page(PageInput(recording, configuration, overlay, seeded, page, directory), say)


def check_page_input(recording: Path, configuration: Path) -> bool:
    """Look at what is to be played, and to which tracker, before processes are started.

    Returns:
        Whether the recording has clicks.

    Raises:
        LassoMotionError: a recording that is none of biplane X-ray, or a parameter file that is not allowed.
    """
    topics = RecordingReader(recording).topics
    check_tracking_topics(recording, topics)
    load_configuration(configuration, StreamConfig)
    return all(seed_topic(plane).recorded_name in topics for plane in PLANES)


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


def read_pictures(live: Path) -> dict[Plane, dict[int, RgbImage]]:
    """The overlay pictures in a live recording: per plane, by the image's stamp (ns), (H, W, 3) uint8 RGB."""
    plane_of: dict[str, Plane] = {overlay_topic(plane).recorded_name: plane for plane in PLANES}
    pictures: dict[Plane, dict[int, RgbImage]] = {plane: {} for plane in PLANES}
    for recorded in RecordingReader(live).messages(list(plane_of)):
        message = recorded.message
        picture = np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, 3)
        # Once the recording has ended, the last image is drawn again, without motion.
        pictures[plane_of[recorded.topic]].setdefault(stamp_to_ns(message.header.stamp), picture)
    return pictures


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


def describe(shown: Demonstration) -> list[str]:
    """The table, where the files are, and the main figures in a sentence."""
    artefacts, run = shown.artefacts, shown.run
    lines = [] if artefacts.table_text is None else [artefacts.table_text.read_text(encoding="utf-8")]
    files = (
        ("video", artefacts.video),
        ("motion", artefacts.motion_plot),
        ("2-D error", artefacts.error_plot),
        ("table", artefacts.table_text),
        ("table, JSON", artefacts.table_json),
        ("what came over the wire", shown.live),
    )
    lines += [f"{what}: {path}" for what, path in files if path is not None]
    poses = sum(estimate.motion_raw is not None for estimate in run.estimates)
    line = f"{len(run.pairs)} pairs played, {len(run.estimates)} answered, {poses} with a pose"
    summary = artefacts.summary
    if summary is not None and summary.error_2d_a_mm is not None and summary.error_2d_b_mm is not None:
        line += f"; 2-D error {summary.error_2d_a_mm:.2f} mm in plane A, {summary.error_2d_b_mm:.2f} mm in plane B"
    if summary is not None and summary.target_error_mm is not None and summary.static_error_mm is not None:
        line += (
            f"; target error {summary.target_error_mm:.2f} mm, without compensation {summary.static_error_mm:.2f} mm"
        )
    return [*lines, line]
