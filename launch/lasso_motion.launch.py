"""Tracker and overlay: `ros2 launch lasso_motion_ros lasso_motion.launch.py volume_file:=/path/la.stl units:=mm`.

`web:=true` serves the page in the browser, where clicks start the tracker; `rviz:=true` shows the graph in RViz,
`rviz:=auto` does where RViz is installed.
"""

from __future__ import annotations

from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction
from launch.conditions import IfCondition
from launch.launch_description_entity import LaunchDescriptionEntity
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = "lasso_motion_ros"
VIEWERS = ("rviz2", "tf2_ros")


def text(argument: str) -> ParameterValue:
    """A launch argument as a string parameter, even where it looks like a number."""
    return ParameterValue(LaunchConfiguration(argument), value_type=str)


def is_installed(package: str) -> bool:
    """Whether a ROS package is there."""
    try:
        get_package_prefix(package)
    except PackageNotFoundError:
        return False
    return True


def viewers(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """RViz and the frame that it needs; asked for before any process runs, since a failed launch leaves them behind.

    Raises:
        RuntimeError: `rviz:=true`, and it is not installed.
    """
    wanted = LaunchConfiguration("rviz").perform(context).lower()
    if wanted not in ("true", "false", "auto"):
        raise RuntimeError(f"rviz:={wanted}: expected true, false or auto")
    missing = ", ".join(package for package in VIEWERS if not is_installed(package))
    if wanted == "false":
        return []
    if missing and wanted == "true":
        raise RuntimeError(f"rviz:=true needs {missing}, not installed here: install it, or look with web:=true")
    if missing:
        return [LogInfo(msg=f"not shown in RViz: {missing} is not installed here; web:=true shows it in the browser")]
    # All markers are in patient_table; RViz shows a frame only once somebody speaks of it on /tf_static.
    frame = Node(
        package="tf2_ros",
        executable="static_transform_publisher",
        arguments=["--frame-id", "map", "--child-frame-id", "patient_table"],
    )
    configuration = PathJoinSubstitution([FindPackageShare(PACKAGE), "config", "lasso_motion.rviz"])
    return [frame, Node(package="rviz2", executable="rviz2", arguments=["-d", configuration])]


def generate_launch_description() -> LaunchDescription:
    """Two processes, and what shows them; the input topics are relative, so `namespace` moves the whole graph."""
    share = FindPackageShare(PACKAGE)
    arguments = [
        DeclareLaunchArgument("namespace", default_value="", description="namespace of both nodes"),
        DeclareLaunchArgument(
            "tracker_config",
            default_value=PathJoinSubstitution([share, "config", "tracker.yaml"]),
            description="parameters of the tracker",
        ),
        DeclareLaunchArgument(
            "overlay_config",
            default_value=PathJoinSubstitution([share, "config", "overlay.yaml"]),
            description="parameters of the overlay: colours, what is shown of a volume",
        ),
        DeclareLaunchArgument(
            "volume_file", description="what to draw: STL, PLY, OBJ, VTK, VTP, NIfTI, NRRD, MHA, DICOM"
        ),
        DeclareLaunchArgument("units", default_value="", description="of the file's coordinates: mm or m"),
        DeclareLaunchArgument(
            "registration",
            default_value="0 0 0 0 0 0 1",
            description="volume to world, metres: x y z qx qy qz qw, or 16 numbers of a 4x4 matrix",
        ),
        DeclareLaunchArgument("web", default_value="false", description="serve the page in the browser"),
        DeclareLaunchArgument("web_port", default_value="8080", description="TCP port of the page"),
        DeclareLaunchArgument("rviz", default_value="false", description="show it in RViz: true, false, auto"),
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
            LaunchConfiguration("overlay_config"),
            {
                "volume_file": text("volume_file"),
                "units": text("units"),
                "registration": text("registration"),
            },
        ],
        output="screen",
    )
    page = Node(
        package=PACKAGE,
        executable="lasso_web",
        name="lasso_web",
        namespace=LaunchConfiguration("namespace"),
        parameters=[
            PathJoinSubstitution([share, "config", "web.yaml"]),
            {"port": ParameterValue(LaunchConfiguration("web_port"), value_type=int)},
        ],
        output="screen",
        condition=IfCondition(LaunchConfiguration("web")),
    )
    return LaunchDescription([*arguments, OpaqueFunction(function=viewers), tracker, overlay, page])
