"""Nothing comes that could be tracked, or nothing is answered: the tracker says so, until the next pair.

One graph, with a method that hangs on demand (`support/hanging_tracker.py`).
"""

from __future__ import annotations

import os
import re
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from std_srvs.srv import Trigger
from support.node_harness import Graph
from support.ring_stream import HEARD, RingStream, start_tracker

from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.nodes.qos import topic_subscription
from msg_adapters import topics
from msg_adapters.markers import DELETE
from msg_adapters.messages import RosMessages

pytestmark = pytest.mark.ros

PICTURE = topics.tracking_topic("a")
TIMEOUT_S = 1.0


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RingStream]:
    with pytest.MonkeyPatch.context() as patch:
        directory = tmp_path_factory.mktemp("silence")
        patch.setenv("HANG", str(directory / "hang"))
        with Graph((PICTURE, *HEARD), directory) as graph:
            stream = RingStream(graph)
            start_tracker(graph, "stream_timeout_s:=0.0", module="support.hanging_tracker")
            stream.connect()
            stream.pairs(1)
            stream.await_state("WAITING_FOR_SEED")
            yield stream


@pytest.fixture
def stream(running: RingStream) -> Iterator[RingStream]:
    """The stream, seeded anew; the next pairs are tracked again, whatever the test did."""
    running.reset()
    running.number += 10
    running.seeded()
    yield running
    running.pairs(1)
    running.expect(running.pairs(1))
    running.nothing_wrong()


def hang() -> Path:
    """The file while which is there the tracker hangs in its next pair."""
    return Path(os.environ["HANG"])


def message(stream: RingStream) -> str:
    return stream.values("tracker")["message"]


def await_message(stream: RingStream, begin: str) -> None:
    stream.graph.heard.wait_for(lambda: message(stream).startswith(begin))


def read_latched(stream: RingStream) -> list[str]:
    """The state that one who comes late reads first."""
    node, read = stream.graph.listener.node, []
    subscription = topic_subscription(node, RosMessages(), topics.STATE, lambda heard: read.append(heard.data))
    stream.graph.wait_until(lambda: bool(read))
    node.destroy_subscription(subscription)
    return read


def call(stream: RingStream, service: str) -> Any:
    return stream.graph.call(Trigger, f"/lasso_tracker/{service}", Trigger.Request())


def test_both_planes_stop(stream: RingStream) -> None:
    heard = stream.graph.heard
    last, began = stream.pairs(1), time.monotonic()
    stream.expect(last)
    pictures = len(heard.messages[PICTURE.name])
    stream.await_state("LOST")
    assert time.monotonic() - began > TIMEOUT_S
    await_message(stream, "LOST: no images for ")
    assert re.search(r"; last good pose \d\.\d s ago$", message(stream))
    heard.wait_for(lambda: heard.messages["catheter"][-1].action == DELETE)
    heard.wait_for(lambda: float(stream.values("tracker")["age of the last pose (s)"]) > TIMEOUT_S)
    stream.said("state: LOST: no images for ")
    assert read_latched(stream)[0] == "LOST"
    refused = call(stream, "set_reference")
    assert not refused.success
    assert "there is no present phase to refer to: no images for " in refused.message
    # The picture says it too, and the state is renewed.
    heard.wait_for(lambda: len(heard.messages[PICTURE.name]) > pictures)
    said = len(stream.states())
    heard.wait_for(lambda: len(stream.states()) > said + 1)
    assert set(stream.states()[said:]) == {"LOST"}
    before = message(stream)
    heard.wait_for(lambda: message(stream) != before and message(stream).startswith("LOST: no images for "))
    said = len(stream.states())
    stream.expect(stream.pairs(1))
    stream.await_state("TRACKING")
    assert set(stream.states()[said:]) <= {"LOST", "TRACKING"}
    stream.said("state: TRACKING again")
    await_message(stream, "TRACKING")


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (lambda f: f | {"encoding": "32FC1"}, "encoding: expected"),
        (lambda f: f | {"height": 128, "data": bytes(f["data"])[: len(f["data"]) // 2]}, "the calibration is for"),
    ],
    ids=["32FC1", "another size"],
)
def test_only_images_come_that_cannot_be_used(stream: RingStream, spoil: Any, why: str) -> None:
    ended = threading.Event()
    while not message(stream).startswith("LOST: no image could be used for "):
        assert stream.number < 1000
        stream.pairs(1, spoil_image=spoil)
        ended.wait(0.1)
    assert why in message(stream)
    assert read_latched(stream)[0] == "LOST"
    stream.said("state: LOST: no image could be used for ")


def test_the_picture_is_held(stream: RingStream) -> None:
    """As by a frame grabber while the pedal is up: no new exposure, which is as good as no image."""
    (last,) = stream.pairs(1)
    stream.expect([last])
    posed, ended = len(stream.graph.heard.messages["motion"]), threading.Event()
    held = {topics.image_topic(plane): stream.drawn(plane, stream.number)[1][1]["data"] for plane in PLANES}
    shown = iter(())

    def hold(fields: dict[str, Any]) -> dict[str, Any]:
        return fields | {"data": next(shown)}

    while not message(stream).startswith("LOST: the picture is held: no new exposure for "):
        assert stream.number < 1000
        shown = iter(held.values())
        stream.pairs(1, spoil_image=hold)
        ended.wait(0.1)
    assert read_latched(stream)[0] == "LOST"
    assert len(stream.graph.heard.messages["motion"]) == posed + 1  # one of the pictures was new
    stream.said("state: LOST: the picture is held: no new exposure for ")
    stream.await_count("plane_a", "held", 2)
    stream.expect(stream.pairs(1))
    stream.await_state("TRACKING")


def test_the_tracker_hangs(stream: RingStream) -> None:
    hang().touch()
    before = stream.number
    tick = threading.Event()
    while not message(stream).startswith("LOST: the tracker has not answered for "):
        assert stream.number < before + 600
        stream.pairs(1)
        tick.wait(0.1)
    assert read_latched(stream)[0] == "LOST"
    posed = len(stream.graph.heard.messages["motion"])
    refused = call(stream, "reset")
    assert not refused.success
    assert "the tracker hangs" in refused.message
    stream.pairs(1)
    assert len(stream.graph.heard.messages["motion"]) == posed
    hang().unlink()
    stream.expect(stream.pairs(1))
    stream.await_state("TRACKING")


def test_without_a_model_the_state_stays_and_the_diagnostics_tell(running: RingStream) -> None:
    running.reset()
    running.pairs(1)
    await_message(running, "WAITING_FOR_SEED: no seed yet; no images for ")
    assert running.states()[-1] == "WAITING_FOR_SEED"


def test_a_node_that_hangs_can_be_ended(running: RingStream) -> None:
    """The last: it ends the tracker."""
    running.number += 10
    running.seeded()
    hang().touch()
    running.pairs(2)
    await_message(running, "LOST: the tracker has not answered for ")
    running.graph.processes.send("tracker", signal.SIGINT)
    assert running.graph.wait_for_end("tracker") == 0
    running.await_state("INACTIVE")
    running.said("the tracker hangs in a pair and is left behind")
