"""The executable `lasso_web`."""

from __future__ import annotations

import sys

from lasso_motion_ros.nodes.running import RunnableNode, run_node


def _make() -> RunnableNode:
    from lasso_motion_ros.nodes.web_node import WebNode  # rclpy, which may be missing, is imported by it

    return WebNode()


def main(arguments: list[str] | None = None) -> int:
    """Run the node with the page until it is stopped; returns the exit status."""
    return run_node(_make, arguments)


if __name__ == "__main__":
    sys.exit(main())
