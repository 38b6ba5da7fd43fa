"""The tracker node as a real process over DDS, on a small drawn recording whose truth is known."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from std_srvs.srv import Trigger
from support.drawn_recording import START_NS, stamp, write_input
from support.node_harness import Graph, recorded

from lasso_motion_ros.core.share import share_file
from lasso_motion_ros.evaluation.recorded_input import read_estimates
from lasso_motion_ros.tools.offline_tracking import track_recording
from msg_adapters import topics
from msg_adapters.images import decode_image, encode_image
from msg_adapters.messages import RosMessages, header_fields, stamp_to_ns
from msg_adapters.poses import decode_pose
from msg_adapters.recordings.reader import RecordingReader

pytestmark = pytest.mark.ros

MOTIONS_MM = [0.0, 1.0, 3.0, 5.0, 6.0, 5.0, 3.0, 1.0]
STAMPS = [stamp(pair) for pair in range(len(MOTIONS_MM))]
HEARD = (
    topics.DIAGNOSTICS,
    topics.tracking_topic("a"),
    *(topic for topic in topics.OUTPUTS if topic is not topics.STATE),
    topics.STATE,
)
IMAGES, INFOS, SEEDS = (
    tuple(make(plane) for plane in "ab") for make in (topics.image_topic, topics.camera_info_topic, topics.seed_topic)
)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_input(tmp_path_factory.mktemp("drawn") / "ring.mcap", MOTIONS_MM)


@pytest.fixture(scope="module")
def offline(recording: Path) -> list[np.ndarray]:
    output = recording.with_name("result.mcap")
    track_recording(recording, output)
    return [estimate.motion_raw for estimate in read_estimates(output)]


def start(graph: Graph, *parameters: str) -> None:
    # These streams wait for events: one that pauses is not lost.
    words = [word for parameter in ("stream_timeout_s:=600.0", *parameters) for word in ("-p", parameter)]
    arguments = ["--ros-args", "--params-file", str(share_file("config/tracker.yaml")), *words]
    graph.client(ChangeState, "/lasso_tracker/change_state")
    for service in ("reset", "set_reference"):
        graph.client(Trigger, f"/lasso_tracker/{service}")
    graph.processes.start("tracker", "support.brisk_tracker", ["lasso_tracker", *arguments])
    graph.heard.wait_for(lambda: bool(states(graph)))


def play(graph: Graph, recording: Path, *arguments: str) -> None:
    graph.processes.start("player", "lasso_motion_ros.cli.main", ["play", str(recording), "--wait", "30", *arguments])
    assert graph.wait_for_end("player") == 0


def states(graph: Graph) -> list[str]:
    return [message.data for message in graph.heard.messages["state"]]


def poses(graph: Graph, topic: str = "motion_raw") -> dict[int, np.ndarray]:
    return {stamp_to_ns(message.header.stamp): decode_pose(message) for message in graph.heard.messages[topic]}


def counts(graph: Graph, part: str) -> dict[str, str]:
    for message in reversed(graph.heard.messages["/diagnostics"]):
        for status in message.status:
            if status.name == f"/lasso_tracker: {part}":
                return {entry.key: entry.value for entry in status.values}
    return {}


def reasons(graph: Graph) -> list[str]:
    """What the diagnostics said of the tracker."""
    messages = graph.heard.messages["/diagnostics"]
    return [s.message for message in messages for s in message.status if s.name == "/lasso_tracker: tracker"]


def test_every_pair_is_answered_as_offline(tmp_path: Path, recording: Path, offline: list[np.ndarray]) -> None:
    with Graph(HEARD, tmp_path) as graph:
        start(graph)
        play(graph, recording)
        kinds = ("motion_raw", "motion", "motion_with_covariance")
        graph.heard.wait_for(lambda: all(len(poses(graph, topic)) == len(MOTIONS_MM) for topic in kinds))
        live = poses(graph)
        assert sorted(live) == STAMPS
        for at, expected in zip(STAMPS, offline, strict=True):
            np.testing.assert_allclose(live[at], expected, atol=1e-6)
        assert [round(1e3 * motion[2, 3], 1) for _, motion in sorted(live.items())] == MOTIONS_MM
        assert poses(graph, "motion").keys() == poses(graph, "motion_with_covariance").keys() == live.keys()

        order = [name for name, _ in graph.heard.order]
        assert order.index("reference") < order.index("state", order.index("reference")) < order.index("motion")
        assert [stamp_to_ns(message.stamp) for message in graph.heard.messages["reference"]] == [START_NS]
        picture = graph.heard.messages["plane_a/tracking"][-1]
        assert (picture.encoding, picture.height, picture.width) == ("rgb8", 512, 512)

        graph.heard.wait_for(lambda: counts(graph, "tracker").get("pairs answered") == str(len(MOTIONS_MM)))
        assert counts(graph, "tracker")["pairs dropped"] == "0"
        assert counts(graph, "plane_b")["paired"] == str(len(MOTIONS_MM))
        assert counts(graph, "plane_b")["dropped"] == "0"
        # The diagnostics leave it out once the player has ended.
        said = [status for message in graph.heard.messages["/diagnostics"] for status in message.status]
        assert {entry.value for status in said for entry in status.values if entry.key == "subscribed"} == {"reliable"}

        graph.processes.send("tracker", signal.SIGINT)
        assert graph.wait_for_end("tracker") == 0
        graph.heard.wait_for(lambda: states(graph)[-1:] == ["INACTIVE"])


def test_clicks_that_come_late_change_nothing(tmp_path: Path, recording: Path, offline: list[np.ndarray]) -> None:
    with Graph(HEARD, tmp_path) as graph:
        start(graph)
        publishers = {topic.name: graph.publisher(topic) for topic in (*IMAGES, *INFOS, *SEEDS)}
        graph.wait_until(lambda: all(publisher.get_subscription_count() > 0 for publisher in publishers.values()))
        for name, data in recorded(recording, *IMAGES, *INFOS):
            publishers[name].publish(data)
        graph.heard.wait_for(lambda: counts(graph, "tracker").get("pairs answered") == str(len(MOTIONS_MM)))
        graph.heard.wait_for(lambda: states(graph)[-1:] == ["WAITING_FOR_SEED"])  # on a topic of its own
        assert poses(graph) == {}
        for name, data in recorded(recording, *SEEDS):
            publishers[name].publish(data)
        graph.heard.wait_for(lambda: len(poses(graph)) == len(MOTIONS_MM))
        for at, expected in zip(STAMPS, offline, strict=True):
            np.testing.assert_allclose(poses(graph)[at], expected, atol=1e-6)


def test_best_effort_images_and_a_latched_calibration_are_heard(tmp_path: Path, recording: Path) -> None:
    with Graph(HEARD, tmp_path) as graph:
        infos = {topic.name: graph.publisher(topic, latched=True) for topic in INFOS}
        for name, data in recorded(recording, *INFOS)[:2]:
            infos[name].publish(data)
        start(graph)
        graph.heard.wait_for(lambda: states(graph)[-1:] == ["WAITING_FOR_SEED"])
        publishers = {topic.name: graph.publisher(topic, reliable=False) for topic in IMAGES}
        publishers |= {topic.name: graph.publisher(topic) for topic in SEEDS}
        graph.wait_until(lambda: all(publisher.get_subscription_count() > 0 for publisher in publishers.values()))
        for name, data in recorded(recording, *SEEDS, *IMAGES):
            publishers[name].publish(data)
        graph.heard.wait_for(lambda: STAMPS[-1] in poses(graph))
        graph.heard.wait_for(lambda: counts(graph, "plane_a").get("subscribed") == "best effort")


def grabbed(recording: Path) -> list[tuple[topics.Topic, dict[str, Any]]]:
    """A recording's images as frame grabbers publish them: plane A's in colour, plane B's compressed."""
    found: list[tuple[topics.Topic, dict[str, Any]]] = []
    for one in RecordingReader(recording).messages([topic.recorded_name for topic in IMAGES]):
        pixels, header = decode_image(one.message), header_fields(stamp_to_ns(one.message.header.stamp))
        if one.topic == IMAGES[0].recorded_name:
            found.append((IMAGES[0], encode_image(np.dstack([pixels] * 3), header)))
        else:
            data = cv2.imencode(".png", np.array(pixels))[1].reshape(-1)
            fields = {"header": header, "format": "mono8; png compressed", "data": data}
            found.append((topics.compressed_image_topic("b"), fields))
    return found


