"""`lasso-motion record` over real DDS: bytes unchanged, kinds of topics kept, safe against SIGKILL, repaired whole."""

from __future__ import annotations

import itertools
import re
import resource
import signal
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from support.node_harness import Graph

from lasso_motion_ros.cli.main import main
from lasso_motion_ros.core.errors import LassoMotionError, RecordingError
from lasso_motion_ros.tools.listened_topics import live_topics
from msg_adapters.images import encode_image
from msg_adapters.messages import RosMessages, header_fields, stamp_to_ns
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.topics import DIAGNOSTICS, STATE, Topic, camera_info_topic, image_topic

pytestmark = pytest.mark.ros

IMAGE_A, IMAGE_B, INFO_A = image_topic("a"), image_topic("b"), camera_info_topic("a")
NOTE = Topic("note", "std_msgs/msg/String")
SIDE = 256


@pytest.fixture
def graph(tmp_path: Path) -> Any:
    with Graph([], tmp_path) as started:
        yield started


def message(topic: Topic, index: int) -> Any:
    header = header_fields(index + 1, "xray")
    if topic.type_name == NOTE.type_name:
        return RosMessages().make(topic.type_name, {"data": f"{topic.name} {index}"})
    if topic is INFO_A:
        return RosMessages().make(topic.type_name, {"header": header})
    pixels = np.random.default_rng(index).integers(0, 4096, (SIDE, SIDE), dtype=np.uint16)
    return RosMessages().make(topic.type_name, encode_image(pixels, header))


def start(graph: Graph, output: Path, *arguments: str) -> subprocess.Popen[bytes]:
    return graph.processes.start("record", "lasso_motion_ros.cli.main", ["record", str(output), *arguments])


def heard_by(*publishers: Any) -> bool:
    return all(publisher.get_subscription_count() == 1 for publisher in publishers)


def recorded(path: Path) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    for entry in RecordingReader(path).messages():
        found.setdefault(entry.topic, []).append(entry.message)
    return found


def written(path: Path) -> int:
    """How many messages the file has so far: every half second what has come is handed over, be it all or a part."""
    try:
        return sum(1 for _ in RecordingReader(path).raw_messages())
    except RecordingError:
        return 0


def test_every_kind_of_topic_is_recorded_as_it_was_offered(graph: Graph, tmp_path: Path) -> None:
    output = tmp_path / "out.mcap"
    state = graph.publisher(STATE, latched=True)
    state.publish(message(STATE, 0))
    reliable, best_effort = graph.publisher(IMAGE_A), graph.publisher(IMAGE_B, reliable=False)
    late, note = graph.publisher(INFO_A, latched=True), graph.publisher(NOTE)
    start(graph, output, "--topics", "note")
    graph.wait_until(lambda: heard_by(state, reliable, best_effort, late, note))
    for index in range(20):
        for publisher, topic in ((reliable, IMAGE_A), (best_effort, IMAGE_B), (note, NOTE)):
            publisher.publish(message(topic, index))
    late.publish(message(INFO_A, 0))
    graph.wait_until(lambda: written(output) == 62)
    graph.processes.send("record", signal.SIGINT)
    assert graph.wait_for_end("record") == 0

    found = recorded(output)
    assert [entry.data for entry in found["/state"]] == ["state 0"]
    assert [entry.data for entry in found["/note"]] == [f"note {index}" for index in range(20)]
    for topic in (IMAGE_A, IMAGE_B):
        assert [stamp_to_ns(entry.header.stamp) for entry in found[topic.recorded_name]] == list(range(1, 21))
        expected = np.random.default_rng(19).integers(0, 4096, (SIDE, SIDE), dtype=np.uint16)
        np.testing.assert_array_equal(found[topic.recorded_name][19].data.view(np.uint16).reshape(SIDE, SIDE), expected)
    reader = RecordingReader(output)
    assert reader.damage is None
    assert reader.latched_topics == {"/state", "/plane_a/camera_info"}
    assert reader.best_effort_topics == {"/plane_b/image_raw"}
    log = graph.processes.log("record", 20)
    assert f"{output}: 62 messages on 5 topics" in log
    assert "     20  /plane_b/image_raw" in log
    assert "nothing came on /plane_b/camera_info" in log


def test_a_topic_offered_in_two_ways_is_recorded_once(graph: Graph, tmp_path: Path) -> None:
    """A latched and an ordinary publisher need two subscriptions; what both hear is written once."""
    output = tmp_path / "out.mcap"
    latched, volatile = graph.publisher(INFO_A, latched=True), graph.publisher(INFO_A)
    latched.publish(message(INFO_A, 0))
    start(graph, output)
    graph.wait_until(lambda: latched.get_subscription_count() == 2 and volatile.get_subscription_count() == 1)
    for index in range(1, 5):
        (latched, volatile)[index % 2].publish(message(INFO_A, index))
    graph.wait_until(lambda: written(output) == 5)
    graph.processes.send("record", signal.SIGINT)
    assert graph.wait_for_end("record") == 0
    found = recorded(output)["/plane_a/camera_info"]
    assert sorted(stamp_to_ns(entry.header.stamp) for entry in found) == [1, 2, 3, 4, 5]


