"""The examples, as they stand, over real DDS: an angiography system in, tracked motion out, a consumer that follows."""

from __future__ import annotations

import itertools
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.paths import ROOT

pytest.importorskip("rclpy", reason="needs ROS 2")

from support.node_harness import Graph

from lasso_motion_ros.core.share import share_file
from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.transforms import rigid
from lasso_motion_ros.stream.drawn_ring import ring_image, ring_points
from msg_adapters.messages import RosMessages, header_fields, stamp_to_ns
from msg_adapters.poses import decode_pose, encode_pose_stamped
from msg_adapters.seeds import encode_polygon
from msg_adapters.topics import MOTION, OUTPUTS, REFERENCE, STATE, camera_info_topic, image_topic, seed_topic

pytestmark = pytest.mark.ros

EXAMPLES = ROOT / "examples"
SIDE, PAIRS, PERIOD_S = 512, 10, 0.4
# Of the ring in the world, which the table carries, millimetres.
MOTION_MM = [np.array([0.0, 0.0, z]) for z in (0, 1, 3, 5, 6, 6, 5, 3, 1, 0)]
# The gantry turns from the fourth pair on, and the table moves: neither may show in the motion.
LAO_DEG = {"a": [-30.0] * 4 + [-28.0] * 6, "b": [60.0] * 4 + [61.0] * 6}
CRANIAL_DEG = {"a": [5.0] * PAIRS, "b": [0.0] * PAIRS}
TABLE_MM = np.array([[0.0, 0.0, 0.0]] * 6 + [[0.0, 0.0, 8.0]] * 4)


def projection(plane: str, pair: int) -> Any:
    return carm_projection(
        np.radians(LAO_DEG[plane][pair]),
        np.radians(CRANIAL_DEG[plane][pair]),
        source_detector_m=1.2,
        source_object_m=0.785,
        pixel_size_m=0.4e-3,
        width=SIDE,
        height=SIDE,
        iso_centre=-1e-3 * TABLE_MM[pair],
    )


@pytest.fixture
def sequence(tmp_path: Path) -> Path:
    generator = np.random.default_rng(3)
    arrays: dict[str, Any] = {
        "source_detector_mm": 1200.0,
        "source_object_mm": 785.0,
        "pixel_mm": 0.4,
        "table_mm": TABLE_MM,
    }
    for plane in ("a", "b"):
        arrays[f"frames_{plane}"] = np.stack(
            [ring_image(plane, SIDE, motion, generator, projection(plane, k)) for k, motion in enumerate(MOTION_MM)]
        )
        arrays[f"time_{plane}_s"] = PERIOD_S * np.arange(PAIRS)
        arrays[f"lao_{plane}_deg"], arrays[f"cranial_{plane}_deg"] = LAO_DEG[plane], CRANIAL_DEG[plane]
    path = tmp_path / "sequence.npz"
    np.savez(path, **arrays)
    return path


