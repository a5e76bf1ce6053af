"""The observer beside ros2_control: ``ros2 launch sgms_observer ros2_control.launch.py params_file:=my_axis.yaml``.

Starts observer_node on ``joint_states`` and, unless ``spawn:=false``, loads the joint state broadcaster and the forward
effort controller into a running controller_manager. The compensation goes to the controller's command topic.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """Return the observer node with its remappings and the spawner of the controllers."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "params_file",
                default_value=PathJoinSubstitution([FindPackageShare("sgms_observer"), "config", "ros2_control.yaml"]),
                description="parameter file with observer_node, controller_manager and the controllers",
            ),
            DeclareLaunchArgument("joint_states", default_value="/joint_states", description="positions and efforts"),
            DeclareLaunchArgument(
                "reference_topic", default_value="reference", description="JointState with the set-point; optional"
            ),
            DeclareLaunchArgument(
                "command_topic", default_value="/friction_controller/commands", description="Float64MultiArray"
            ),
            DeclareLaunchArgument("spawn", default_value="true", description="load the controllers"),
            Node(
                package="sgms_observer",
                executable="observer_node",
                name="observer_node",
                parameters=[LaunchConfiguration("params_file")],
                remappings=[
                    ("position", LaunchConfiguration("joint_states")),
                    ("control_effort", LaunchConfiguration("joint_states")),
                    ("reference", LaunchConfiguration("reference_topic")),
                    ("~/commands", LaunchConfiguration("command_topic")),
                ],
                output="screen",
            ),
            Node(
                package="controller_manager",
                executable="spawner",
                arguments=[
                    "joint_state_broadcaster",
                    "friction_controller",
                    "--param-file",
                    LaunchConfiguration("params_file"),
                ],
                condition=IfCondition(LaunchConfiguration("spawn")),
                output="screen",
            ),
        ]
    )
