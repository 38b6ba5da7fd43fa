"""What the tracker node shows: once a pair is frozen, that pair alone."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from sensor_msgs.msg import Image
from support.node_harness import PATIENCE_S, Graph

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.geometry.frames import PLANES, UncalibratedFrame
from lasso_motion_ros.nodes import tracker_publishers
from lasso_motion_ros.nodes.joint_inputs import JointInputs
from lasso_motion_ros.nodes.subscriptions import OfferedSubscription
from lasso_motion_ros.nodes.tracker_publishers import TrackerPublishers, TrackingPicture
from lasso_motion_ros.tracking.tracker import TrackerState
from msg_adapters.messages import RosMessages, stamp_to_ns
from msg_adapters.topics import image_topic, tracking_topic

pytestmark = pytest.mark.ros

PICTURE = np.zeros((4, 4, 3), np.uint8)
LIVE, HELD = 1, 2


def picture(stamp_ns: int, held: bool) -> TrackingPicture:
    frames = {plane: UncalibratedFrame(stamp_ns, np.zeros((4, 4), np.uint8)) for plane in PLANES}
    return TrackingPicture(frames, None, TrackerState.TRACKING, "", {}, {}, held)


def test_no_picture_of_another_pair_is_published_once_one_is_held(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Not even one that was being drawn: it would be taken for the frozen pair's."""
    drawing, go_on = threading.Event(), threading.Event()

    def draw(frame: UncalibratedFrame, *_: Any, **__: Any) -> np.ndarray:
        if frame.stamp_ns == LIVE:
            drawing.set()
            assert go_on.wait(PATIENCE_S)
        return PICTURE

    monkeypatch.setattr(tracker_publishers, "draw_tracking", draw)
    pictures = [tracking_topic(plane) for plane in PLANES]
    with Graph(pictures, tmp_path) as graph:
        heard = graph.heard.messages
        node = graph.listener.node
        publishers = TrackerPublishers(node, RosMessages(), lambda error: None, lambda: None, StreamConfig())
        graph.wait_until(
            lambda: all(publishers._publishers[topic.name].get_subscription_count() > 0 for topic in pictures)
        )
        publishers.show(picture(LIVE, held=False))
        assert drawing.wait(PATIENCE_S)
        publishers.show(picture(HELD, held=True))
        go_on.set()
        graph.heard.wait_for(
            lambda: all(HELD in [stamp_to_ns(one.header.stamp) for one in heard[topic.name]] for topic in pictures)
        )
        publishers.close()
        for topic in pictures:
            assert [stamp_to_ns(one.header.stamp) for one in heard[topic.name]] == [HELD]


def test_the_executor_watches_nothing_of_what_is_published(tmp_path: Path) -> None:
    """Each of a publisher's events costs every wait for the next image."""
    with Graph([], tmp_path) as graph:
        publishers = TrackerPublishers(
            graph.listener.node, RosMessages(), lambda error: None, lambda: None, StreamConfig()
        )
        assert not any(one.event_handlers for one in publishers._publishers.values())
        publishers.close()


@pytest.mark.parametrize("reliability", ["auto", "reliable"])
def test_only_a_subscription_that_may_ask_for_too_much_is_watched(reliability: str, tmp_path: Path) -> None:
    topic = image_topic("a")
    with Graph([], tmp_path) as graph:
        published = graph.publisher(topic)
        inputs = JointInputs(graph.listener.node)
        images = OfferedSubscription(
            graph.listener.node,
            Image,
            topic.recorded_name,
            lambda _: None,
            reliability=reliability,
            depth=1,
            inputs=inputs,
        )
        graph.wait_until(lambda: images.reliable is not None and published.get_subscription_count() > 0)
        assert images._subscription is not None
        assert bool(images._subscription.event_handlers) == (reliability != "auto")
        inputs.destroy()
        images.destroy()
