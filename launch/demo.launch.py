"""The bundled recording, over and over, with tracker and overlay: `ros2 launch lasso_motion_ros demo.launch.py`.

RViz shows it where it is installed; `rviz:=false` leaves it out, `web:=true` serves the page in the browser,
`bag:=FILE` plays another recording with truth.
"""

from __future__ import annotations

import atexit
import shutil
import tempfile
from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    IncludeLaunchDescription,
    OpaqueFunction,
    Shutdown,
)
from launch.launch_description_entity import LaunchDescriptionEntity
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackagePrefix, FindPackageShare

from lasso_motion_ros.core.share import bundled_recording
from lasso_motion_ros.tools.demo_surface import write_demo_surface

PACKAGE = "lasso_motion_ros"


def graph(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Player, tracker and overlay, the surface made to fit the recording.

    Raises:
        RuntimeError: there is no such recording.
    """
    recording = Path(LaunchConfiguration("bag").perform(context))
    if not recording.exists():  # before any process runs
        raise RuntimeError(f"bag:={recording}: there is no such recording")
    directory = tempfile.mkdtemp(prefix="lasso_motion_")
    atexit.register(shutil.rmtree, directory, ignore_errors=True)
    surface = Path(directory) / "left_atrium.stl"
    write_demo_surface(recording, surface)
    system = PathJoinSubstitution([FindPackageShare(PACKAGE), "launch", "lasso_motion.launch.py"])
    command = PathJoinSubstitution([FindPackagePrefix(PACKAGE), "lib", PACKAGE, "lasso-motion"])
    return [
        IncludeLaunchDescription(
            PythonLaunchDescriptionSource(system),
            launch_arguments={
                "volume_file": str(surface),
                "units": "mm",
                "web": LaunchConfiguration("web"),
                "rviz": LaunchConfiguration("rviz"),
            }.items(),
        ),
        ExecuteProcess(
            cmd=[command, "play", str(recording), "--loop", "--wait", "60", "--subscribers", "2"],
            output="screen",
            on_exit=Shutdown(reason="the player has ended"),
        ),
    ]


def generate_launch_description() -> LaunchDescription:
    """Three processes, and what shows them."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("bag", default_value=str(bundled_recording()), description="recording to play"),
            DeclareLaunchArgument("web", default_value="false", description="serve the page in the browser"),
            DeclareLaunchArgument("rviz", default_value="auto", description="show it in RViz: true, false, auto"),
            OpaqueFunction(function=graph),
        ]
    )
