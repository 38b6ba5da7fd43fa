"""The executable `lasso_overlay`."""

from __future__ import annotations

import sys

from lasso_motion_ros.nodes.running import RunnableNode, run_node


def _make() -> RunnableNode:
    from lasso_motion_ros.nodes.overlay_node import OverlayNode  # rclpy, which may be missing, is imported by it

    return OverlayNode()


def main(arguments: list[str] | None = None) -> int:
    """Run the overlay node until it is stopped; returns the exit status."""
    return run_node(_make, arguments)


if __name__ == "__main__":
    sys.exit(main())
