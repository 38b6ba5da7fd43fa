"""Where to draw a registered volume: T · registration; uncompensated when lost; composed when the reference moves."""

from contextlib import suppress

import numpy as np
import rclpy.node
from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSDurabilityPolicy, QoSProfile
from std_msgs.msg import Header, String

from msg_adapters.poses import decode_pose


class OverlayConsumer(rclpy.node.Node):
    registration, state, last, at = np.eye(4), "", (None, np.eye(4)), None  # volume to world; newest T; its reference

    def on_reference(self, reference: Header) -> None:
        if self.last[0] == reference.stamp:  # ~/set_reference: from now on the volume is valid where it lay there
            self.registration, self.last = self.last[1] @ self.registration, (reference.stamp, np.eye(4))
        elif self.at not in (None, reference.stamp):  # new clicks: nobody knows how the old reference lies to the new
            self.get_logger().warning("new reference: register the volume at it again")
        self.at = reference.stamp

    def on_state(self, state: String) -> None:
        self.state = state.data
        if self.state not in ("TRACKING", "DEGRADED"):
            self.get_logger().warning(f"{self.state}: the volume is drawn uncompensated, and the picture says so")

    def on_motion(self, message: PoseStamped) -> None:
        self.last = (message.header.stamp, decode_pose(message))
        self.get_logger().info(f"{self.state}: volume at {1e3 * (self.last[1] @ self.registration)[:3, 3].round(5)} mm")


rclpy.init()
consumer, latched = OverlayConsumer("consumer"), QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
consumer.create_subscription(Header, "reference", consumer.on_reference, latched)  # first: heard before its motion
consumer.create_subscription(String, "state", consumer.on_state, latched)
consumer.create_subscription(PoseStamped, "motion", consumer.on_motion, 10)
with suppress(KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
    rclpy.spin(consumer)