def test_killed_at_any_moment_all_before_the_last_half_second_is_there(graph: Graph, tmp_path: Path) -> None:
    output = tmp_path / "out.mcap"
    publisher = graph.publisher(NOTE)
    child = start(graph, output, "--topics", "note")
    graph.wait_until(lambda: heard_by(publisher))
    for index in range(50):
        publisher.publish(message(NOTE, index))
    # Small messages fill no chunk: it is the half second that brings them to the file.
    graph.wait_until(lambda: written(output) == 50)
    publisher.publish(message(NOTE, 50))
    child.kill()
    assert graph.wait_for_end("record") == -signal.SIGKILL

    reader = RecordingReader(output)
    found = [entry.message.data for entry in reader.messages()]
    assert found[:50] == [f"note {index}" for index in range(50)]
    assert reader.damage is not None
    assert main(["record", "--repair", str(output)]) == 0
    assert [entry.data for entry in recorded(output)["/note"]] == found
    assert RecordingReader(output).damage is None
    with output.open("rb") as file:  # a reader that needs the footer and the index
        assert sum(1 for _ in make_reader(file).iter_messages()) == len(found)
    with AnyReader([output]) as others:
        assert others.message_count == len(found)


def test_what_is_lost_on_the_way_is_counted(graph: Graph, tmp_path: Path) -> None:
    """A recorder that is held up, and more best-effort messages than its queue holds."""
    output = tmp_path / "out.mcap"
    publisher = graph.publisher(NOTE, reliable=False)
    child = start(graph, output, "--topics", "note")
    graph.wait_until(lambda: heard_by(publisher))
    publisher.publish(message(NOTE, 0))
    graph.wait_until(lambda: written(output) == 1)
    child.send_signal(signal.SIGSTOP)
    for index in range(1, 2000):
        publisher.publish(message(NOTE, index))
    child.send_signal(signal.SIGCONT)
    # That some are missing shows by what comes after them.
    later = itertools.count(2000)

    def one_later_is_written() -> bool:
        publisher.publish(message(NOTE, next(later)))
        return any(int(entry.message.data.split()[1]) >= 2000 for entry in RecordingReader(output).messages())

    graph.wait_until(one_later_is_written)
    graph.processes.send("record", signal.SIGINT)
    assert graph.wait_for_end("record") == 3
    came = [int(entry.data.split()[1]) for entry in recorded(output)["/note"]]
    lost = came[-1] + 1 - len(came)
    assert lost > 0
    assert f"/note: {lost} messages were published and did not come" in graph.processes.log("record")


def test_names(tmp_path: Path) -> None:
    topics = live_topics("/lab/", ["extra", "/elsewhere/image"])
    assert topics["/lab/plane_a/image_raw"] == "/plane_a/image_raw"
    assert topics["/lab/extra"] == "/extra"
    assert topics["/elsewhere/image"] == "/elsewhere/image"
    assert topics[DIAGNOSTICS.name] == DIAGNOSTICS.name
    assert live_topics("", [])["/ground_truth/motion"] == "/ground_truth/motion"
    with pytest.raises(LassoMotionError, match="under one name"):
        live_topics("lab", ["/plane_a/image_raw"])


@pytest.mark.parametrize("old", [None, b"precious"])
def test_nothing_comes_and_nothing_is_left_behind_but_what_was_there(
    old: bytes | None, graph: Graph, tmp_path: Path
) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    if old is not None:
        (folder / "out.mcap").write_bytes(old)
    start(graph, folder / "out.mcap", "--duration", "0.3", "--overwrite")
    assert graph.wait_for_end("record") == 2
    assert re.match(r"lasso-motion record: no message came in \d+ s", graph.processes.log("record", 1))
    assert [path.read_bytes() for path in folder.iterdir()] == ([] if old is None else [old])


def test_on_a_full_disk_what_came_and_what_was_there_is_kept(graph: Graph, tmp_path: Path) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    output = folder / "out.mcap"
    output.write_bytes(b"precious")
    publisher = graph.publisher(IMAGE_A)
    child = start(graph, output, "--overwrite")
    graph.wait_until(lambda: heard_by(publisher))
    resource.prlimit(child.pid, resource.RLIMIT_FSIZE, (1 << 20, resource.RLIM_INFINITY))
    sent = itertools.count()

    def full() -> bool:
        publisher.publish(message(IMAGE_A, next(sent)))
        return child.poll() is not None

    graph.wait_until(full)
    assert graph.wait_for_end("record") == 2
    kept = folder / "out.earlier.mcap"
    assert graph.processes.log("record", 1) == (
        f"lasso-motion record: {output} cannot be written: File too large; the earlier recording is kept as {kept}"
    )
    assert kept.read_bytes() == b"precious"
    assert 0 < written(output) < 9
    assert sorted(folder.iterdir()) == [kept, output]


def test_a_recording_is_not_replaced_unless_told_to(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "out.mcap"
    output.write_bytes(b"precious")
    assert main(["record", str(output)]) == 2
    assert output.read_bytes() == b"precious"
    assert capsys.readouterr().err == (
        f"lasso-motion record: {output} exists: choose another name or add --overwrite\n"
    )
