"""Without ROS everything says what to install; complaints are throttled."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from lasso_motion_ros.nodes import running
from lasso_motion_ros.nodes.ros_start import NO_ROS
from lasso_motion_ros.nodes.running import ThrottledLog, guarded


@pytest.mark.slow
@pytest.mark.parametrize(
    ("call", "prefix"),
    [
        ("from lasso_motion_ros.cli.main import main; sys.exit(main(['play', 'none.mcap']))", "lasso-motion play: "),
        ("from lasso_motion_ros.cli.main import main; sys.exit(main(['demo']))", "lasso-motion demo: "),
        ("from lasso_motion_ros.nodes.executables import lasso_tracker; sys.exit(lasso_tracker([]))", ""),
        ("from lasso_motion_ros.nodes.executables import lasso_overlay; sys.exit(lasso_overlay([]))", ""),
    ],
)
def test_without_ros_one_line_says_what_to_install(call: str, prefix: str, tmp_path: Path) -> None:
    code = f"import sys; sys.modules['rclpy'] = None; {call}"
    done = subprocess.run(  # in a folder of its own: where `make demo` has been run, its output is there already
        [sys.executable, "-c", code], capture_output=True, encoding="utf-8", timeout=120, check=False, cwd=tmp_path
    )
    assert done.returncode == 2
    assert done.stderr == f"{prefix}{NO_ROS}\n"


class Logger:
    def __init__(self) -> None:
        self.said: list[str] = []

    def warning(self, text: str) -> None:
        self.said.append(text)


def test_a_complaint_is_made_once_in_a_while_for_each_subject(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr(running.time, "monotonic", lambda: now)
    logger = Logger()
    log = ThrottledLog(logger)
    log.complain("plane_a", "first")
    log.complain("plane_a", "second")
    log.complain("plane_b", "other")
    log.complain("plane_a", "third")
    now = 105.0
    log.complain("plane_a", "fourth")
    assert logger.said == ["plane_a: first", "plane_b: other", "plane_a: fourth (and 2 more)"]


def test_what_a_callback_raises_becomes_a_complaint() -> None:
    class Node:
        def __init__(self) -> None:
            self.logger = Logger()
            self.complaints = ThrottledLog(self.logger)

        @guarded
        def callback(self, value: int) -> int:
            return 1 // value

    node = Node()
    assert node.callback(1) == 1
    assert node.callback(0) is None
    assert node.logger.said == ["ZeroDivisionError: integer division or modulo by zero"]
