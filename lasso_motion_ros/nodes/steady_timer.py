"""Timers that go on whatever the time on /clock does."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.timer import Timer


def steady_timer(node: Node, period_s: float, callback: Callable[[], None]) -> Timer:
    """A timer by the steady clock, for everything that is not about the data.

    A node's own timers follow its clock. Under `use_sim_time` that one stands still without anybody on /clock, and
    with it discovery and diagnostics would.

    Args:
        node: the node.
        period_s: between two calls.
        callback: called each time.
    """
    return node.create_timer(period_s, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))
