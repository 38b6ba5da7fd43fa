"""The SROS2 policy names exactly what the running nodes publish, hear, serve and call; the launch file, its nodes."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from support.paths import ROOT

pytest.importorskip("rclpy", reason="needs ROS 2")
pytest.importorskip("trimesh", reason="needs the overlay extra")

from support.node_harness import Graph

from lasso_motion_ros.core.share import share_file
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.overlay.surface_files import write_stl
from lasso_motion_ros.overlay.triangle_mesh import TriangleMesh
from lasso_motion_ros.tools.listened_topics import RECORDED
from msg_adapters.recorded_messages import RecordedMessages
from msg_adapters.recordings.writer import RecordingWriter
from msg_adapters.topics import (
    DIAGNOSTICS,
    GROUND_TRUTH,
    INPUTS,
    OUTPUTS,
    OVERLAY_SURFACE,
    STATE,
    TF,
    click_topic,
    compressed_image_topic,
    overlay_topic,
    tracking_topic,
)

Rights = dict[str, set[str]]
KINDS = {
    "publish": "publisher_names_and_types",
    "subscribe": "subscriber_names_and_types",
    "reply": "service_names_and_types",
    "request": "client_names_and_types",
}
# The page listens to the pictures only while a browser looks at them.
ON_DEMAND = {f"/plane_{plane}/{picture}" for plane in PLANES for picture in ("tracking", "overlay", "overlay/drawn")}

# Heard only while nobody publishes raw images.
INSTEAD = {compressed_image_topic(plane).recorded_name for plane in PLANES}


def policy() -> dict[str, Rights]:
    """Node name → what it may do, with full names."""
    rights: dict[str, Rights] = {}
    for enclave in ElementTree.parse(share_file("config/sros2_policy.xml")).getroot().iter("enclave"):
        for profile in enclave.iter("profile"):
            node = profile.attrib["node"]
            assert enclave.attrib["path"] == f"/lasso_motion/{node}"
            allowed: Rights = {kind: set() for kind in KINDS}
            for group in profile:
                for kind, qualifier in group.attrib.items():
                    assert qualifier == "ALLOW"
                    names = [full_name(entry.text or "", profile.attrib["ns"], node) for entry in group]
                    assert len(names) == len(set(names))
                    allowed[kind] |= set(names)
            rights[node] = allowed
    return rights


def full_name(name: str, namespace: str, node: str) -> str:
    if name.startswith("~"):
        name = node + name[1:]
    return name if name.startswith("/") else f"{namespace.rstrip('/')}/{name}"


def live_rights(graph: Graph, node: str) -> Rights:
    """What a running node does; nothing while it is not discovered."""
    try:
        return {
            kind: {name for name, _ in getattr(graph.listener.node, f"get_{what}_by_node")(node, "/")}
            for kind, what in KINDS.items()
        }
    except Exception:  # rclpy's NodeNameNonExistentError
        return {kind: set() for kind in KINDS}


@pytest.fixture
def graph(tmp_path: Path) -> Any:
    with Graph([], tmp_path) as started:
        yield started


def assert_exact(graph: Graph, node: str, on_demand: frozenset[str] | set[str] = frozenset()) -> None:
    """Wait until the node has all that it is allowed (but what it does on demand), and see that it has no more."""
    allowed = policy()[node]

    def settled() -> bool:
        live = live_rights(graph, node)
        return all(allowed[kind] - on_demand <= live[kind] for kind in KINDS)

    try:
        graph.wait_until(settled)
    except AssertionError:
        live = live_rights(graph, node)
        missing = {kind: sorted(allowed[kind] - on_demand - live[kind]) for kind in KINDS}
        raise AssertionError(f"{node} is allowed what it does not do: {missing}") from None
    live = live_rights(graph, node)
    beyond = {kind: sorted(live[kind] - allowed[kind]) for kind in KINDS if live[kind] - allowed[kind]}
    assert not beyond, f"{node} does what it is not allowed"


@pytest.mark.ros
def test_the_nodes_do_exactly_what_the_policy_allows(graph: Graph, tmp_path: Path) -> None:
    publishers = [graph.publisher(topic, latched=topic.latched) for topic in RECORDED]
    surface = tmp_path / "surface.stl"
    corners = 0.03 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], np.float64)
    write_stl(surface, TriangleMesh(corners, np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]], np.int32)), "mm")
    volume = ["--ros-args", "-p", f"volume_file:={surface}", "-p", "units:=mm"]
    graph.processes.start_node("tracker", "lasso_tracker")
    graph.processes.start_node("overlay", "lasso_overlay", volume)
    graph.processes.start_node("web", "lasso_web", ["--ros-args", "-p", "port:=0"])
    assert_exact(graph, "lasso_tracker", INSTEAD | {TF.name})  # where tf2_msgs is installed
    assert_exact(graph, "lasso_overlay", INSTEAD)
    assert_exact(graph, "lasso_web", INSTEAD | ON_DEMAND)
    assert publishers


@pytest.mark.ros
def test_the_commands_do_exactly_what_the_policy_allows(graph: Graph, tmp_path: Path) -> None:
    publishers = [graph.publisher(topic, latched=topic.latched) for topic in RECORDED]
    graph.processes.start("record", "lasso_motion_ros.cli.main", ["record", str(tmp_path / "out.mcap")])
    graph.processes.start("check", "lasso_motion_ros.cli.main", ["check", "--seconds", "60"])
    assert_exact(graph, "lasso_recorder", INSTEAD)
    assert_exact(graph, "lasso_check", INSTEAD)
    assert publishers


@pytest.mark.ros
def test_the_player_does_exactly_what_the_policy_allows(graph: Graph, tmp_path: Path) -> None:
    recording = tmp_path / "all.mcap"
    made = (tracking_topic, overlay_topic, click_topic, compressed_image_topic)
    pictures = [make(plane) for make in made for plane in PLANES]
    with RecordingWriter(recording) as writer:
        for topic in (*INPUTS, *OUTPUTS, *GROUND_TRUTH, DIAGNOSTICS, OVERLAY_SURFACE, *pictures):
            message = RecordedMessages().make(topic.type_name, {})
            for seconds in (1, 60):
                writer.write(topic.recorded_name, topic.type_name, message, seconds * 10**9, latched=topic.latched)
    graph.processes.start("player", "lasso_motion_ros.cli.main", ["play", str(recording), "--all", "--clock"])
    assert_exact(graph, "lasso_player")


def test_every_node_that_is_launched_or_installed_has_its_rights() -> None:
    launched = set()
    for path in (ROOT / "launch").glob("*.py"):
        for call in ast.walk(ast.parse(path.read_text())):
            if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "Node":
                words = {word.arg: getattr(word.value, "value", None) for word in call.keywords}
                if not (isinstance(words["executable"], str) and words["executable"].startswith("lasso_")):
                    continue  # somebody else's node (RViz, a transform): its rights are not ours to give
                assert words["name"] == words["executable"], path
                launched.add(words["name"])
    code = "import json, setuptools; setuptools.setup = lambda **words: print(json.dumps(words['entry_points'])); "
    code += "exec(compile(open('setup.py').read(), 'setup.py', 'exec'))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, encoding="utf-8", check=True)
    scripts = {line.split("=")[0].strip() for line in json.loads(done.stdout)["console_scripts"]}
    assert launched
    assert launched <= scripts
    assert scripts - {"lasso-motion"} <= policy().keys()


def test_a_private_or_absolute_name_is_read_as_sros2_reads_it() -> None:
    assert full_name("~/reset", "/lab", "lasso_tracker") == "/lab/lasso_tracker/reset"
    assert full_name(STATE.name, "/lab", "lasso_tracker") == "/lab/state"
    assert full_name("/diagnostics", "/lab", "lasso_tracker") == "/diagnostics"
