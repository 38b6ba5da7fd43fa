"""Inputs of a node that belong together: their publishers are looked for at one time, and calibrations taken at once.

Before each callback rclpy's executor sets up a wait for all that the node listens to. That takes half a millisecond,
longer than most of its callbacks. So one timer looks for the publishers of all inputs, and after an image the
calibrations that have come are taken without another wait. Images are not: where several wait, the order in which they
are heard decides how they are paired.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.subscription import Subscription

from lasso_motion_ros.nodes.steady_timer import steady_timer

DISCOVERY_PERIOD_S = 0.1


class JointInputs:
    """The inputs that belong together; for the executor's thread only.

    Args:
        node: that listens.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._looks: list[Callable[[], None]] = []
        self._calibrations: dict[Subscription, Callable[[Any], None]] = {}
        self._timer = steady_timer(node, DISCOVERY_PERIOD_S, self._look)

    def destroy(self) -> None:
        """Look for no publisher any more."""
        self._node.destroy_timer(self._timer)

    def look_for(self, look: Callable[[], None]) -> None:
        """Have an input look for its publishers, ten times a second."""
        self._looks.append(look)

    def _look(self) -> None:
        for look in self._looks:
            look()

    def add_calibration(self, subscription: Subscription, take: Callable[[Any], None]) -> None:
        """Ask a subscription for its message after each image.

        Args:
            subscription: to messages, or to bytes (`raw`).
            take: called with what it takes.
        """
        self._calibrations[subscription] = take

    def remove(self, subscription: Subscription) -> None:
        """Ask it no more: before it is destroyed."""
        self._calibrations.pop(subscription, None)

    def take_calibrations(self) -> None:
        """Take one message of each calibration where one waits: no more come with an image."""
        for subscription, take in list(self._calibrations.items()):
            with subscription.handle:
                taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if taken is not None:
                take(taken[0])
