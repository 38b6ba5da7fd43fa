"""The executables `lasso_tracker`, `lasso_overlay`, …; uninstalled, `python -m … <name> [arguments]`.

Each imports its node only when it runs: rclpy may be missing, and threads are bounded before NumPy is imported.
"""

from __future__ import annotations

import sys

from lasso_motion_ros.nodes.running import EXIT_BAD_INPUT, RunnableNode, run_node


def lasso_tracker(arguments: list[str] | None = None) -> int:
    """Run the tracker node until it is stopped; returns the exit status."""

    def make() -> RunnableNode:
        from lasso_motion_ros.nodes.tracker_node import TrackerNode

        return TrackerNode()

    return run_node(make, arguments)


def lasso_overlay(arguments: list[str] | None = None) -> int:
    """Run the overlay node until it is stopped; returns the exit status."""

    def make() -> RunnableNode:
        from lasso_motion_ros.nodes.overlay_node import OverlayNode

        return OverlayNode()

    return run_node(make, arguments)


def lasso_web(arguments: list[str] | None = None) -> int:
    """Run the node with the page until it is stopped; returns the exit status."""

    def make() -> RunnableNode:
        from lasso_motion_ros.nodes.web_node import WebNode

        return WebNode()

    return run_node(make, arguments)


def lasso_igtl(arguments: list[str] | None = None) -> int:
    """Run the node that sends to an OpenIGTLink server until it is stopped; returns the exit status."""

    def make() -> RunnableNode:
        from lasso_motion_ros.nodes.igtl_node import IgtlNode

        return IgtlNode()

    return run_node(make, arguments)


EXECUTABLES = {executable.__name__: executable for executable in (lasso_tracker, lasso_overlay, lasso_web, lasso_igtl)}


def main(arguments: list[str]) -> int:
    """Run the executable that the first argument names, with those behind it; returns the exit status."""
    if not arguments or arguments[0] not in EXECUTABLES:
        found = arguments[0] if arguments else "nothing"
        print(f"expected one of {', '.join(EXECUTABLES)}, found {found}", file=sys.stderr)  # noqa: T201 - no logger yet
        return EXIT_BAD_INPUT
    return EXECUTABLES[arguments[0]](arguments[1:])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
