"""Child process of the live benchmark: receives images or overlay pictures and notes when they arrive.

`python -m lasso_motion_ros.bench.subscriber images|overlays NOTES.json`; they are written when it is stopped.
"""

from __future__ import annotations

import json
import sys
import time
from functools import partial
from pathlib import Path

from rclpy.node import Node
from sensor_msgs.msg import Image

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.nodes.joint_inputs import JointInputs
from lasso_motion_ros.nodes.qos import IMAGE_DEPTH
from lasso_motion_ros.nodes.running import RunnableNode, ThrottledLog, run_node
from lasso_motion_ros.nodes.subscriptions import OfferedSubscription
from msg_adapters.messages import stamp_to_ns
from msg_adapters.topics import image_topic, overlay_topic

TOPICS = {"images": image_topic, "overlays": overlay_topic}


class BenchSubscriber(Node):  # type: ignore[misc]
    """Notes the monotonic time (ns) at which each plane's picture arrives, by its stamp.

    Args:
        what: `images` or `overlays`.
        notes: file for it: by plane, by stamp.
    """

    def __init__(self, what: str, notes: Path) -> None:
        super().__init__(f"bench_{what}", enable_rosout=False)
        self.complaints = ThrottledLog(self.get_logger())
        self._topic, self._notes = TOPICS[what], notes
        self._received: dict[Plane, dict[int, int]] = {plane: {} for plane in PLANES}

    def start(self) -> None:
        """Listen."""
        inputs = JointInputs(self)
        self._images = [
            OfferedSubscription(
                self, Image, self._topic(plane).name, partial(self._on_image, plane), reliability="auto",
                depth=IMAGE_DEPTH, inputs=inputs,
            )
            for plane in PLANES
        ]  # fmt: skip

    def close(self) -> None:
        """Write down what was noted."""
        self._notes.write_text(json.dumps(self._received), encoding="utf-8")

    def _on_image(self, plane: Plane, message: Image) -> None:
        self._received[plane].setdefault(stamp_to_ns(message.header.stamp), time.monotonic_ns())


def main() -> int:
    """Run until stopped; returns the exit status."""
    what, notes = sys.argv[1:3]

    def make() -> RunnableNode:
        return BenchSubscriber(what, Path(notes))

    return run_node(make, [])


if __name__ == "__main__":
    sys.exit(main())
