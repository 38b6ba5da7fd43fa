"""Tracker and overlay for one biplane system: ros2 launch lasso_motion_ros tracker.launch.py namespace:=lab …."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, PythonExpression
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

PACKAGE = "lasso_motion_ros"


def generate_launch_description() -> LaunchDescription:
    """The tracker, and the overlay where a surface is given."""
    share = FindPackageShare(PACKAGE)
    arguments = {
        "namespace": ("", "where plane_a/… and plane_b/… are"),
        "tracker_config": (PathJoinSubstitution([share, "config", "tracker.yaml"]), "parameters of the tracker"),
        "overlay_config": (PathJoinSubstitution([share, "config", "overlay.yaml"]), "parameters of the overlay"),
        "volume_file": ("", "surface to draw (STL, PLY or OBJ); empty: no overlay"),
        "units": ("mm", "unit of the surface file's coordinates, mm or m"),
    }
    namespace, volume = LaunchConfiguration("namespace"), LaunchConfiguration("volume_file")
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=description)
                for name, (default, description) in arguments.items()
            ),
            Node(
                package=PACKAGE,
                executable="lasso_tracker",
                namespace=namespace,
                parameters=[LaunchConfiguration("tracker_config")],
                output="screen",
            ),
            Node(
                package=PACKAGE,
                executable="lasso_overlay",
                namespace=namespace,
                parameters=[
                    LaunchConfiguration("overlay_config"),
                    {"volume_file": volume, "units": LaunchConfiguration("units")},
                ],
                condition=IfCondition(PythonExpression(["'", volume, "' != ''"])),
                output="screen",
            ),
        ]
    )
