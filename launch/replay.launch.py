"""A recorded bag played to the observer: ``ros2 launch sgms_observer replay.launch.py bag:=my_bag``."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, ExecuteProcess, RegisterEventHandler, TimerAction
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """Return the observer node and the player; everything ends with the bag."""
    play = ExecuteProcess(
        cmd=["ros2", "bag", "play", LaunchConfiguration("bag"), "--rate", LaunchConfiguration("rate")], output="screen"
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument("bag", description="folder of the recorded bag"),
            DeclareLaunchArgument("rate", default_value="1.0", description="how many times as fast as recorded"),
            DeclareLaunchArgument("delay", default_value="8.0", description="time for the observer to start [s]"),
            DeclareLaunchArgument(
                "params_file",
                default_value=PathJoinSubstitution([FindPackageShare("sgms_observer"), "config", "table.yaml"]),
                description="parameter file of the observer",
            ),
            Node(
                package="sgms_observer",
                executable="observer_node",
                name="observer_node",
                parameters=[LaunchConfiguration("params_file")],
                output="screen",
            ),
            TimerAction(period=LaunchConfiguration("delay"), actions=[play]),
            RegisterEventHandler(OnProcessExit(target_action=play, on_exit=[EmitEvent(event=Shutdown())])),
        ]
    )
