"""A recorded bag played to the observer: ``ros2 launch sgms_observer replay.launch.py bag:=my_bag``.

``position_topic``, ``effort_topic`` and ``reference_topic`` are the topics of the bag; give the same name to the first
two for a joint_states topic that carries both. They are played under their names in the bag, whatever the namespace of
the observer is. Nothing else of the bag is played: old estimates do not mix with new ones.
"""

from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    ExecuteProcess,
    IncludeLaunchDescription,
    RegisterEventHandler,
)
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, PythonExpression
from launch_ros.substitutions import FindPackagePrefix, FindPackageShare


def name_in_bag(topic: LaunchConfiguration) -> PythonExpression:
    """Return the full name of a topic, as bags have it; a relative one would be looked for in the namespace."""
    return PythonExpression(["'/' + '", topic, "'.lstrip('/')"])


def generate_launch_description() -> LaunchDescription:
    """Return the observer node and the player, which waits for it; everything ends with the bag."""
    share = FindPackageShare("sgms_observer")
    topics = {
        "position_topic": name_in_bag(LaunchConfiguration("position_topic")),
        "effort_topic": name_in_bag(LaunchConfiguration("effort_topic")),
        "reference_topic": name_in_bag(LaunchConfiguration("reference_topic")),
    }
    play = ExecuteProcess(
        cmd=[
            PathJoinSubstitution([FindPackagePrefix("sgms_observer"), "lib", "sgms_observer", "sgms"]),
            *("play", LaunchConfiguration("bag"), "--rate", LaunchConfiguration("rate")),
            *("--wait", "120", "--topics", *topics.values()),
        ],
        output="screen",
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument("bag", description="folder of the recorded bag"),
            DeclareLaunchArgument("rate", default_value="1.0", description="how many times as fast as recorded"),
            DeclareLaunchArgument("position_topic", default_value="position", description="JointState with positions"),
            DeclareLaunchArgument(
                "effort_topic", default_value="control_effort", description="JointState with the actuators' efforts"
            ),
            DeclareLaunchArgument(
                "reference_topic", default_value="reference", description="JointState with the set-point; optional"
            ),
            DeclareLaunchArgument(
                "params_file",
                default_value=PathJoinSubstitution([share, "config", "table.yaml"]),
                description="parameter file of the observer",
            ),
            DeclareLaunchArgument("namespace", default_value="", description="namespace of the node and what it gives"),
            DeclareLaunchArgument("log_level", default_value="info", description="debug, info, warn, error or fatal"),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(PathJoinSubstitution([share, "launch", "table.launch.py"])),
                launch_arguments={"use_sim_time": "false", "respawn": "false", **topics}.items(),
            ),
            play,
            RegisterEventHandler(OnProcessExit(target_action=play, on_exit=[EmitEvent(event=Shutdown())])),
        ]
    )
