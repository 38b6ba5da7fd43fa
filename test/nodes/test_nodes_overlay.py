"""The overlay node as a real process over DDS: when it compensates, when it says that it does not."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")
pytest.importorskip("trimesh", reason="needs the overlay extra")

import rclpy
from rcl_interfaces.srv import ListParameters
from support.drawn_recording import SIDE, projections, shift, stamp
from support.node_harness import Graph

from lasso_motion_ros.geometry.frames import Frame
from lasso_motion_ros.geometry.transforms import apply
from lasso_motion_ros.nodes.overlay_node import OverlayNode
from lasso_motion_ros.overlay.painter import OverlayPainter
from lasso_motion_ros.overlay.surface_files import read_surface, write_stl
from lasso_motion_ros.overlay.triangle_mesh import TriangleMesh
from lasso_motion_ros.tools.processes import free_domain
from msg_adapters import topics
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.images import encode_image
from msg_adapters.markers import ADD, DELETE, encode_line_strip
from msg_adapters.messages import RosMessages, header_fields, stamp_to_ns
from msg_adapters.poses import decode_pose, encode_pose_stamped

pytestmark = pytest.mark.ros

PICTURES = tuple(make(plane) for plane in "ab" for make in (topics.overlay_drawn_topic, topics.overlay_topic))
IMAGE = np.random.default_rng(3).integers(90, 160, (SIDE, SIDE), dtype=np.uint8)


def exposure(pair: int) -> np.ndarray:
    """The image of a pair: no exposure is as the last."""
    return np.roll(IMAGE, pair, axis=0)


REGISTRATION = shift(4.0)


class Bench:
    """The overlay node, and all that it listens to."""

    def __init__(self, graph: Graph, directory: Path, *parameters: str) -> None:
        self.graph = graph
        self._surface = directory / "tetrahedron.stl"
        corners = 0.03 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], np.float64)
        faces = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]], np.int32)
        write_stl(self._surface, TriangleMesh(corners, faces), "mm")
        given = (f"volume_file:={self._surface}", "units:=mm", "registration:='0 0 0.004 0 0 0 1'", *parameters)
        words = [word for parameter in given for word in ("-p", parameter)]
        graph.client(ListParameters, "/lasso_overlay/list_parameters")
        node = graph.processes.start_node("overlay", "lasso_overlay", ["--ros-args", *words])
        self.process = node.pid
        inputs = [
            *(topics.camera_info_topic(plane) for plane in "ab"),
            topics.image_topic("a"),
            topics.compressed_image_topic("b"),
            topics.MOTION,
            topics.CATHETER,
            topics.STATE,
        ]
        self._publishers = {topic.name: graph.publisher(topic, latched=topic.latched) for topic in inputs}
        graph.wait_until(lambda: all(publisher.get_subscription_count() for publisher in self._publishers.values()))
        self._state = ""
        self._renewal = graph.listener.node.create_timer(topics.STATE_RENEWED_S, self._renew)
        # The node knows of this listener's subscriptions once it has told it that nothing is compensated.
        graph.heard.wait_for(lambda: bool(graph.heard.messages["overlay/surface"]))

    def send(self, topic: topics.Topic, fields: dict[str, Any]) -> None:
        self._publishers[topic.name].publish(RosMessages().make(topic.type_name, fields))

    def motion(self, pair: int, z_mm: float, frame: str = "patient_table") -> None:
        self.send(topics.MOTION, encode_pose_stamped(shift(z_mm), header_fields(stamp(pair), frame)))

    def state(self, state: str) -> None:
        """Say a state, and again every second, as a tracker does."""
        self._state = state
        self._renew()

    def _renew(self) -> None:
        if self._state:
            self.send(topics.STATE, {"data": self._state})

    def fall_silent(self) -> None:
        """Say no state any more, as a tracker that was killed."""
        self._state = ""

    def image(self, plane: str, pair: int, later_ns: int = 0) -> None:
        header = header_fields(stamp(pair) + later_ns, f"detector_{plane}")
        self.send(topics.camera_info_topic(plane), encode_camera_info(projections()[plane], header))
        if plane == "a":
            self.send(topics.image_topic(plane), encode_image(exposure(pair), header))
        else:  # as image_transport compresses them
            data = cv2.imencode(".png", exposure(pair))[1].reshape(-1)
            self.send(topics.compressed_image_topic(plane), {"header": header, "format": "png", "data": data})

    def fence(self) -> None:
        """Let the node go through what it has received."""
        for _ in range(5):
            self.graph.call(ListParameters, "/lasso_overlay/list_parameters", ListParameters.Request())

    def picture(self, plane: str, pair: int, later_ns: int = 0) -> np.ndarray:
        """The picture that answers an image, (H, W, 3)."""
        messages = self.graph.heard.messages[f"plane_{plane}/overlay"]
        wanted = stamp(pair) + later_ns
        self.graph.heard.wait_for(lambda: any(stamp_to_ns(m.header.stamp) == wanted for m in messages))
        return self._pixels(plane, next(m for m in messages if stamp_to_ns(m.header.stamp) == wanted))

    def drawn(self, plane: str, pair: int, times: int = 1) -> list[str]:
        """The frames of the motions with which an image was drawn, once it was drawn so often."""
        messages = self.graph.heard.messages[f"plane_{plane}/overlay/drawn"]

        def found() -> list[str]:
            return [message.frame_id for message in messages if stamp_to_ns(message.stamp) == stamp(pair)]

        self.graph.heard.wait_for(lambda: len(found()) >= times)
        return found()

    def last_picture(self, plane: str) -> np.ndarray:
        return self._pixels(plane, self.graph.heard.messages[f"plane_{plane}/overlay"][-1])

    def _pixels(self, plane: str, message: Any) -> np.ndarray:
        assert (message.encoding, message.header.frame_id) == ("rgb8", f"detector_{plane}")
        return np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, 3)

    def catheter(self, pair: int, loop: np.ndarray) -> None:
        header = header_fields(stamp(pair), "patient_table")
        self.send(topics.CATHETER, encode_line_strip(loop, header, "catheter"))

    def expected(
        self, plane: str, pair: int, z_mm: float | None, status: str = "", loop: np.ndarray | None = None
    ) -> np.ndarray:
        """What must be drawn: the surface at its registration, moved, or static with words."""
        surface = read_surface(self._surface, "mm").moved(REGISTRATION)
        motion = None if z_mm is None else shift(z_mm)
        return OverlayPainter(surface).draw(exposure(pair), projections()[plane], motion, status, loop=loop)


@pytest.fixture
def graph(tmp_path: Path) -> Iterator[Graph]:
    with Graph((*PICTURES, topics.OVERLAY_SURFACE), tmp_path) as started:
        yield started


def test_an_image_is_drawn_with_its_own_motion_and_the_lasso_of_its_pair(graph: Graph, tmp_path: Path) -> None:
    bench = Bench(graph, tmp_path, "motion_wait_s:=5.0")
    bench.state("TRACKING")
    for pair, z_mm in enumerate((0.0, 6.0)):
        bench.image("a", pair)
        bench.image("b", pair, later_ns=20_000_000)
        bench.fence()  # the images are there before their motion
        bench.motion(pair, z_mm)
        bench.picture("a", pair)
    np.testing.assert_array_equal(bench.picture("a", 1), bench.expected("a", 1, 6.0))
    np.testing.assert_array_equal(bench.picture("b", 1, 20_000_000), bench.expected("b", 1, 6.0))
    # The picture may be there before the surface, which is on a topic of its own.
    markers = graph.heard.messages["overlay/surface"]
    graph.heard.wait_for(lambda: stamp_to_ns(markers[-1].header.stamp) == stamp(1))
    marker = markers[-1]
    assert (marker.action, len(marker.points)) == (ADD, 12)
    np.testing.assert_allclose(decode_pose(marker.pose), shift(6.0), atol=1e-12)
    assert max(point.z for point in marker.points) == pytest.approx(0.034)

    angle = np.linspace(0.0, 2.0 * np.pi, 65)
    ring = 0.012 * np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=1)
    for pair, z_mm in ((2, 0.0), (3, 6.0)):
        bench.motion(pair, z_mm)
        bench.catheter(pair, apply(shift(z_mm), ring))
        bench.fence()
        bench.image("a", pair)
    expected = bench.expected("a", 3, 6.0, loop=apply(shift(6.0), ring))
    assert (expected != bench.expected("a", 3, 6.0)).any()
    np.testing.assert_array_equal(bench.picture("a", 3), expected)


def test_without_its_motion_it_is_drawn_with_the_last_and_its_age_then_static(graph: Graph, tmp_path: Path) -> None:
    bench = Bench(graph, tmp_path, "motion_wait_s:=0.0", "motion_timeout_s:=0.6")
    bench.state("TRACKING")
    bench.motion(0, 5.0)
    graph.heard.wait_for(lambda: graph.heard.messages["overlay/surface"][-1].action == ADD)
    bench.image("a", 1)
    np.testing.assert_array_equal(bench.picture("a", 1), bench.expected("a", 1, 5.0, "motion 0.25 s old"))
    bench.image("a", 3)
    np.testing.assert_array_equal(bench.picture("a", 3), bench.expected("a", 3, None, "motion 0.8 s old"))
    assert bench.drawn("a", 1) == ["patient_table"]
    assert bench.drawn("a", 3) == [""]
    graph.heard.wait_for(lambda: graph.heard.messages["overlay/surface"][-1].action == DELETE)


def test_in_a_state_without_a_pose_the_picture_says_so(graph: Graph, tmp_path: Path) -> None:
    bench = Bench(graph, tmp_path, "motion_wait_s:=0.0")
    surface, pictures = graph.heard.messages["overlay/surface"], graph.heard.messages["plane_a/overlay"]
    for pair, state in ((0, "LOST"), (2, "WAITING_FOR_SEED")):
        bench.state("TRACKING")
        bench.motion(pair, 5.0)
        graph.heard.wait_for(lambda: surface[-1].action == ADD)
        bench.image("a", pair)
        np.testing.assert_array_equal(bench.picture("a", pair), bench.expected("a", pair, 5.0))
        before = len(pictures)
        bench.state(state)
        graph.heard.wait_for(lambda: surface[-1].action == DELETE)
        # No image has come since: what stands on the screen is drawn again.
        graph.heard.wait_for(lambda before=before: len(pictures) == before + 1)
        np.testing.assert_array_equal(bench.last_picture("a"), bench.expected("a", pair, None, state))
        assert bench.drawn("a", pair, times=2) == ["patient_table", ""]
        bench.image("a", pair + 1)
        np.testing.assert_array_equal(bench.picture("a", pair + 1), bench.expected("a", pair + 1, None, state))


def test_a_tracker_that_says_nothing_any_more_is_not_compensated_with(graph: Graph, tmp_path: Path) -> None:
    bench = Bench(graph, tmp_path, "motion_wait_s:=0.0", "motion_timeout_s:=60.0")
    bench.state("TRACKING")
    bench.motion(0, 5.0)
    bench.image("a", 0)
    np.testing.assert_array_equal(bench.picture("a", 0), bench.expected("a", 0, 5.0))
    bench.fall_silent()
    graph.heard.wait_for(lambda: graph.heard.messages["overlay/surface"][-1].action == DELETE)
    graph.heard.wait_for(lambda: len(graph.heard.messages["plane_a/overlay"]) == 2)
    silent = [bench.expected("a", 0, None, f"tracker silent for {seconds} s") for seconds in (2, 3, 4)]
    assert any((bench.last_picture("a") == one).all() for one in silent)
    bench.state("TRACKING")
    bench.motion(1, 6.0)
    bench.image("a", 1)
    np.testing.assert_array_equal(bench.picture("a", 1), bench.expected("a", 1, 6.0))


def test_slower_than_the_images_it_draws_both_planes_of_one_pair(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else one who shows both planes' pictures would never have both of one pair."""
    surface = tmp_path / "triangle.stl"
    write_stl(surface, TriangleMesh(np.eye(3), np.array([[0, 1, 2]], np.int32)), "m")
    rclpy.init(args=["--ros-args", "-p", f"volume_file:={surface}", "-p", "units:=m"], domain_id=free_domain())
    drawn: list[tuple[str, int]] = []
    enough = threading.Event()
    try:
        node = OverlayNode()
        node._history.answered = lambda plane, stamp_ns: True  # their motion is always there

        def bring(pair: int) -> None:
            for plane in "ab":
                node._take(plane, [Frame(stamp(pair), IMAGE, projections()[plane])])

        def draw(plane: str, frame: Frame, choice: Any) -> None:
            """While each is drawn, the next pair's images come."""
            drawn.append((plane, frame.stamp_ns))
            bring(len(drawn))
            if len(drawn) == 8:
                node._stopping = True
                enough.set()

        monkeypatch.setattr(node, "_draw", draw)
        bring(0)
        node.start()
        assert enough.wait(30.0)
        node.close()
        node.destroy_node()
    finally:
        rclpy.shutdown()
    of_a, of_b = ({stamp_ns for plane, stamp_ns in drawn if plane == wanted} for wanted in "ab")
    assert len(of_a & of_b) == 4


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere all threads of a process are equally nice")
def test_before_a_tracker_is_heard_it_is_static_and_the_thread_that_draws_and_no_other_stands_back(
    graph: Graph, tmp_path: Path
) -> None:
    bench = Bench(graph, tmp_path, "niceness:=7")
    bench.image("b", 0)
    np.testing.assert_array_equal(bench.picture("b", 0), bench.expected("b", 0, None))
    threads = [int(task.name) for task in Path(f"/proc/{bench.process}/task").iterdir()]
    own = os.getpriority(os.PRIO_PROCESS, bench.process)
    nice = [os.getpriority(os.PRIO_PROCESS, thread) - own for thread in threads]
    assert sorted(nice) == [0] * (len(nice) - 1) + [7]


