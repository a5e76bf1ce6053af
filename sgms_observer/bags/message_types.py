"""What a bag must say about the messages in it: definitions, hashes and QoS, as ROS 2 Jazzy writes them."""

from __future__ import annotations

from dataclasses import dataclass

JOINT_STATE = "sensor_msgs/msg/JointState"
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"

_RULE = "=" * 80
_HEADER = f"""{_RULE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_RULE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


@dataclass(frozen=True)
class MessageType:
    """A message type as bags describe it.

    Attributes:
        name: such as ``sensor_msgs/msg/JointState``.
        definition: its fields and those of the types in it, format ros2msg; empty where unknown.
        digest: type hash (RIHS01); empty where unknown.
    """

    name: str
    definition: str
    digest: str


_KNOWN = {
    JOINT_STATE: MessageType(
        JOINT_STATE,
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n" + _HEADER,
        "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    ),
    DIAGNOSTICS: MessageType(
        DIAGNOSTICS,
        f"""std_msgs/Header header
diagnostic_msgs/DiagnosticStatus[] status
{_HEADER}{_RULE}
MSG: diagnostic_msgs/DiagnosticStatus
byte OK=0
byte WARN=1
byte ERROR=2
byte STALE=3
byte level
string name
string message
string hardware_id
diagnostic_msgs/KeyValue[] values
{_RULE}
MSG: diagnostic_msgs/KeyValue
string key
string value
""",
        "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    ),
    TRAJECTORY: MessageType(
        TRAJECTORY,
        f"""std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint[] points
{_HEADER}{_RULE}
MSG: trajectory_msgs/JointTrajectoryPoint
float64[] positions
float64[] velocities
float64[] accelerations
float64[] effort
builtin_interfaces/Duration time_from_start
{_RULE}
MSG: builtin_interfaces/Duration
int32 sec
uint32 nanosec
""",
        "RIHS01_179b33eba59d676f6d967ac71fe35e7ca2f64b2f3928f4a018cec115e213796e",
    ),
}


def describe_type(name: str) -> MessageType:
    """Return how bags describe a message type.

    Args:
        name: such as ``sensor_msgs/msg/JointState``.

    Returns:
        The description; for a type that neither this package nor ``rosbags`` knows, one without definition and
        hash, which bags may hold too.
    """
    if name in _KNOWN:
        return _KNOWN[name]
    try:
        from rosbags.typesys import Stores, get_typestore

        store = get_typestore(Stores.ROS2_JAZZY)
        definition, _ = store.generate_msgdef(name, ros_version=2)
        return MessageType(name, definition, store.hash_rihs01(name))
    except Exception:  # rosbags is optional here, and what it raises for unknown types varies with its version
        return MessageType(name, "", "")


# What our own publishers offer; `ros2 bag play` offers the same again. Times mean "for ever".
_FOREVER = {"sec": 9223372036, "nsec": 854775807}
OFFERED_QOS: dict[str, object] = {
    "history": "keep_last",
    "depth": 2000,
    "reliability": "reliable",
    "durability": "volatile",
    "deadline": _FOREVER,
    "lifespan": _FOREVER,
    "liveliness": "automatic",
    "liveliness_lease_duration": _FOREVER,
    "avoid_ros_namespace_conventions": False,
}
