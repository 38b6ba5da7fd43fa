"""The node that sends motion and state to an OpenIGTLink server, 3D Slicer's or Plus'."""

from __future__ import annotations

import time

from geometry_msgs.msg import PoseStamped
from std_msgs.msg import String

from lasso_motion_ros.config.igtl import IgtlConfig
from lasso_motion_ros.core.errors import ConfigurationError, MessageError
from lasso_motion_ros.nodes.configured_node import ConfiguredNode
from lasso_motion_ros.nodes.qos import topic_subscription
from lasso_motion_ros.nodes.running import guarded
from lasso_motion_ros.nodes.steady_timer import steady_timer
from lasso_motion_ros.tracking.tracker import TrackerState
from msg_adapters.messages import stamp_to_ns
from msg_adapters.openigtlink import IgtlConnection, IgtlMessages, server_address
from msg_adapters.poses import decode_pose
from msg_adapters.topics import MOTION, STATE

STALE = "STALE"
"""What is said once where nobody renews the state: the server would show the last one for ever."""
LOOK_PERIOD_S = 0.1


class IgtlNode(ConfiguredNode[IgtlConfig]):
    """Wiring: `state` becomes a STRING, `motion` a TRANSFORM, as long as the state is fresh and tells of a pose.

    Raises:
        ConfigurationError: a parameter that is unknown, of the wrong type or out of range, or no server.
    """

    def __init__(self) -> None:
        super().__init__("lasso_igtl", IgtlConfig)
        config = self._config = self.declared
        if not config.to:
            raise ConfigurationError("to: name the OpenIGTLink server, HOST:PORT")
        self._packed = IgtlMessages(config.device, config.axes)
        self._connection = IgtlConnection(server_address(config.to), self._say)
        self._state = ""
        self._said_at_s = 0.0
        self._is_renewed = self._was_connected = False

    def start(self) -> None:
        """Listen, and look for the server."""
        topic_subscription(self, self.messages, STATE, self._on_state)
        topic_subscription(self, self.messages, MOTION, self._on_motion)
        steady_timer(self, LOOK_PERIOD_S, self._on_timer)
        self._connection.start()

    def close(self) -> None:
        """End the connection; the server learns that no state is renewed any more."""
        self._make_stale()
        self._connection.close()

    @guarded
    def _on_state(self, message: String) -> None:
        # The first one may be latched, and as old as the tracker; one that tells of a pose waits for a second sign.
        self._is_renewed = bool(self._state) or not TrackerState.tells_of_pose(message.data)
        self._state, self._said_at_s = message.data, time.monotonic()
        if not TrackerState.tells_of_pose(self._state):
            self._connection.withdraw(self._packed.device)
        self._send_state()

    @guarded
    def _on_motion(self, message: PoseStamped) -> None:
        if message.header.frame_id != self._config.world_frame:
            raise MessageError(f"motion is in frame {message.header.frame_id!r}, expected {self._config.world_frame!r}")
        motion = decode_pose(message)
        if TrackerState.tells_of_pose(self._state) and not self._is_stale():
            if not self._is_renewed:
                self._is_renewed = True
                self._send_state()
            packed = self._packed.motion(motion, stamp_to_ns(message.header.stamp))
            self._connection.send(self._packed.device, packed)

    @guarded
    def _on_timer(self) -> None:
        if self._is_stale():
            self._make_stale()
        if self._connection.connected and not self._was_connected:
            self._send_state()
        self._was_connected = self._connection.connected

    def _is_stale(self) -> bool:
        return time.monotonic() - self._said_at_s > self._config.state_timeout_s

    def _make_stale(self) -> None:
        if self._state not in ("", STALE):
            self._state, self._is_renewed = STALE, True
            self._connection.withdraw(self._packed.device)
            self._send_state()

    def _send_state(self) -> None:
        if not self._state or not self._is_renewed:
            return
        packed = self._packed.state(self._state, self.get_clock().now().nanoseconds)
        self._connection.send(self._packed.state_device, packed)

    def _say(self, line: str) -> None:
        self.get_logger().info(line)
