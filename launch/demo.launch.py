"""A simulated stage and its observer: ``ros2 launch sgms_observer demo.launch.py``."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """Return the two nodes on one parameter file."""
    params_file = LaunchConfiguration("params_file")
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "params_file",
                default_value=PathJoinSubstitution([FindPackageShare("sgms_observer"), "config", "demo.yaml"]),
                description="parameter file of both nodes",
            ),
            Node(package="sgms_observer", executable="stage_node", name="stage_node", parameters=[params_file]),
            Node(package="sgms_observer", executable="observer_node", name="observer_node", parameters=[params_file]),
        ]
    )
