"""Where the process `lasso-motion` begins."""

from __future__ import annotations

from lasso_motion_ros.core.signals import end_at_once


def start() -> int:
    """Run the command that the process's arguments name; returns the exit status. Ctrl-C is quiet from here on."""
    end_at_once()
    from lasso_motion_ros.cli.main import main

    return main()
