"""The tracker alone: `ros2 launch lasso_motion_ros tracker.launch.py namespace:=lab`."""

from __future__ import annotations

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

PACKAGE = "lasso_motion_ros"


def generate_launch_description() -> LaunchDescription:
    """One process; the input topics are relative, so `namespace` moves them."""
    config = PathJoinSubstitution([FindPackageShare(PACKAGE), "config", "tracker.yaml"])
    return LaunchDescription(
        [
            DeclareLaunchArgument("namespace", default_value="", description="namespace of the node"),
            DeclareLaunchArgument("tracker_config", default_value=config, description="parameters of the tracker"),
            Node(
                package=PACKAGE,
                executable="lasso_tracker",
                name="lasso_tracker",
                namespace=LaunchConfiguration("namespace"),
                parameters=[LaunchConfiguration("tracker_config")],
                output="screen",
            ),
        ]
    )
