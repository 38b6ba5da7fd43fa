"""RViz and Foxglove files and the launch files: they name topics, frames and nodes that exist."""

from __future__ import annotations

import atexit
import json
import re
import runpy
import sys
import types
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import yaml
from support.paths import ROOT

from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.tracking.tracker import TrackerState
from msg_adapters import topics

PUBLISHED = {
    topic.recorded_name
    for topic in (
        *topics.OUTPUTS,
        topics.DIAGNOSTICS,
        topics.OVERLAY_SURFACE,
        *(make(plane) for plane in PLANES for make in (topics.overlay_topic, topics.tracking_topic)),
    )
}


def test_rviz_shows_topics_that_we_publish() -> None:
    document = yaml.safe_load((ROOT / "config" / "lasso_motion.rviz").read_text(encoding="utf-8"))
    manager = document["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] == "patient_table"
    shown = {f"/{one['Topic']['Value']}" for one in manager["Displays"] if "Topic" in one}
    assert {"/plane_a/overlay", "/plane_b/overlay", "/catheter", "/overlay/surface"} <= shown <= PUBLISHED


def test_foxglove_shows_topics_that_we_publish_and_places_every_panel() -> None:
    text = (ROOT / "config" / "foxglove_layout.json").read_text(encoding="utf-8")
    layout = json.loads(text)
    named = set(re.findall(r'"(/[a-z_/]+)[".]', text))
    assert {"/plane_a/overlay", "/plane_b/overlay", "/motion", "/state", "/catheter"} <= named <= PUBLISHED

    def leaves(node: Any) -> list[str]:
        return [node] if isinstance(node, str) else [*leaves(node["first"]), *leaves(node["second"])]

    assert sorted(leaves(layout["layout"])) == sorted(layout["configById"])
    states = {rule["rawValue"] for rule in layout["configById"]["Indicator!state"]["rules"]}
    assert states == {state.value for state in TrackerState}


class Recorded:
    """Stands in for any class of launch and launch_ros: keeps its arguments, and its kind."""

    def __init__(self, *args: Any, **keywords: Any) -> None:
        self.args, self.keywords = args, keywords

    def perform(self, context: dict[str, str]) -> str:
        return context[self.args[0]]


@pytest.fixture
def launch(monkeypatch: pytest.MonkeyPatch) -> None:
    """The launch libraries are no Python packages of their own: stand-ins that keep what they are given."""

    class Anything(types.ModuleType):
        def __getattr__(self, name: str) -> type[Recorded]:
            if name.startswith("__"):
                raise AttributeError(name)
            made = type(name, (Recorded,), {})
            setattr(self, name, made)
            return made

    for name in (
        "ament_index_python",
        "ament_index_python.packages",
        "launch",
        "launch.actions",
        "launch.conditions",
        "launch.substitutions",
        "launch.launch_description_entity",
        "launch.launch_description_sources",
        "launch_ros",
        "launch_ros.actions",
        "launch_ros.substitutions",
        "launch_ros.parameter_descriptions",
    ):
        monkeypatch.setitem(sys.modules, name, Anything(name))


def described(name: str) -> dict[str, list[Any]]:
    """What a launch file starts and declares, by kind."""
    module = runpy.run_path(str(ROOT / "launch" / name))
    found: dict[str, list[Any]] = {}
    for entity in module["generate_launch_description"]().args[0]:
        found.setdefault(type(entity).__name__, []).append(entity)
    return found


@pytest.mark.usefixtures("launch")
@pytest.mark.parametrize(
    ("name", "executables"),
    [
        ("tracker.launch.py", ["lasso_tracker"]),
        ("lasso_motion.launch.py", ["lasso_tracker", "lasso_overlay", "lasso_web"]),
    ],
)
def test_launch_files_start_the_nodes(name: str, executables: list[str]) -> None:
    nodes = described(name)["Node"]
    assert [node.keywords["executable"] for node in nodes] == executables
    scripts = (ROOT / "setup.py").read_text(encoding="utf-8")
    for node in nodes:
        if node.keywords["package"] == "lasso_motion_ros":
            assert f'f"{node.keywords["executable"]} = ' in scripts


@pytest.mark.usefixtures("launch")
@pytest.mark.parametrize("wanted", ["true", "auto", "false"])
def test_rviz_is_shown_where_it_is_wanted(wanted: str) -> None:
    """Here everything passes for installed; `test/package/test_launch_files.py` tries it where it is not."""
    found = described("lasso_motion.launch.py")
    nodes = found["OpaqueFunction"][0].keywords["function"]({"rviz": wanted})
    shown = [] if wanted == "false" else ["static_transform_publisher", "rviz2"]
    assert [node.keywords["executable"] for node in nodes] == shown


@pytest.mark.usefixtures("launch")
def test_the_demo_plays_the_recording_to_the_system(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("rclpy")
    at_the_end: list[Callable[[], None]] = []
    monkeypatch.setattr(
        atexit, "register", lambda work, *args, **keywords: at_the_end.append(partial(work, *args, **keywords))
    )
    found = described("demo.launch.py")
    defaults = {one.args[0]: one.keywords["default_value"] for one in found["DeclareLaunchArgument"]}
    included, played = found["OpaqueFunction"][0].keywords["function"](defaults)
    words = played.keywords["cmd"][1:]
    assert words[:2] == ["play", defaults["bag"]]
    arguments = dict(included.keywords["launch_arguments"])
    surface = Path(arguments["volume_file"])
    assert surface.stat().st_size > 100_000
    assert arguments["units"] == "mm"
    for work in at_the_end:
        work()
    assert not surface.parent.exists()
    system = described("lasso_motion.launch.py")
    assert set(arguments) <= {one.args[0] for one in system["DeclareLaunchArgument"]}
