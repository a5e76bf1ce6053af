"""The compensation as commands of ros2_control: std_msgs/Float64MultiArray, one number per axis."""

from __future__ import annotations

import struct
import time
from collections.abc import Sequence

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64MultiArray

from sgms_observer.compensation.safety import safe_output
from sgms_observer.nodes.topics import LAST_WORDS
from sgms_observer.settings.axis import Settings

COMMANDS = "~/commands"

#: As the command topics of ros2_controllers: only the latest counts.
_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
_LITTLE_ENDIAN = b"\x00\x01\x00\x00"


def encode_commands(forces: Sequence[float]) -> bytes:
    """Return a Float64MultiArray without dimensions as bytes (XCDR1).

    Args:
        forces: data, in order [N].
    """
    return _LITTLE_ENDIAN + struct.pack(f"<IIIxxxx{len(forces)}d", 0, 0, len(forces), *forces)


class CommandTopic:
    """Sends the latest compensation of all axes, in the order of ``axes``, to whoever listens.

    The message has no stamp: the receiver holds the last one, so the node sends zeros when it stops or hears nothing.

    Of samples that are too old it sends zero instead: it goes there, and back, within the slew limit of each axis.

    Args:
        node: the node; remap ``~/commands`` to the controller's own topic.
        settings: of all axes.

    Attributes:
        settings: as given; may be replaced.
    """

    def __init__(self, node: Node, settings: Settings) -> None:
        self.settings = settings
        self._node = node
        self._sent = [0.0] * len(settings.axes)
        self._sent_at = time.monotonic()
        self._is_apart = False
        self._publisher = node.create_publisher(Float64MultiArray, COMMANDS, _QOS)

    def publish(self, forces: Sequence[float], is_late: bool = False) -> None:
        """Send the forces [N], if anybody listens.

        Args:
            forces: one per axis [N], in the order of ``axes``.
            is_late: whether their samples are too old to be of use.
        """
        now = time.monotonic()
        if is_late or self._is_apart:
            wanted = [0.0] * len(forces) if is_late else list(forces)
            axes = zip(self._sent, wanted, self.settings.axes, strict=True)
            forces = [
                safe_output(sent, force, now - self._sent_at, axis.compensation.limit, axis.compensation.slew_limit)
                for sent, force, axis in axes
            ]
            self._is_apart = is_late or forces != wanted
        self._sent, self._sent_at = list(forces), now
        if self._publisher.get_subscription_count():
            self._publisher.publish(encode_commands(forces))

    def wait_acknowledged(self) -> None:
        """Wait until the latest message has arrived, for ``LAST_WORDS`` at most."""
        self._publisher.wait_for_all_acked(LAST_WORDS)

    def destroy(self) -> None:
        """Remove the publisher from the graph."""
        self._node.destroy_publisher(self._publisher)
