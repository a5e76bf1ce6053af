"""The observer beside ros2_control: ``ros2 launch sgms_observer ros2_control.launch.py params_file:=my_axis.yaml``.

Starts observer_node on ``joint_states`` and, unless ``spawn:=false``, loads the joint state broadcaster and the forward
effort controller into a running controller_manager. The compensation goes to the controller's command topic. Without
the controllers nothing is left running. With ``namespace:=left`` controller_manager and all topics are in ``/left``.
"""

from launch import Action, LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    IncludeLaunchDescription,
    LogInfo,
    OpaqueFunction,
    RegisterEventHandler,
)
from launch.conditions import IfCondition
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.events.process import ProcessExited
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch.substitutions.substitution_failure import SubstitutionFailure
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackagePrefix, FindPackageShare

NEEDED = ("controller_manager", "forward_command_controller", "joint_state_broadcaster")


def look_for_controllers(context: LaunchContext) -> None:
    """Refuse to start anything where the controllers are not installed."""
    for package in NEEDED:
        try:
            FindPackagePrefix(package).perform(context)
        except (LookupError, SubstitutionFailure):
            apt = " ".join(f"ros-$ROS_DISTRO-{name.replace('_', '-')}" for name in NEEDED)
            raise RuntimeError(
                f"the package {package} is not installed, so nothing was started; run: sudo apt install {apt},"
                " or start the observer alone with spawn:=false"
            ) from None


def end_without_controllers(event: ProcessExited, context: LaunchContext) -> list[Action]:
    """End everything when the controllers could not be loaded: an observer that nobody listens to is no help."""
    if event.returncode == 0:
        return []
    reason = "the controllers could not be loaded, so the observer ends; start controller_manager first"
    return [LogInfo(msg=reason), EmitEvent(event=Shutdown(reason=reason))]


def generate_launch_description() -> LaunchDescription:
    """Return the observer node with its remappings and the spawner of the controllers."""
    share = FindPackageShare("sgms_observer")
    joint_states = LaunchConfiguration("joint_states")
    spawn = IfCondition(LaunchConfiguration("spawn"))
    spawner = Node(
        package="controller_manager",
        executable="spawner",
        namespace=LaunchConfiguration("namespace"),
        arguments=[
            *("joint_state_broadcaster", "friction_controller"),
            *("--param-file", LaunchConfiguration("params_file")),
            *("--controller-manager-timeout", LaunchConfiguration("spawn_timeout")),
        ],
        condition=spawn,
        output="screen",
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "params_file",
                default_value=PathJoinSubstitution([share, "config", "ros2_control.yaml"]),
                description="parameter file with observer_node, controller_manager and the controllers",
            ),
            DeclareLaunchArgument("namespace", default_value="", description="of controller_manager and topics"),
            DeclareLaunchArgument("joint_states", default_value="joint_states", description="positions and efforts"),
            DeclareLaunchArgument(
                "reference_topic", default_value="reference", description="JointState with the set-point; optional"
            ),
            DeclareLaunchArgument(
                "command_topic", default_value="friction_controller/commands", description="Float64MultiArray"
            ),
            DeclareLaunchArgument("spawn", default_value="true", description="load the controllers"),
            DeclareLaunchArgument(
                "spawn_timeout", default_value="30", description="time to wait for controller_manager [s]"
            ),
            DeclareLaunchArgument("use_sim_time", default_value="false", description="true: take the time from /clock"),
            DeclareLaunchArgument("log_level", default_value="info", description="debug, info, warn, error or fatal"),
            DeclareLaunchArgument(
                "respawn", default_value="false", description="true: start the node again 2 s after it ended by itself"
            ),
            OpaqueFunction(function=look_for_controllers, condition=spawn),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(PathJoinSubstitution([share, "launch", "table.launch.py"])),
                launch_arguments={"position_topic": joint_states, "effort_topic": joint_states}.items(),
            ),
            spawner,
            RegisterEventHandler(OnProcessExit(target_action=spawner, on_exit=end_without_controllers)),
        ]
    )
