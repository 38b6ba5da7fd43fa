"""Tracker and overlay: `ros2 launch lasso_motion_ros lasso_motion.launch.py volume_file:=/path/la.stl units:=mm`."""

from __future__ import annotations

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = "lasso_motion_ros"


def text(argument: str) -> ParameterValue:
    """A launch argument as a string parameter, even where it looks like a number."""
    return ParameterValue(LaunchConfiguration(argument), value_type=str)


def generate_launch_description() -> LaunchDescription:
    """Two processes; the input topics are relative, so `namespace` moves the whole graph."""
    share = FindPackageShare(PACKAGE)
    arguments = [
        DeclareLaunchArgument("namespace", default_value="", description="namespace of both nodes"),
        DeclareLaunchArgument(
            "tracker_config",
            default_value=PathJoinSubstitution([share, "config", "tracker.yaml"]),
            description="parameters of the tracker",
        ),
        DeclareLaunchArgument("volume_file", description="surface to draw: STL, PLY or OBJ"),
        DeclareLaunchArgument("units", description="unit of the surface's coordinates: mm or m"),
        DeclareLaunchArgument(
            "registration",
            default_value="0 0 0 0 0 0 1",
            description="volume to world, metres: x y z qx qy qz qw, or 16 numbers of a 4x4 matrix",
        ),
    ]
    tracker = Node(
        package=PACKAGE,
        executable="lasso_tracker",
        name="lasso_tracker",
        namespace=LaunchConfiguration("namespace"),
        parameters=[LaunchConfiguration("tracker_config")],
        output="screen",
    )
    overlay = Node(
        package=PACKAGE,
        executable="lasso_overlay",
        name="lasso_overlay",
        namespace=LaunchConfiguration("namespace"),
        parameters=[
            {
                "volume_file": text("volume_file"),
                "units": text("units"),
                "registration": text("registration"),
            }
        ],
        output="screen",
    )
    return LaunchDescription([*arguments, tracker, overlay])
