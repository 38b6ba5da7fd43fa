"""What the tracker node shows: once a pair is frozen, that pair alone."""

from __future__ import annotations

import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from lasso_motion_ros.frames import PLANES, UncalibratedFrame
from lasso_motion_ros.nodes import tracker_outlets
from lasso_motion_ros.nodes.tracker_outlets import TrackerOutlets, View
from lasso_motion_ros.tracker import TrackerState
from msg_adapters.messages import RosMessages, stamp_to_ns

PICTURE = np.zeros((4, 4, 3), np.uint8)
LIVE, HELD = 1, 2


class Publisher:
    """Somebody always looks."""

    def __init__(self, published: list[int]) -> None:
        self._published = published

    def get_subscription_count(self) -> int:
        return 1

    def publish(self, message: Any) -> None:
        self._published.append(stamp_to_ns(message.header.stamp))

    def wait_for_all_acked(self, timeout: Any) -> bool:
        return True


def view(stamp_ns: int, held: bool) -> View:
    frames = {plane: UncalibratedFrame(stamp_ns, np.zeros((4, 4), np.uint8)) for plane in PLANES}
    return View(frames, None, TrackerState.TRACKING, "", {}, {}, held)


def test_no_picture_of_another_pair_is_published_once_one_is_held(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not even one that was being drawn: it would be taken for the frozen pair's."""
    drawing, go_on, last = threading.Event(), threading.Event(), threading.Event()

    def draw(frame: UncalibratedFrame, *_: Any, **__: Any) -> np.ndarray:
        if frame.stamp_ns == LIVE:
            drawing.set()
            assert go_on.wait(30.0)
        return PICTURE

    monkeypatch.setattr(tracker_outlets, "draw_tracking", draw)
    published: list[int] = []
    node = SimpleNamespace(create_publisher=lambda *_: Publisher(published))
    outlets = TrackerOutlets(node, RosMessages(), lambda error: None, lambda: None)
    outlets.show(view(LIVE, held=False))
    assert drawing.wait(30.0)
    outlets.show(view(HELD, held=True))
    go_on.set()
    while len(published) < len(PLANES):
        assert not last.wait(0.01)
    outlets.close()
    assert published == [HELD, HELD]