def test_colour_and_compressed_images_give_the_same_poses(
    tmp_path: Path, recording: Path, offline: list[np.ndarray]
) -> None:
    with Graph(HEARD, tmp_path) as graph:
        start(graph)
        images = grabbed(recording)
        publishers = {topic.name: graph.publisher(topic) for topic in (*dict(images), *INFOS, *SEEDS)}
        graph.wait_until(lambda: all(publisher.get_subscription_count() > 0 for publisher in publishers.values()))
        for name, data in recorded(recording, *INFOS, *SEEDS):
            publishers[name].publish(data)
        for topic, fields in images:
            publishers[topic.name].publish(RosMessages().make(topic.type_name, fields))
        graph.heard.wait_for(lambda: len(poses(graph)) == len(MOTIONS_MM))
        for at, expected in zip(STAMPS, offline, strict=True):
            np.testing.assert_allclose(poses(graph)[at], expected, atol=1e-6)
        taken = "rgb8 pictures are taken as luminance (ITU-R BT.601)"
        graph.heard.wait_for(lambda: counts(graph, "plane_a").get("remark") == taken)
        graph.publisher(IMAGES[1])
        heard = "plane_b/image_raw is heard, and not /plane_b/image_raw/compressed"
        graph.wait_until(lambda: heard in graph.processes.log("tracker", 50))
        said = graph.processes.log("tracker", 50)
        assert said.count(taken) == 1
        assert said.count("/plane_b/image_raw/compressed is heard, since nobody publishes plane_b/image_raw") == 1