@pytest.fixture
def graph(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    monkeypatch.setenv("PYTHONPATH", str(EXAMPLES.parent))
    # Whoever knows of the last knows of all: who listens to the images listens to their calibrations.
    planes = [make(plane) for make in (camera_info_topic, image_topic) for plane in "ab"]
    with Graph([*planes, *(topic for topic in OUTPUTS if topic is not STATE), STATE], tmp_path) as started:
        yield started


def clicks(plane: str) -> Any:
    """On the next pair that comes, the first."""
    points = projection(plane, 0).project(ring_points())[:-1:18]
    return RosMessages().make(seed_topic(plane).type_name, encode_polygon(points, header_fields(0)))


def test_the_bridge_feeds_the_tracker_through_gantry_and_table_motion(graph: Graph, sequence: Path) -> None:
    parameters = ["--ros-args", "--params-file", str(share_file("config/tracker.yaml"))]
    graph.processes.start("tracker", "lasso_motion_ros.nodes.lasso_tracker", parameters)
    graph.heard.wait_for(lambda: graph.heard.messages["state"] != [])
    seeds = {plane: graph.publisher(seed_topic(plane)) for plane in "ab"}
    graph.wait_until(lambda: all(one.get_subscription_count() for one in seeds.values()))
    for plane, publisher in seeds.items():
        publisher.publish(clicks(plane))
    # The tracker subscribes once somebody publishes; then the bridge waits for it as well as for the listener here.
    planes = [make(plane) for plane in "ab" for make in (image_topic, camera_info_topic)]
    beside = [graph.publisher(topic) for topic in planes]
    graph.wait_until(lambda: all(one.get_subscription_count() >= 2 for one in beside))
    before = time.time_ns()
    graph.processes.start("bridge", "examples.angio_bridge", [str(sequence), "--wait", "30", "--subscribers", "2"])
    graph.heard.wait_for(lambda: len(graph.heard.messages["motion"]) == PAIRS)
    assert graph.wait_for_end("bridge") == 0

    for plane in "ab":
        heard = graph.heard.messages
        images, infos = heard[f"plane_{plane}/image_raw"], heard[f"plane_{plane}/camera_info"]
        assert images
        assert all(image.header in [info.header for info in infos] for image in images)
        assert {message.header.frame_id for message in images} == {f"plane_{plane}_optical"}
    poses = {stamp_to_ns(message.header.stamp): decode_pose(message) for message in graph.heard.messages["motion"]}
    began = min(poses)
    for pair, motion_mm in enumerate(MOTION_MM):
        (found,) = [pose for at, pose in poses.items() if abs(at - began - round(pair * PERIOD_S * 1e9)) < 1_000_000]
        assert np.linalg.norm(1e3 * found[:3, 3] - motion_mm) < 0.5, pair
    # The system's clock is 20 minutes behind; the stamps are this machine's, at the exposure.
    assert before <= began <= max(poses) <= time.time_ns()


def said(graph: Graph) -> str:
    return graph.processes.log("consumer", lines=10_000)


def place(graph: Graph) -> list[tuple[str, list[float]]]:
    """What the consumer has said: state and place of the volume, millimetres."""
    return [
        (state, [float(number) for number in numbers.split()])
        for state, numbers in re.findall(r"(\w*): volume at \[(.*)\] mm", said(graph))
    ]


@pytest.mark.parametrize("overtaken", [False, True], ids=["in-order", "overtaken"])
def test_the_consumer_follows_motion_loss_and_a_new_reference(graph: Graph, overtaken: bool) -> None:
    outlets = {topic.name: graph.publisher(topic, latched=topic.latched) for topic in (REFERENCE, STATE, MOTION)}

    def say(topic: Any, fields: Any) -> None:
        outlets[topic.name].publish(RosMessages().make(topic.type_name, fields))

    def move(stamp_ns: int, z_mm: float) -> tuple[str, list[float]]:
        pose = encode_pose_stamped(rigid((0, 0, 0), (0, 0, 1e-3 * z_mm)), header_fields(stamp_ns))
        before = len(place(graph))
        say(MOTION, pose)
        graph.wait_until(lambda: len(place(graph)) == before + 1)
        return place(graph)[-1]

    def move_until_drawn(stamps_ns: Iterator[int], z_mm: float, drawn: tuple[str, list[float]]) -> None:
        """What is said on another topic before a pose may be heard after it: from one of the next poses on."""
        graph.wait_until(lambda: move(next(stamps_ns), z_mm) == drawn)

    say(REFERENCE, header_fields(100))
    say(STATE, {"data": "TRACKING"})
    graph.processes.start("consumer", "examples.overlay_consumer")
    graph.wait_until(lambda: outlets["motion"].get_subscription_count() == 2)  # the harness listens too
    graph.wait_until(lambda: outlets["state"].get_subscription_count() == 2)
    graph.wait_until(lambda: outlets["reference"].get_subscription_count() == 2)
    move_until_drawn(itertools.count(200), 5.0, ("TRACKING", [0.0, 0.0, 5.0]))
    say(STATE, {"data": "LOST"})
    graph.wait_until(lambda: "LOST: the volume is drawn uncompensated" in said(graph))
    say(STATE, {"data": "TRACKING"})
    assert move(1300, 7.0)[1] == [0.0, 0.0, 7.0]
    if overtaken:
        assert move(1400, 1.0)[1] == [0.0, 0.0, 1.0]
    say(REFERENCE, header_fields(1300))  # ~/set_reference at the pair last tracked
    # 1 mm from where it was drawn at 1300: it has not jumped.
    move_until_drawn(itertools.count(1401), 1.0, ("TRACKING", [0.0, 0.0, 8.0]))
    assert "new reference" not in said(graph)
    if overtaken:
        move(9000, 0.0)
    say(REFERENCE, header_fields(9000))  # other clicks
    graph.wait_until(lambda: "new reference: register the volume at it again" in said(graph))


def test_the_consumer_fits_on_a_page() -> None:
    assert len((EXAMPLES / "overlay_consumer.py").read_text().splitlines()) <= 40
