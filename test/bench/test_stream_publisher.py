"""The benchmark's publisher: it begins when everybody it was told of is there, so that nobody misses the first pair."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from lasso_motion_ros.bench.publisher import PublishedStream
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.tools.child_graph import child_graph
from lasso_motion_ros.tools.listener import Listener
from lasso_motion_ros.tools.processes import free_domain
from msg_adapters.topics import Topic, camera_info_topic, image_topic, seed_topic

CALIBRATIONS = [camera_info_topic(plane) for plane in PLANES]
INPUTS = [*CALIBRATIONS, *(image_topic(plane) for plane in PLANES), *(seed_topic(plane) for plane in PLANES)]
PUBLISHER_FOUND_S = 30.0
NOTHING_FOR_S = 1.0


@pytest.mark.ros
def test_nothing_is_sent_before_both_takers_of_the_calibration_are_there(tmp_path: Path) -> None:
    """With the overlay both nodes take it: the pair that is clicked went out when either was there."""
    domain = free_domain()
    heard: list[str] = []
    came = threading.Event()

    def hear(topic: Topic, message: Any, published_ns: int) -> None:
        heard.append(topic.name)
        came.set()

    stream = PublishedStream(5.0, 2, 64, 1, 2, tmp_path / "sent.json")
    assert PublishedStream.read(stream.words) == stream
    with Listener(INPUTS, hear, domain=domain, raw=True) as first, child_graph(domain, tmp_path) as graph:
        graph.start("publisher", "lasso_motion_ros.bench.publisher", stream.words)
        graph.wait_until(lambda: all(first.publishers(topic) == 1 for topic in INPUTS), PUBLISHER_FOUND_S)
        time.sleep(NOTHING_FOR_S)
        assert heard == []
        with Listener(CALIBRATIONS, lambda *_: None, domain=domain, raw=True):
            graph.wait_until(came.is_set, PUBLISHER_FOUND_S)
        assert set(heard) <= {topic.name for topic in INPUTS}
