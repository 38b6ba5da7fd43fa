"""Whatever is started first, the clicks are heard; and under `use_sim_time` everything goes on and ends."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")
pytest.importorskip("trimesh", reason="needs the overlay extra")

from support.drawn_recording import stamp, write_input
from support.node_harness import Graph
from support.rendering_inputs import torus_mesh
from support.ring_stream import HEARD, SIDE, RingStream, diagnosed, displacement_mm, start_tracker
from support.ring_stream import stamp as live_stamp

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.nodes.diagnostics import DROPPED_PAIRS
from lasso_motion_ros.overlay.surface_files import write_stl
from lasso_motion_ros.stream.drawn_ring import ring_seed
from msg_adapters import topics
from msg_adapters.messages import RosMessages, header_fields, stamp_to_ns
from msg_adapters.seeds import encode_polygon

pytestmark = pytest.mark.ros

MOTIONS_MM = [0.0, 1.0, 3.0, 5.0, 6.0, 5.0, 3.0, 1.0]
SIM_TIME = "use_sim_time:=true"


def tracked(graph: Graph) -> None:
    """Wait until every pair of the recording has its pose, the clicked first one included.

    The tracker's counts tell: it may publish before it has learnt of this process. On a machine that takes half a
    second for a model, it leaves out some of the pairs that came meanwhile.
    """

    def told() -> int:
        counts = diagnosed(graph, "tracker")
        return int(counts.get("poses", 0)) + int(counts.get(DROPPED_PAIRS, 0))

    graph.heard.wait_for(lambda: told() == len(MOTIONS_MM))
    references = graph.heard.messages["reference"]
    graph.heard.wait_for(lambda: bool(references))
    assert [stamp_to_ns(message.stamp) for message in references] == [stamp(0)]
    heard = graph.heard.messages["motion"]
    graph.heard.wait_for(lambda: bool(heard) and stamp_to_ns(heard[-1].header.stamp) == stamp(len(MOTIONS_MM) - 1))
    expected = {stamp(pair): z_mm for pair, z_mm in enumerate(MOTIONS_MM)}
    for message in heard:
        assert abs(1e3 * message.pose.position.z - expected[stamp_to_ns(message.header.stamp)]) < 0.5


def test_the_two_commands_of_the_readme(tmp_path: Path) -> None:
    """No option at all; the player comes first, and a recorder that hears all before it: the clicks are not for it."""
    recording = write_input(tmp_path / "ring.mcap", MOTIONS_MM, truth=False)
    with Graph(HEARD, tmp_path) as graph:
        graph.processes.start("recorder", "lasso_motion_ros.cli.main", ["record", str(tmp_path / "all.mcap")])
        graph.wait_until(lambda: "recording into" in graph.processes.log("recorder"))
        graph.processes.start("player", "lasso_motion_ros.cli.main", ["play", str(recording)])
        graph.wait_until(lambda: "waiting for subscribers on" in graph.processes.log("player"))
        graph.processes.start_node("tracker", "lasso_tracker")
        tracked(graph)
        assert graph.wait_for_end("player") == 0
        assert "they are there: playing" in graph.processes.log("player")


def test_under_sim_time_with_a_clock_that_stops(tmp_path: Path) -> None:
    """The overlay's subscriptions do not pass for the tracker's, and both end though time stands still."""
    recording = write_input(tmp_path / "ring.mcap", MOTIONS_MM, truth=False)
    write_stl(tmp_path / "torus.stl", torus_mesh(24, 8), "mm")
    surface = ["-p", f"volume_file:={tmp_path / 'torus.stl'}", "-p", "units:=mm"]
    with Graph((*HEARD, topics.OVERLAY_SURFACE), tmp_path) as graph:
        graph.processes.start_node("overlay", "lasso_overlay", ["--ros-args", "-p", SIM_TIME, *surface])
        graph.heard.wait_for(lambda: len(graph.heard.messages["overlay/surface"]) > 0)
        graph.processes.start("player", "lasso_motion_ros.cli.main", ["play", str(recording), "--clock"])
        graph.processes.start_node("tracker", "lasso_tracker", ["--ros-args", "-p", SIM_TIME])
        tracked(graph)
        assert graph.wait_for_end("player") == 0
        graph.processes.send("tracker", signal.SIGTERM)
        graph.processes.send("overlay", signal.SIGINT)
        assert graph.wait_for_end("tracker") == graph.wait_for_end("overlay") == 0


class LatchedClicks:
    """Clicks on the ring in one plane, latched: whoever comes late hears the last ones."""

    def __init__(self, graph: Graph) -> None:
        self._publishers = {plane: graph.publisher(topics.seed_topic(plane), latched=True) for plane in PLANES}

    def click(self, plane: Plane, stamp_ns: int) -> None:
        points = ring_seed(SIDE, displacement_mm(stamp_ns)).points(plane)
        fields = encode_polygon(points, header_fields(stamp_ns))
        self._publishers[plane].publish(RosMessages().make(topics.seed_topic(plane).type_name, fields))


def test_clicks_before_everything_else_without_a_clock(tmp_path: Path) -> None:
    """Latched before the tracker runs, kept until there are images, and never in silence; time stands still."""
    with Graph(HEARD, tmp_path) as graph:
        stream, clicks = RingStream(graph), LatchedClicks(graph)
        for plane in PLANES:
            clicks.click(plane, live_stamp(0))
        start_tracker(graph, SIM_TIME)
        waits = "plane A's clicks wait for the image at 1760000000.000000000 s; no calibrated image has come"
        graph.heard.wait_for(lambda: waits in stream.values("tracker").get("message", ""))
        stream.said(f"seed: {waits}")
        stream.connect()
        stream.expect(stream.pairs(3))
        assert stream.references() == [live_stamp(0)]  # heard once, though by two subscriptions

        stream.reset()
        clicks.click("b", live_stamp(5000))  # of a clock that is ahead
        graph.heard.wait_for(lambda: "plane A has no clicks yet" in stream.values("tracker")["message"])
        again = stream.pairs(1)[0]
        stream.await_count("tracker", "pairs answered", stream.number)
        clicks.click("a", again)
        stream.said("plane_b/seed: the clicks of both planes must be on one pair")
        graph.heard.wait_for(
            lambda: "WAITING_FOR_SEED: plane B has no clicks yet" in stream.values("tracker")["message"]
        )
        clicks.click("b", again)
        graph.heard.wait_for(lambda: stream.references()[-1:] == [again])
        stream.expect([again, *stream.pairs(2)])
        stream.nothing_wrong()
        graph.processes.send("tracker", signal.SIGINT)
        assert graph.wait_for_end("tracker") == 0
