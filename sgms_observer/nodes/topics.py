"""Topics of the nodes: quality of service, prepared bytes of messages, commands, what an observer gives out."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions, QoSPolicyKind
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from sgms_observer.bags.cdr import JointStateEncoder
from sgms_observer.bags.rows import BY_ARRAYS, encode_joint_states
from sgms_observer.compensation.safety import safe_output
from sgms_observer.observer.outgoing import COMPENSATION, HORIZON, JOINT_STATE_TOPICS, OutgoingBlock
from sgms_observer.settings.axis import Settings

COMMANDS = "~/commands"


def reliable(depth: int) -> QoSProfile:
    """Return a reliable quality of service.

    Args:
        depth: messages that wait at most.
    """
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.VOLATILE,
    )


#: A depth of 10 loses samples at 1 kHz; this one holds a second at 10 kHz.
SAMPLE_QOS = reliable(10_000)
#: Horizons: a newer one replaces the one before it.
HORIZON_QOS = reliable(10)
#: As the command topics of ros2_controllers: only the latest counts.
_COMMAND_QOS = reliable(1)
#: How long the last messages of a node that ends are waited for, by whoever wants them acknowledged.
LAST_WORDS = Duration(seconds=0.2)

_LITTLE_ENDIAN = b"\x00\x01\x00\x00"


def subscribe(
    node: Node,
    topic: str,
    callback: Callable[[bytes], None],
    kind: type[JointState] | type[JointTrajectory] = JointState,
    qos: QoSProfile = SAMPLE_QOS,
) -> Subscription:
    """Subscribe to a topic's messages as bytes; users override the QoS with ``qos_overrides`` parameters.

    Args:
        node: the node.
        topic: relative name.
        callback: takes one message.
        kind: of the messages.
        qos: of the subscription.
    """
    options = QoSOverridingOptions(policy_kinds=(QoSPolicyKind.RELIABILITY, QoSPolicyKind.DEPTH))
    return node.create_subscription(kind, topic, callback, qos, raw=True, qos_overriding_options=options)


class JointStateTopics:
    """Publishers of JointState topics that send whole blocks.

    Args:
        node: the node.
        topics: relative names.
    """

    def __init__(self, node: Node, topics: tuple[str, ...]) -> None:
        self._node = node
        self._publishers: dict[str, Publisher] = {
            topic: node.create_publisher(JointState, topic, SAMPLE_QOS) for topic in topics
        }
        self._encoders: dict[tuple[str, tuple[str, ...]], JointStateEncoder] = {}

    def publish(self, block: OutgoingBlock, is_heard: bool = False) -> None:
        """Send every message of a block, if anybody listens.

        Args:
            block: messages of one of the topics.
            is_heard: whether somebody is taken to listen; to ask takes a fifth of the time of a message.
        """
        publisher = self._publishers[block.topic]
        if not is_heard and not publisher.get_subscription_count():
            return
        publish = publisher.publish
        if len(block.stamp_ns) >= BY_ARRAYS:
            for row in encode_joint_states(block.stamp_ns, block.names, dict(block.values)):
                publish(row.tobytes())
            return
        encoder = self._encoders.get((block.topic, block.names))
        if encoder is None:
            encoder = self._encoders[block.topic, block.names] = JointStateEncoder(block.names, tuple(block.values))
        if len(block.stamp_ns) == 1:
            publish(encoder.encode(int(block.stamp_ns[0]), *[values[0].tolist() for values in block.values.values()]))
            return
        columns = [values.tolist() for values in block.values.values()]
        for stamp, *fields in zip(block.stamp_ns.tolist(), *columns, strict=True):
            publish(encoder.encode(stamp, *fields))

    def wait_acknowledged(self) -> None:
        """Wait until what was sent has arrived, for ``LAST_WORDS`` at most: a publisher that is gone sends nothing."""
        for publisher in self._publishers.values():
            publisher.wait_for_all_acked(LAST_WORDS)

    def destroy(self) -> None:
        """Remove the publishers from the graph."""
        for publisher in self._publishers.values():
            self._node.destroy_publisher(publisher)
        self._publishers.clear()


def encode_commands(forces: Sequence[float]) -> bytes:
    """Return a Float64MultiArray without dimensions as bytes (XCDR1).

    Args:
        forces: data, in order [N].
    """
    return _LITTLE_ENDIAN + struct.pack(f"<IIIxxxx{len(forces)}d", 0, 0, len(forces), *forces)


class CommandTopic:
    """Sends the latest compensation of all axes, in the order of ``axes``, as commands of ros2_control.

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
        self._publisher = node.create_publisher(Float64MultiArray, COMMANDS, _COMMAND_QOS)

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


class Outlets:
    """What an observer gives out with its samples: estimates, commands, horizons.

    Args:
        node: publishes them.
        settings: of its axes.

    Attributes:
        topics: the estimates.
        commands: the commands of controllers.
    """

    def __init__(self, node: Node, settings: Settings) -> None:
        self._node = node
        self.topics = JointStateTopics(node, JOINT_STATE_TOPICS)
        self.commands = CommandTopic(node, settings)
        self._horizons = node.create_publisher(JointTrajectory, HORIZON, HORIZON_QOS)

    def give_horizons(self, messages: Iterable[bytes]) -> None:
        """Publish horizons, if anybody listens.

        Args:
            messages: made only then.
        """
        if self._horizons.get_subscription_count():
            for message in messages:
                self._horizons.publish(message)

    def give_forces(self, forces: dict[str, float], outputs: Sequence[float]) -> None:
        """Publish forces that no sample led to.

        Args:
            forces: name of the axis to its force [N].
            outputs: the compensation of every axis [N].
        """
        self.commands.publish(outputs)
        stamp = np.array([self._node.get_clock().now().nanoseconds], dtype=np.int64)
        effort = np.array([list(forces.values())])
        self.topics.publish(OutgoingBlock(COMPENSATION, tuple(forces), stamp, {"effort": effort}))

    def wait_acknowledged(self) -> None:
        """Wait until the last messages have arrived."""
        self.topics.wait_acknowledged()
        self.commands.wait_acknowledged()

    def destroy(self) -> None:
        """Remove the publishers."""
        self.topics.destroy()
        self.commands.destroy()
        self._node.destroy_publisher(self._horizons)