def test_bad_messages_are_named_and_the_node_goes_on(tmp_path: Path, recording: Path) -> None:
    with Graph(HEARD, tmp_path) as graph:
        start(graph)
        publishers = {topic.name: graph.publisher(topic) for topic in (*IMAGES, *INFOS, *SEEDS)}
        graph.wait_until(lambda: all(publisher.get_subscription_count() > 0 for publisher in publishers.values()))
        header = header_fields(START_NS - 10**8, "patient_table")
        good = encode_image(np.zeros((512, 512), np.uint8), header)
        for bad in (good | {"encoding": "32FC1"}, good | {"step": 5}, good | {"data": b"\0" * 7}):
            publishers["plane_a/image_raw"].publish(RosMessages().make("sensor_msgs/msg/Image", bad))
        publishers["plane_a/camera_info"].publish(b"\0\1\0\0cut")  # cannot be deserialised at all
        publishers["plane_a/seed"].publish(RosMessages().make(SEEDS[0].type_name, {"header": header}))
        # Before more come than the subscription holds, all at once as they do here.
        graph.heard.wait_for(lambda: counts(graph, "plane_a").get("refused images") == "3")
        for name, data in recorded(recording, *SEEDS, *IMAGES, *INFOS):
            publishers[name].publish(data)
        graph.heard.wait_for(lambda: len(poses(graph)) == len(MOTIONS_MM))
        said = graph.processes.log("tracker", 50)
        assert "plane_a/image_raw: encoding" in said
        assert "plane_a/seed: " in said


def test_services(tmp_path: Path, recording: Path) -> None:
    with Graph(HEARD, tmp_path) as graph:
        start(graph)
        refused = call(graph, "set_reference")
        assert not refused.success
        assert (
            refused.message
            == "the reference can be set in TRACKING and DISPLACED only, the state is WAITING_FOR_CALIBRATION"
        )
        play(graph, recording, "--rate", "2")
        graph.heard.wait_for(lambda: len(poses(graph)) == len(MOTIONS_MM))
        assert call(graph, "set_reference").success
        assert call(graph, "reset").success
        graph.heard.wait_for(lambda: states(graph)[-1:] == ["WAITING_FOR_SEED"])


def test_managed_life(tmp_path: Path, recording: Path) -> None:
    with Graph(HEARD, tmp_path) as graph:
        start(graph, "autostart:=false")
        assert states(graph) == ["INACTIVE"]
        assert not call(graph, "reset").success
        assert change(graph, Transition.TRANSITION_CONFIGURE)
        assert change(graph, Transition.TRANSITION_ACTIVATE)
        graph.heard.wait_for(lambda: states(graph)[-1:] == ["WAITING_FOR_CALIBRATION"])
        assert change(graph, Transition.TRANSITION_DEACTIVATE)
        graph.heard.wait_for(lambda: states(graph)[-1:] == ["INACTIVE"])
        assert change(graph, Transition.TRANSITION_CLEANUP)
        assert change(graph, Transition.TRANSITION_CONFIGURE)
        assert change(graph, Transition.TRANSITION_ACTIVATE)
        play(graph, recording, "--rate", "2")
        graph.heard.wait_for(lambda: len(poses(graph)) == len(MOTIONS_MM))
        # The model is kept; what was tracked before says nothing about now.
        assert change(graph, Transition.TRANSITION_DEACTIVATE)
        assert change(graph, Transition.TRANSITION_ACTIVATE)
        graph.heard.wait_for(lambda: states(graph)[-1:] == ["LOST"])
        graph.heard.wait_for(lambda: any("no pair since activation" in reason for reason in reasons(graph)))


@pytest.mark.parametrize(
    ("parameter", "message"),
    [
        ("metod:=brost2009", "unknown parameter 'metod'; did you mean method?"),
        ("method:=magic", "method must be one of "),
        ("features.roi_px:=300", "features.roi_px is a parameter of the method brost2009, but method is appearance"),
        ("seed_buffer_pairs:=0", "seed_buffer_pairs must be at least 1, found 0"),
    ],
)
def test_a_bad_parameter_ends_it_with_one_line(tmp_path: Path, parameter: str, message: str) -> None:
    with Graph(HEARD, tmp_path) as graph:
        arguments = ["--ros-args", "-p", parameter]
        graph.processes.start_node("tracker", "lasso_tracker", arguments)
        assert graph.wait_for_end("tracker") == 2
        said = graph.processes.log("tracker", 50)
        assert message in said
        assert len(said.splitlines()) == 1


def call(graph: Graph, service: str) -> Any:
    return graph.call(Trigger, f"/lasso_tracker/{service}", Trigger.Request())


def change(graph: Graph, transition: int) -> bool:
    request = ChangeState.Request(transition=Transition(id=transition))
    return bool(graph.call(ChangeState, "/lasso_tracker/change_state", request).success)
