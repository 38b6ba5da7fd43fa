"""Where to draw a registered volume: T · registration; uncompensated when lost; composed when the reference moves."""

from contextlib import suppress

import numpy as np
import rclpy.node
from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSDurabilityPolicy, QoSProfile
from std_msgs.msg import Header, String

from msg_adapters.poses import decode_pose


class OverlayConsumer(rclpy.node.Node):
    registration, state, poses, at = np.eye(4), "", (), None  # volume to world; last (stamp, T)s; the reference's stamp

    def on_reference(self, reference: Header) -> None:
        old, self.at = self.at, reference.stamp  # a newer pose may have overtaken it; T = 1 at its stamp is its own
        if moved := [T for stamp, T in self.poses if stamp == self.at != old and not np.array_equal(T, np.eye(4))]:
            self.registration = moved[0] @ self.registration  # ~/set_reference: valid where the volume lay there
        elif old not in (None, self.at):  # new clicks: nobody knows how the old reference lies to the new
            self.get_logger().warning("new reference: register the volume at it again")

    def on_state(self, state: String) -> None:
        self.state = state.data
        if self.state not in ("TRACKING", "DEGRADED"):
            self.get_logger().warning(f"{self.state}: the volume is drawn uncompensated, and the picture says so")

    def on_motion(self, message: PoseStamped) -> None:
        self.poses = (*self.poses[-99:], (message.header.stamp, T := decode_pose(message)))
        self.get_logger().info(f"{self.state}: volume at {1e3 * (T @ self.registration)[:3, 3].round(5)} mm")


rclpy.init()
consumer, latched = OverlayConsumer("consumer"), QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
consumer.create_subscription(Header, "reference", consumer.on_reference, latched)  # first: seldom after its motion
consumer.create_subscription(String, "state", consumer.on_state, latched)
consumer.create_subscription(PoseStamped, "motion", consumer.on_motion, 10)
with suppress(KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
    rclpy.spin(consumer)
