"""A simulated stage and its observer: ``ros2 launch sgms_observer demo.launch.py``."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """Return the two nodes on one parameter file; ``table.launch.py`` has the observer."""
    share = FindPackageShare("sgms_observer")
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "params_file",
                default_value=PathJoinSubstitution([share, "config", "demo.yaml"]),
                description="parameter file of both nodes",
            ),
            DeclareLaunchArgument("namespace", default_value="", description="namespace of nodes and topics"),
            DeclareLaunchArgument("use_sim_time", default_value="false", description="true: take the time from /clock"),
            DeclareLaunchArgument("log_level", default_value="info", description="debug, info, warn, error or fatal"),
            DeclareLaunchArgument(
                "respawn", default_value="false", description="true: start a node again 2 s after it ended by itself"
            ),
            Node(
                package="sgms_observer",
                executable="stage_node",
                name="stage_node",
                namespace=LaunchConfiguration("namespace"),
                parameters=[
                    LaunchConfiguration("params_file"),
                    {"use_sim_time": ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)},
                ],
                ros_arguments=["--log-level", LaunchConfiguration("log_level")],
                respawn=LaunchConfiguration("respawn"),
                respawn_delay=2.0,
                output="screen",
            ),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(PathJoinSubstitution([share, "launch", "table.launch.py"]))
            ),
        ]
    )
