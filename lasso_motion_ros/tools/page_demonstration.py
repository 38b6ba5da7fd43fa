"""The page with all that it shows: tracker, overlay and page on a recording that plays again and again, or the overlay
and the page beside a graph that is running.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import yaml

from lasso_motion_ros.config.overlay import OverlayConfig
from lasso_motion_ros.config.parameters import configuration_values
from lasso_motion_ros.core.output_files import make_directory
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.nodes.ros_start import chosen_domain
from lasso_motion_ros.tools.child_graph import LOGS, START_WAIT_S, child_graph
from lasso_motion_ros.tools.player import TUNING, round_period_ns
from lasso_motion_ros.tools.processes import free_domain, stay_on_this_machine
from msg_adapters.messages import NANOSECONDS, stamp_to_ns
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.recordings.tracking_topics import recorded_image_topic

READY = "the page is at "
OVERLAY_PARAMETERS = "overlay.yaml"
ROS_DEFAULT_DOMAIN = 0


@dataclass(frozen=True)
class PageInput:
    """What is shown, and where.

    Attributes:
        recording: what is played; None: a graph that is running.
        configuration: the tracker's parameter file.
        overlay: the overlay's parameters; None: no overlay.
        seeded: whether the recording has clicks.
        page: arguments of the page: `--host`, `--port`, …
        directory: where the processes' logs go.
        ros: arguments of ROS for page and overlay, as behind `--ros-args`.
    """

    recording: Path | None
    configuration: Path | None
    overlay: OverlayConfig | None
    seeded: bool
    page: Sequence[str]
    directory: Path
    ros: Sequence[str] = ()


def run_page(given: PageInput, say: Callable[[str], None]) -> None:
    """Run the page with all that it shows until SIGINT or SIGTERM; a recording is played over and over.

    Args:
        given: what to show.
        say: takes a line for the user.

    Raises:
        LassoMotionError: a process failed; none is left behind.
    """
    stay_on_this_machine()
    # A domain that the user has chosen is kept, so that other tools see the graph.
    domain = chosen_domain() or (ROS_DEFAULT_DOMAIN if given.recording is None else free_domain())
    logs = given.directory / LOGS
    make_directory(logs)
    with contextlib.suppress(KeyboardInterrupt), child_graph(domain, logs) as graph:
        if given.configuration is not None:
            graph.start_tracker(given.configuration)
        if given.overlay is not None:
            parameters = logs / OVERLAY_PARAMETERS
            parameters.write_text(_parameter_file(given.overlay), encoding="utf-8")
            words = ["--ros-args", "--params-file", str(parameters), *given.ros]
            graph.start_node("overlay", "lasso_overlay", words)
        told = [*_rounds(given.recording), *given.ros]
        graph.start_command("page", "web", *given.page, *(["--ros-args", *told] if told else []))
        graph.wait_until(
            lambda: READY in graph.log("page", 50),
            START_WAIT_S,
            f"the page has not come up within {START_WAIT_S:g} s; see {logs}",
        )
        url = graph.log("page", 50).partition(READY)[2].split()[0]
        if given.recording is not None:
            listeners = 2 if given.overlay is None else 3
            # Clicks that come with the recording come in each round; a user's are to hold, so nothing may begin anew.
            again = "--loop" if given.seeded else "--endless"
            words = [again, "--wait", str(START_WAIT_S), "--subscribers", str(listeners)]
            graph.start_command("player", "play", str(given.recording), *words)
        say(f"open {url} in a browser (ROS_DOMAIN_ID={domain}, this machine only); Ctrl-C ends it")
        graph.wait_until(lambda: False)


def _rounds(recording: Path | None) -> list[str]:
    """ROS arguments that tell the page which stamp of an endless stream is which one of the recording."""
    if recording is None:
        return []
    reader = RecordingReader(recording)
    names = [recorded_image_topic(plane, reader.topics).recorded_name for plane in PLANES]
    firsts = [first.message for name in names if (first := next(iter(reader.messages([name])), None)) is not None]
    if not firsts:
        return []
    first_ns = min(stamp_to_ns(one.header.stamp) for one in firsts) - round(TUNING.round_pause_s * NANOSECONDS / 2)
    values = {"first_ns": first_ns, "period_ns": round_period_ns(reader)}
    return [word for name, value in values.items() for word in ("-p", f"rounds.{name}:={value}")]


def _parameter_file(overlay: OverlayConfig) -> str:
    """The overlay's parameters as ROS parameter YAML."""
    return yaml.safe_dump({"/**/lasso_overlay": {"ros__parameters": configuration_values(overlay)}})
