"""What keeps a process from starting is one line and status 2: nodes and commands, real processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from lasso_motion_ros.core.share import bundled_recording

NODE = "from lasso_motion_ros.nodes.executables import main"
COMMAND = "from lasso_motion_ros.cli.main import main"
RCLPY_OF_ANOTHER_PYTHON = "raise ImportError('No module named rclpy._rclpy_pybind11\\nmore')"


def run(what: str, words: str, environment: dict[str, str], before: str = "") -> subprocess.CompletedProcess[str]:
    code = f"import sys; {before}\n{what}\nsys.exit(main(sys.argv[1:]))"
    return subprocess.run(
        [sys.executable, "-c", code, *words.split()],
        env={**os.environ, **environment},
        capture_output=True,
        encoding="utf-8",
        timeout=120,
        check=False,
    )


FOREIGN_RMW = {"RMW_IMPLEMENTATION": "rmw_of_another"}
NO_LOGS = {"ROS_LOG_DIR": "/proc/none"}
RMW_SAID = "RMW_IMPLEMENTATION: 'rmw_of_another' cannot be used here: Expected RMW implementation identifier"
RCLPY_SAID = "rclpy cannot be used: No module named rclpy._rclpy_pybind11 more; is another distribution of ROS 2 on"
LOGS_SAID = "failed to initialize logging: Failed to create log directory '/proc/none'"
FILE_SAID = "Couldn't parse params file: '--params-file TMP"


@pytest.mark.parametrize(
    ("words", "environment", "said"),
    [
        ("lasso_tracker --ros-args --params-file TMP/none.yaml", {}, f"{FILE_SAID}/none.yaml'. Error: Error opening"),
        (
            "lasso_overlay --ros-args --params-file TMP/bad.yaml",
            {},
            f"{FILE_SAID}/bad.yaml'. Error: Cannot have a value",
        ),
        ("lasso_tracker --ros-args --params-file TMP", {}, FILE_SAID),
        ("lasso_web --ros-args -r foo", {}, "Couldn't parse remap rule: '-r foo'"),
        ("lasso_tracker --ros-args --foo", {}, "ROS does not know these arguments: ['--foo']"),
        ("lasso_tracker", {"ROS_DOMAIN_ID": "abc"}, "ROS_DOMAIN_ID: expected 0 to 232, found 'abc'"),
        ("lasso_overlay", NO_LOGS, LOGS_SAID),
        ("lasso_tracker", FOREIGN_RMW, RMW_SAID),
        ("lasso_tracker", {"PYTHONPATH": "TMP"}, RCLPY_SAID),
        ("record TMP/out.mcap", {"ROS_DOMAIN_ID": "abc"}, "lasso-motion record: ROS_DOMAIN_ID: expected 0 to 232"),
        ("demo --web --out TMP/out", {"ROS_DOMAIN_ID": "233"}, "lasso-motion demo: ROS_DOMAIN_ID: expected 0 to 232"),
        ("record TMP/out.mcap", NO_LOGS, f"lasso-motion record: {LOGS_SAID}"),
        ("play BAG", NO_LOGS, f"lasso-motion play: {LOGS_SAID}"),
        ("check", FOREIGN_RMW, f"lasso-motion check: {RMW_SAID}"),
        ("check", {"PYTHONPATH": "TMP"}, f"lasso-motion check: {RCLPY_SAID}"),
    ],
)
def test_a_mistake_is_one_line(words: str, environment: dict[str, str], said: str, tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text("a: {ros__parameters: 5}")
    (tmp_path / "rclpy").mkdir()
    (tmp_path / "rclpy" / "__init__.py").write_text(RCLPY_OF_ANOTHER_PYTHON)
    path = os.environ.get("PYTHONPATH", "")
    given = {name: value.replace("TMP", f"{path}:{tmp_path}") for name, value in environment.items()}
    before = f"sys.path.insert(0, {str(tmp_path)!r})" if "PYTHONPATH" in environment else ""
    what = NODE if words.startswith("lasso_") else COMMAND
    done = run(what, words.replace("TMP", str(tmp_path)).replace("BAG", str(bundled_recording())), given, before)
    assert done.stderr.startswith(said.replace("TMP", str(tmp_path))), done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    assert done.returncode == 2
    assert not (tmp_path / "out.mcap").exists()


INTERRUPT = """
import importlib.abc, os, signal
class Interrupt(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == 'cv2':
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interrupt())
"""


@pytest.mark.ros
def test_ctrl_c_during_a_nodes_imports_ends_it_cleanly() -> None:
    done = run(NODE, "lasso_tracker", {}, INTERRUPT)
    assert (done.returncode, done.stderr.count("Traceback")) == (0, 0), done.stderr
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


LONG_START = """
import os, signal, time
from lasso_motion_ros.stream import warm_up
def start_for_long(*_):
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(1000.0)
warm_up.warm_up = start_for_long
"""


LOST_IN_COMPILED_CODE = """
import os, signal
from lasso_motion_ros.stream import warm_up
def start_compiled(*_):
    try:
        os.kill(os.getpid(), signal.SIGTERM)
    except KeyboardInterrupt as interrupt:
        raise SystemError('CPUDispatcher(...) returned a result with an exception set') from interrupt
warm_up.warm_up = start_compiled
"""


ONCE_MORE = """
import os, signal
class AtTheEnd:
    def __del__(self, kill=os.kill, process=os.getpid(), number=signal.SIGINT):
        kill(process, number)
at_the_end = AtTheEnd()
"""


@pytest.mark.ros
def test_one_more_ctrl_c_while_python_ends_is_no_failure() -> None:
    """Launch sends one of its own where the player has ended by the terminal's."""
    done = run(NODE, "lasso_tracker", {}, LONG_START + ONCE_MORE)
    assert (done.returncode, done.stderr.count("Traceback")) == (0, 0), done.stderr


@pytest.mark.ros
@pytest.mark.parametrize("start", [LONG_START, LOST_IN_COMPILED_CODE], ids=["long", "compiled"])
def test_a_signal_does_not_wait_for_a_start_that_takes_long(start: str) -> None:
    done = run(NODE, "lasso_tracker", {}, start)
    assert (done.returncode, done.stderr.count("Traceback")) == (0, 0), done.stderr
