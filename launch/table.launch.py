"""The observer on a real table: ``ros2 launch sgms_observer table.launch.py params_file:=my_table.yaml``.

The drive's topics are remapped by ``position_topic``, ``effort_topic`` and ``reference_topic``; give the same name
to the first two for a joint_states topic that carries both. The other launch files include this one.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """Return the observer node with its remappings."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "params_file",
                default_value=PathJoinSubstitution([FindPackageShare("sgms_observer"), "config", "table.yaml"]),
                description="parameter file, made from config/table.yaml",
            ),
            DeclareLaunchArgument("namespace", default_value="", description="namespace of the node and its topics"),
            DeclareLaunchArgument("position_topic", default_value="position", description="JointState with positions"),
            DeclareLaunchArgument(
                "effort_topic", default_value="control_effort", description="JointState with the actuators' efforts"
            ),
            DeclareLaunchArgument(
                "reference_topic", default_value="reference", description="JointState with the set-point; optional"
            ),
            DeclareLaunchArgument(
                "command_topic",
                default_value="~/commands",
                description="Float64MultiArray with the compensation of all axes, for controllers of ros2_control",
            ),
            DeclareLaunchArgument(
                "use_sim_time", default_value="false", description="true: take the time from /clock, of a simulation"
            ),
            DeclareLaunchArgument("log_level", default_value="info", description="debug, info, warn, error or fatal"),
            DeclareLaunchArgument(
                "respawn", default_value="false", description="true: start the node again 2 s after it ended by itself"
            ),
            Node(
                package="sgms_observer",
                executable="observer_node",
                name="observer_node",
                namespace=LaunchConfiguration("namespace"),
                parameters=[
                    LaunchConfiguration("params_file"),
                    {"use_sim_time": ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)},
                ],
                remappings=[
                    ("position", LaunchConfiguration("position_topic")),
                    ("control_effort", LaunchConfiguration("effort_topic")),
                    ("reference", LaunchConfiguration("reference_topic")),
                    ("~/commands", LaunchConfiguration("command_topic")),
                ],
                ros_arguments=["--log-level", LaunchConfiguration("log_level")],
                respawn=LaunchConfiguration("respawn"),
                respawn_delay=2.0,
                output="screen",
            ),
        ]
    )
