"""The launch files on a ROS machine: they need launch_ros, and the package installed by colcon."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("launch_ros", reason="needs launch_ros")
pytest.importorskip("rclpy", reason="needs ROS 2")

from ament_index_python.packages import PackageNotFoundError, get_package_prefix

from lasso_motion_ros.tools.processes import LOOPBACK, free_domain

pytestmark = pytest.mark.ros

PACKAGE = "lasso_motion_ros"
PATIENCE_S = 60.0
LAUNCH = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
arguments = [tuple(word.split(":=")) for word in sys.argv[2:]]
source = PythonLaunchDescriptionSource(sys.argv[1])
service = LaunchService()
service.include_launch_description(IncludeLaunchDescription(source, launch_arguments=arguments))
sys.exit(service.run())
"""


def prefix_of(package: str) -> Path | None:
    try:
        return Path(get_package_prefix(package))
    except PackageNotFoundError:
        return None


@pytest.fixture
def launch_file() -> Path:
    prefix = prefix_of(PACKAGE)
    path = None if prefix is None else prefix / "share" / PACKAGE / "launch" / "demo.launch.py"
    if path is None or not path.is_file():
        pytest.skip("needs the package installed by colcon")
    return path


def of_session(session: int) -> list[int]:
    """The processes of a session that still run (Linux: /proc)."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rsplit(")", 1)[1].split()
            except OSError:
                continue  # it has ended meanwhile
            if int(fields[3]) == session and fields[0] != "Z":
                found.append(int(entry.name))
    return found


def start(launch_file: Path, log: Path, *arguments: str) -> subprocess.Popen[bytes]:
    """In a session of its own, by which all that it starts is found, with temporary files beside the log."""
    log.with_name("tmp").mkdir()
    with log.open("wb") as output:
        return subprocess.Popen(
            [sys.executable, "-c", LAUNCH, str(launch_file), *arguments],
            env={**os.environ, **LOOPBACK, "ROS_DOMAIN_ID": str(free_domain()), "TMPDIR": str(log.with_name("tmp"))},
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )


def of_ours(log: Path) -> list[str]:
    """The temporary files that are left and not launch's own (`launch_params_…`)."""
    return [path.name for path in log.with_name("tmp").glob("lasso_motion_*")]


def test_the_demonstration_runs_without_rviz_and_leaves_nothing_behind(tmp_path: Path, launch_file: Path) -> None:
    log = tmp_path / "launch.log"
    launched = start(launch_file, log, f"rviz:={'false' if prefix_of('rviz2') else 'auto'}")
    deadline = time.monotonic() + PATIENCE_S
    while len(of_session(launched.pid)) < 4 and launched.poll() is None and time.monotonic() < deadline:
        time.sleep(0.1)
    assert len(of_session(launched.pid)) == 4, log.read_text()  # itself, tracker, overlay, player
    launched.send_signal(signal.SIGINT)
    launched.wait(PATIENCE_S)
    assert of_session(launched.pid) == []
    assert of_ours(log) == []


@pytest.mark.skipif(prefix_of("rviz2") is not None, reason="RViz is installed here")
def test_rviz_that_is_asked_for_and_missing_is_said_before_anything_runs(tmp_path: Path, launch_file: Path) -> None:
    log = tmp_path / "launch.log"
    launched = start(launch_file, log, "rviz:=true")
    assert launched.wait(PATIENCE_S) == 1
    assert "rviz:=true needs rviz2" in log.read_text()
    assert of_session(launched.pid) == []
    assert of_ours(log) == []
