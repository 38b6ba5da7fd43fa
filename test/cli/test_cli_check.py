"""`lasso-motion check` on a live graph, over real DDS."""

from __future__ import annotations

import json
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from support.drawn_recording import SIDE, projections
from support.node_harness import Graph

from lasso_motion_ros.cli.main import main
from lasso_motion_ros.tools import examiner
from lasso_motion_ros.tools.processes import LOOPBACK, free_domain
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.images import encode_image
from msg_adapters.messages import RosMessages, header_fields, ns_to_stamp
from msg_adapters.topics import STATE, Topic, camera_info_topic, image_topic

pytestmark = pytest.mark.ros

PERIOD_S = 0.1
MESSAGES = RosMessages()


@pytest.fixture
def graph(tmp_path: Path) -> Any:
    with Graph([], tmp_path) as started:
        yield started


@pytest.fixture
def figures(tmp_path: Path) -> Path:
    return tmp_path / "check.json"


class Bridge:
    """Publishes both planes from this process, exposed at 10 pairs/s by this machine's clock.

    The stamps are as regular as those of a detector, though a busy machine may send an image late.
    """

    def __init__(self, graph: Graph, *, reliable: bool = True, prefix: str = "", scale: float = 1.0) -> None:
        def publisher(topic: Topic, kind: bool) -> Any:
            return graph.publisher(Topic(prefix + topic.name, topic.type_name), reliable=kind)

        picture = np.add.outer(np.arange(SIDE), np.arange(SIDE)).astype(np.uint16)
        self._publishers = []
        for plane, projection in projections().items():
            info = encode_camera_info(projection, header_fields(0, "xray"))
            info["p"] = info["p"] * np.array([1, 1, 1, scale] * 3)
            for topic, fields, kind in (
                (camera_info_topic(plane), info, True),
                (image_topic(plane), encode_image(picture, header_fields(0, "xray")), reliable),
            ):
                self._publishers.append((publisher(topic, kind), MESSAGES.make(topic.type_name, fields)))

    def publish(self, exposed_ns: int) -> None:
        stamp = MESSAGES.make("builtin_interfaces/msg/Time", ns_to_stamp(exposed_ns))
        for publisher, message in self._publishers:
            message.header.stamp = stamp
            publisher.publish(message)

    def heard(self) -> bool:
        return all(publisher.get_subscription_count() for publisher, _ in self._publishers)

    def publish_until(self, done: Callable[[], bool]) -> None:
        tick, exposed_ns = threading.Event(), time.time_ns()
        while not done():
            self.publish(exposed_ns)
            exposed_ns += round(PERIOD_S * 1e9)
            tick.wait(max(0.0, 1e-9 * (exposed_ns - time.time_ns())))


def start(graph: Graph, *arguments: str) -> None:
    graph.processes.start("check", "lasso_motion_ros.cli.main", ["check", *arguments])


def ended(graph: Graph) -> bool:
    return "check" in graph.processes.ended()


def answer(figures: Path) -> dict[str, Any]:
    return json.loads(figures.read_text(encoding="utf-8"))  # type: ignore[no-any-return]


def test_a_sound_graph(graph: Graph, figures: Path) -> None:
    bridge = Bridge(graph)
    start(graph, "--json", str(figures), "--seconds", "3")
    bridge.publish_until(lambda: ended(graph))
    found = answer(figures)
    assert graph.wait_for_end("check") == 0
    assert [(one["severity"], one["problem"]) for one in found["findings"]] == [("note", "no clicks yet")]
    assert found["facts"]["pairs"] > 1
    assert found["facts"]["plane_b"]["sizes"] == ["512x512"]


def test_best_effort_images_that_get_lost_are_told_from_other_faults(graph: Graph, figures: Path) -> None:
    """A check held up for a while loses what a reader held up, or a small shared memory, would lose."""
    bridge = Bridge(graph, reliable=False)
    # It looks for long enough to go on when it is let, however long the images take that it is held up for.
    start(graph, "--json", str(figures), "--seconds", "8")
    graph.wait_until(bridge.heard)
    for _ in range(4):
        bridge.publish(time.time_ns())
    graph.processes.send("check", signal.SIGSTOP)
    for _ in range(100):
        bridge.publish(time.time_ns())
    graph.processes.send("check", signal.SIGCONT)
    bridge.publish_until(lambda: ended(graph))
    found = [one for one in answer(figures)["findings"] if "were lost" in one["problem"] and "image" in one["subject"]]
    assert {one["subject"] for one in found} == {"/plane_a/image_raw", "/plane_b/image_raw"}
    assert all("/lasso_listener publishes best effort" in one["problem"] for one in found)
    assert all("config/fastdds.xml" in one["cure"] for one in found)


def test_millimetres_and_a_namespace(graph: Graph, figures: Path) -> None:
    bridge = Bridge(graph, prefix="lab/", scale=1e3)
    start(graph, "--json", str(figures), "--seconds", "3", "--namespace", "lab")
    bridge.publish_until(lambda: ended(graph))
    assert graph.wait_for_end("check") == 2
    errors = [one for one in answer(figures)["findings"] if one["severity"] == "error"]
    assert {one["subject"] for one in errors} == {"/plane_a/camera_info", "/plane_b/camera_info"}
    assert all("looks like millimetres" in one["problem"] for one in errors)


def test_what_is_found_late_in_a_tracking_system_is_looked_at_in_full(graph: Graph, figures: Path) -> None:
    """The time to look begins with the first publisher; a tracker that tracks has had its clicks."""
    start(graph, "--json", str(figures), "--seconds", "1.8")
    node = graph.listener.node
    graph.wait_until(lambda: "lasso_check" in node.get_node_names())
    threading.Event().wait(2.0)  # longer than it looks
    bridge, state = Bridge(graph), graph.publisher(STATE, latched=True)
    state.publish(MESSAGES.make(STATE.type_name, {"data": "TRACKING"}))
    bridge.publish_until(lambda: ended(graph))
    assert answer(figures)["findings"] == []
    assert answer(figures)["facts"]["state"] == "TRACKING"
    assert graph.wait_for_end("check") == 0


def test_an_empty_graph(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """In this process: to wait for somebody as long as on a busy machine would show no more."""
    monkeypatch.setattr(examiner, "DISCOVERY_WAIT_S", 0.5)
    for name, value in {"ROS_DOMAIN_ID": str(free_domain()), **LOOPBACK}.items():
        monkeypatch.setenv(name, value)
    assert main(["check", "--seconds", "0.5"]) == 2
    lines = capsys.readouterr().out.splitlines()
    assert "error    /plane_a/image_raw: nobody publishes it -> publish sensor_msgs/msg/Image there" in lines
    assert lines[-1] == "the tracker cannot work with this"
