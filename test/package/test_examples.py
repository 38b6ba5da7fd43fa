"""The examples, as they stand, over real DDS: an angiography system in, tracked motion out, a consumer that follows."""

from __future__ import annotations

import itertools
import re
import runpy
import time
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
from msg_adapters.images import encode_image
from msg_adapters.messages import RosMessages, header_fields, stamp_to_ns
from msg_adapters.poses import decode_pose, encode_pose_stamped
from msg_adapters.seeds import encode_polygon
from msg_adapters.topics import MOTION, OUTPUTS, REFERENCE, STATE, Topic, camera_info_topic, image_topic, seed_topic

EXAMPLES = ROOT / "examples"
COMPENSATION = runpy.run_path(str(EXAMPLES / "overlay_consumer.py"))["Compensation"]
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


@pytest.mark.ros
def test_the_bridge_feeds_the_tracker_through_gantry_and_table_motion(graph: Graph, sequence: Path) -> None:
    parameters = ["--ros-args", "--params-file", str(share_file("config/tracker.yaml"))]
    graph.processes.start("tracker", "support.brisk_tracker", ["lasso_tracker", *parameters])
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


def consumer() -> Any:
    """What the example keeps, apart from its node; the volume is registered 100 mm from the world's origin."""
    return COMPENSATION(rigid((0, 0, 0), (0.1, 0, 0)))


def moved(z_mm: float) -> Any:
    return rigid((0, 0, 0), (0, 0, 1e-3 * z_mm))


def drawn_mm(compensation: Any, stamp_ns: int) -> tuple[bool, str, list[float]]:
    place = compensation.place(stamp_ns)
    return place.compensated, place.remark, (1e3 * place.transform[:3, 3]).round(6).tolist()


def test_nothing_is_compensated_before_state_reference_and_motion_are_there() -> None:
    compensation = consumer()
    assert drawn_mm(compensation, 100) == (False, "no state yet", [100, 0, 0])
    compensation.take_motion(100, moved(5))
    compensation.take_state("TRACKING")
    assert drawn_mm(compensation, 100) == (False, "no reference yet", [100, 0, 0])
    assert compensation.take_reference(50)
    assert drawn_mm(compensation, 100) == (True, "", [100, 0, 5])
    assert drawn_mm(compensation, 99) == (False, "no motion yet", [100, 0, 0])


def test_an_image_has_the_motion_with_its_own_stamp() -> None:
    compensation = tracking_consumer({100: 1.0, 200: 2.0, 300: 3.0})
    assert drawn_mm(compensation, 200) == (True, "", [100, 0, 2])
    assert drawn_mm(compensation, 300) == (True, "", [100, 0, 3])
    assert not compensation.awaits(300)
    assert compensation.awaits(400)


def test_a_motion_that_is_late_is_stood_in_for_until_it_is_stale() -> None:
    compensation = tracking_consumer({0: 2.0})
    assert drawn_mm(compensation, 400_000_000) == (True, "motion 0.40 s old", [100, 0, 2])
    assert drawn_mm(compensation, 1_100_000_000) == (False, "motion 1.1 s old", [100, 0, 0])
    compensation.take_state("DEGRADED")
    assert drawn_mm(compensation, 400_000_000) == (True, "DEGRADED, motion 0.40 s old", [100, 0, 2])


@pytest.mark.parametrize("state", ["LOST", "DISPLACED", "WAITING_FOR_SEED", "INACTIVE"])
def test_a_state_without_a_motion_ends_all_motions_before_it(state: str) -> None:
    compensation = tracking_consumer({100: 2.0})
    compensation.take_state(state)
    assert drawn_mm(compensation, 100) == (False, state, [100, 0, 0])
    assert not compensation.awaits(200)
    compensation.take_state("TRACKING")
    assert drawn_mm(compensation, 200) == (False, "no motion yet", [100, 0, 0])


def test_a_recording_that_starts_anew_is_not_drawn_with_the_motions_of_its_end() -> None:
    compensation = tracking_consumer({9_000_000_000: 2.0})
    compensation.take_motion(100, moved(1))
    assert drawn_mm(compensation, 9_000_000_000) == (False, "motion 9.0 s old", [100, 0, 0])


