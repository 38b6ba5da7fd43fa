"""A child of the live benchmark: receives the images like anybody, does nothing with them, and notes when.

`python -m lasso_motion_ros.nodes.bench_subscriber NOTES.json`; the notes are written when it is stopped.
"""

from __future__ import annotations

import json
import sys
import time
from functools import partial
from pathlib import Path

from rclpy.node import Node
from sensor_msgs.msg import Image

from lasso_motion_ros.frames import PLANES, Plane
from lasso_motion_ros.nodes.qos import IMAGE_DEPTH
from lasso_motion_ros.nodes.running import RunnableNode, ThrottledLog, run_node
from lasso_motion_ros.nodes.subscriptions import OfferedSubscription
from msg_adapters.messages import stamp_to_ns
from msg_adapters.topics import image_topic


class BenchSubscriber(Node):  # type: ignore[misc]
    """Notes the steady clock (ns) at which both images of a stamp were there.

    Args:
        notes: file for it, by stamp.
    """

    def __init__(self, notes: Path) -> None:
        super().__init__("bench_subscriber", enable_rosout=False)
        self.complaints = ThrottledLog(self.get_logger())
        self._notes = notes
        self._half: dict[int, Plane] = {}
        self._whole: dict[int, int] = {}

    def start(self) -> None:
        """Listen."""
        self._images = [
            OfferedSubscription(
                self, Image, image_topic(plane).name, partial(self._on_image, plane), reliability="auto",
                depth=IMAGE_DEPTH,
            )
            for plane in PLANES
        ]  # fmt: skip

    def close(self) -> None:
        """Write down what was noted."""
        self._notes.write_text(json.dumps({str(stamp): at for stamp, at in self._whole.items()}), encoding="utf-8")

    def _on_image(self, plane: Plane, message: Image) -> None:
        stamp = stamp_to_ns(message.header.stamp)
        if self._half.setdefault(stamp, plane) != plane:
            self._whole[stamp] = time.monotonic_ns()


def main() -> int:
    """Run until stopped; returns the exit status."""

    def make() -> RunnableNode:
        return BenchSubscriber(Path(sys.argv[1]))

    return run_node(make, [])


if __name__ == "__main__":
    sys.exit(main())