def test_a_motion_in_another_frame_is_refused_and_the_node_ends_cleanly(graph: Graph, tmp_path: Path) -> None:
    bench = Bench(graph, tmp_path, "motion_wait_s:=0.0")
    bench.state("TRACKING")
    bench.motion(0, 5.0, frame="map")
    graph.wait_until(lambda: "motion is in frame 'map', expected 'patient_table'" in graph.processes.log("overlay"))
    bench.image("a", 0)
    np.testing.assert_array_equal(bench.picture("a", 0), bench.expected("a", 0, None, "no motion yet"))
    graph.processes.send("overlay", signal.SIGINT)
    assert graph.wait_for_end("overlay") == 0


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ([], "volume_file: the surface or volume to draw must be given"),
        (["volume_file:=/none.stl", "units:=mm"], "/none.stl: cannot be read"),
        (["volume_file:=/none.stl", "units:=inch"], "units must be one of "),
    ],
)
def test_without_a_surface_it_ends_with_one_line(
    graph: Graph, tmp_path: Path, parameters: list[str], message: str
) -> None:
    words = [word for parameter in parameters for word in ("-p", parameter)]
    graph.processes.start_node("overlay", "lasso_overlay", ["--ros-args", *words])
    assert graph.wait_for_end("overlay") == 2
    said = graph.processes.log("overlay", 50)
    assert message in said
    assert len(said.splitlines()) == 1