def test_a_set_reference_leaves_the_volume_where_it_lay() -> None:
    compensation = tracking_consumer({100: 5.0, 200: 7.0})
    compensation.take_motion(300, moved(1))  # on the new reference: it has overtaken the word of it
    assert compensation.take_reference(200)
    assert drawn_mm(compensation, 200) == (True, "", [100, 0, 7])
    assert drawn_mm(compensation, 300) == (True, "", [100, 0, 8])
    assert compensation.take_reference(200)  # said again to a late joiner: nothing new
    assert drawn_mm(compensation, 300) == (True, "", [100, 0, 8])


@pytest.mark.parametrize("overtaken", [False, True], ids=["in-order", "overtaken"])
def test_new_clicks_ask_for_a_new_registration(overtaken: bool) -> None:
    compensation = tracking_consumer({100: 5.0})
    if overtaken:
        compensation.take_motion(900, moved(0))
    assert not compensation.take_reference(900)


def tracking_consumer(motions_mm: dict[int, float]) -> Any:
    compensation = consumer()
    assert compensation.take_reference(0)
    compensation.take_state("TRACKING")
    for stamp_ns, z_mm in motions_mm.items():
        compensation.take_motion(stamp_ns, moved(z_mm))
    return compensation


def test_motions_are_not_kept_for_ever() -> None:
    compensation = tracking_consumer(dict.fromkeys(range(1000), 1.0))
    assert drawn_mm(compensation, 899) == (False, "no motion yet", [100, 0, 0])
    assert drawn_mm(compensation, 900) == (True, "", [100, 0, 1])


def drawn(graph: Graph) -> dict[int, str]:
    """What the consumer has said of each image it drew, by stamp."""
    said = graph.processes.log("consumer", lines=10_000)
    return {int(stamp): what for stamp, what in re.findall(r"image (\d+): (.*) mm", said)}


@pytest.mark.ros
def test_the_consumer_draws_each_image_with_its_own_motion(graph: Graph) -> None:
    topics = {topic.name: topic for topic in (REFERENCE, STATE, MOTION, image_topic("a"))}
    publishers = {name: graph.publisher(topic, latched=topic.latched) for name, topic in topics.items()}
    graph.processes.start("consumer", "examples.overlay_consumer")
    graph.wait_until(lambda: all(one.get_subscription_count() == 2 for one in publishers.values()))  # the harness too
    stamps = itertools.count(1_000_000_000, 1000)

    states: list[str] = []

    def state(value: str) -> None:
        states[:] = [value]

    def say(topic: Topic, fields: Any) -> None:
        publishers[topic.name].publish(RosMessages().make(topic.type_name, fields))

    def show_until(z_mm: float | None, expected: str) -> int:
        """Images, each with its motion where there is one, until one of them is drawn as expected: its stamp.

        What was said on another topic before them may be heard after the first, and the very first may not be heard.
        """
        shown: list[int] = []
        as_expected: list[int] = []

        def show() -> bool:
            shown.append(next(stamps))
            say(STATE, {"data": states[-1]})  # as a tracker does, again and again
            say(image_topic("a"), encode_image(np.zeros((8, 8), np.uint8), header_fields(shown[-1])))
            if z_mm is not None:
                say(MOTION, encode_pose_stamped(moved(z_mm), header_fields(shown[-1])))
            so_far = drawn(graph)
            as_expected[:] = [stamp_ns for stamp_ns in shown if so_far.get(stamp_ns) == expected]
            return bool(as_expected)

        graph.wait_until(show)
        return as_expected[0]

    state("TRACKING")
    show_until(5.0, "UNCOMPENSATED (no reference yet), volume at [0. 0. 0.]")
    say(REFERENCE, header_fields(1))
    at_ns = show_until(5.0, "compensated, volume at [0. 0. 5.]")
    show_until(7.0, "compensated, volume at [0. 0. 7.]")
    show_until(None, "compensated (motion 0.00 s old), volume at [0. 0. 7.]")
    say(REFERENCE, header_fields(at_ns))  # ~/set_reference
    show_until(1.0, "compensated, volume at [0. 0. 6.]")
    state("LOST")
    show_until(None, "UNCOMPENSATED (LOST), volume at [0. 0. 5.]")
    say(REFERENCE, header_fields(9))  # other clicks
    graph.wait_until(lambda: "register the volume at it again" in graph.processes.log("consumer", lines=10_000))

    def show_in_silence() -> bool:
        say(image_topic("a"), encode_image(np.zeros((8, 8), np.uint8), header_fields(next(stamps))))
        return "UNCOMPENSATED (the tracker is silent)" in graph.processes.log("consumer")

    graph.wait_until(show_in_silence)
