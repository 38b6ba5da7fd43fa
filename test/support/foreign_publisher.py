"""A child of a test: somebody's bridge, which knows nothing of our shared-memory profile.

`python foreign_publisher.py RATE PAIRS SIDE ORDER`: waits for subscribers, then publishes a pair with clicks, waits for
its pose and publishes the stream, all reliably, as `rclpy` does by default. ORDER is `info` or `image`: which of a
frame's two messages goes first.
"""

from __future__ import annotations

import sys
import threading
import time

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.serialization import serialize_message

from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.stream.drawn_ring import breath_mm, ring_image, ring_projection, ring_seed
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.images import encode_image
from msg_adapters.messages import RosMessages, header_fields, ns_to_stamp
from msg_adapters.seeds import encode_polygon
from msg_adapters.topics import MOTION, camera_info_topic, image_topic, seed_topic

START_NS = 1_760_000_000 * 10**9
DRAWN = 30


def stamped(data: bytearray, stamp_ns: int) -> bytes:
    """The serialised message with another stamp, which stands behind CDR's own four bytes."""
    data[4:12] = np.array(list(ns_to_stamp(stamp_ns).values()), "<u4").tobytes()
    return bytes(data)


def main() -> None:
    rate, pairs, side, order = float(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]
    rclpy.init()
    node = rclpy.create_node("bridge")
    messages, generator = RosMessages(), np.random.default_rng(0)
    drawn = {
        plane: [
            bytearray(serialize_message(messages.make("sensor_msgs/msg/Image", encode_image(pixels, header_fields(0)))))
            for step in range(DRAWN)
            for pixels in [ring_image(plane, side, breath_mm(step / rate, DRAWN / rate), generator)]
        ]
        for plane in PLANES
    }
    publishers = {
        topic.name: node.create_publisher(type(messages.make(topic.type_name, {})), topic.name, 10)
        for plane in PLANES
        for topic in (image_topic(plane), camera_info_topic(plane), seed_topic(plane))
    }
    pause = threading.Event()
    while any(publisher.get_subscription_count() == 0 for publisher in publishers.values()):
        pause.wait(0.05)
    answered = threading.Event()
    node.create_subscription(PoseStamped, MOTION.name, lambda _: answered.set(), 10)
    began = time.monotonic()
    for number in range(1 + pairs):
        pause.wait(max(0.0, began + number / rate - time.monotonic()))
        stamp_ns = START_NS + round(number / rate * 1e9)
        for plane in PLANES:
            info = encode_camera_info(ring_projection(plane, side), header_fields(stamp_ns))
            info_message = messages.make(camera_info_topic(plane).type_name, info)
            if order == "info":
                publishers[camera_info_topic(plane).name].publish(info_message)
            publishers[image_topic(plane).name].publish(stamped(drawn[plane][number % DRAWN], stamp_ns))
            if order == "image":
                publishers[camera_info_topic(plane).name].publish(info_message)
            if number == 0:
                clicks = encode_polygon(ring_seed(side).points(plane), header_fields(stamp_ns))
                publishers[seed_topic(plane).name].publish(messages.make(seed_topic(plane).type_name, clicks))
        while number == 0 and not answered.is_set():
            rclpy.spin_once(node, timeout_sec=0.1)
            began = time.monotonic()
    for publisher in publishers.values():
        publisher.wait_for_all_acked()
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
