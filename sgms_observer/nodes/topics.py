"""Topics of the nodes: quality of service, prepared bytes of messages, commands, and the outputs of an observer."""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial

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

from sgms_observer.bags.cdr import JointStateEncoder, effort_template
from sgms_observer.bags.rows import BY_ARRAYS, encode_joint_states
from sgms_observer.compensation.safety import safe_output
from sgms_observer.observer.outgoing import COMPENSATION, HORIZON, JOINT_STATE_TOPICS, OTHER_TOPICS, OutgoingBlock
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
#: How long a node that ends waits until its last messages are acknowledged [s].
LAST_WORDS = Duration(seconds=0.2)

_ASK_EVERY = 0.01  # s between two queries of the readers of a publisher

_LITTLE_ENDIAN = b"\x00\x01\x00\x00"


def remaps(names: Mapping[str, str]) -> list[str]:
    """Return the ROS arguments that give topics other names.

    Args:
        names: topic to its name on the graph.
    """
    return [part for topic, name in names.items() for part in ("--ros-args", "-r", f"{topic}:={name}", "--")]


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


class Readers:
    """Tells whether a publisher has readers; queries the middleware every 10 ms at most.

    A query takes a fifth of the time of a message. A new reader gets its first message at most 10 ms later.

    Args:
        publisher: the publisher.
    """

    def __init__(self, publisher: Publisher) -> None:
        self._count = publisher.get_subscription_count
        self._ask_at = -math.inf
        self._are_there = False

    def are_there(self) -> bool:
        """Return whether the publisher has readers."""
        now = time.monotonic()
        if now >= self._ask_at:
            self._ask_at = now + _ASK_EVERY
            self._are_there = self._count() > 0
        return self._are_there


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
        self._readers = {topic: Readers(publisher) for topic, publisher in self._publishers.items()}
        self._encoders: dict[tuple[str, tuple[str, ...]], JointStateEncoder] = {}

    def are_read(self, topics: Iterable[str]) -> bool:
        """Return whether a node reads one of the topics.

        Args:
            topics: relative names.
        """
        return any(self._readers[topic].are_there() for topic in topics)

    def publish(self, block: OutgoingBlock, is_read: bool = False) -> None:
        """Send every message of a block, if a node reads it.

        Args:
            block: messages of one of the topics.
            is_read: whether the topic has a reader.
        """
        topic, names, stamp_ns, columns = block
        if not is_read and not self._readers[topic].are_there():
            return
        publish = self._publishers[topic].publish
        if len(stamp_ns) >= BY_ARRAYS:
            for row in encode_joint_states(stamp_ns, names, dict(columns)):
                publish(row.tobytes())
            return
        encoder = self._encoders.get((topic, names))
        if encoder is None:
            encoder = self._encoders[topic, names] = JointStateEncoder(names, tuple(columns))
        rows = [values.tolist() for values in columns.values()]
        for stamp, *fields in zip(stamp_ns.tolist(), *rows, strict=True):
            publish(encoder.encode(stamp, *fields))

    def sender(self, topic: str, names: Sequence[str]) -> Callable[[int, Sequence[float]], None]:
        """Return a function that sends one message with efforts, of stamp [ns] and effort of each name [N].

        Args:
            topic: relative name.
            names: entries of ``name``.
        """
        return partial(_send, self._publishers[topic].publish, *effort_template(names))

    def wait_acknowledged(self) -> None:
        """Wait until the sent messages have arrived, for ``LAST_WORDS`` at most."""
        for publisher in self._publishers.values():
            publisher.wait_for_all_acked(LAST_WORDS)

    def destroy(self) -> None:
        """Remove the publishers from the graph."""
        for publisher in self._publishers.values():
            self._node.destroy_publisher(publisher)
        self._publishers.clear()


def _send(
    publish: Callable[[bytes], None],
    pack: Callable[..., bytes],
    head: bytes,
    middle: bytes,
    stamp_ns: int,
    effort: Sequence[float],
) -> None:
    """Send a prepared message with a new stamp and new numbers."""
    publish(pack(head, stamp_ns // 1_000_000_000, stamp_ns % 1_000_000_000, middle, *effort))


def encode_commands(forces: Sequence[float]) -> bytes:
    """Return a Float64MultiArray without dimensions as bytes (XCDR1).

    Args:
        forces: data, in order [N].
    """
    return _LITTLE_ENDIAN + struct.pack(f"<IIIxxxx{len(forces)}d", 0, 0, len(forces), *forces)


class CommandTopic:
    """Sends the latest compensation of all axes, in the order of ``axes``, as commands of ros2_control.

    The message has no stamp and the receiver holds the last one, so the node sends zeros when it stops or gets no
    samples. For samples that are too old it sends zero instead. Changes stay within the slew limit of each axis.

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
        self._readers = Readers(self._publisher)

    def publish(self, forces: Sequence[float], is_late: bool = False) -> None:
        """Send the forces [N], if a node subscribes to them.

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
        if self._readers.are_there():
            self._publisher.publish(encode_commands(forces))

    def wait_acknowledged(self) -> None:
        """Wait until the latest message has arrived, for ``LAST_WORDS`` at most."""
        self._publisher.wait_for_all_acked(LAST_WORDS)

    def destroy(self) -> None:
        """Remove the publisher from the graph."""
        self._node.destroy_publisher(self._publisher)


class Outlets:
    """Outputs of an observer: estimates, commands and horizons.

    Args:
        node: publishes them.
        settings: of its axes.

    Attributes:
        topics: the estimates.
        commands: the commands of controllers.
        send_forces: publishes the compensation of all axes: stamp [ns], force of each [N].
    """

    def __init__(self, node: Node, settings: Settings) -> None:
        self._node = node
        self.topics = JointStateTopics(node, JOINT_STATE_TOPICS)
        self.commands = CommandTopic(node, settings)
        self.send_forces = self.topics.sender(COMPENSATION, [axis.name for axis in settings.axes])
        self._horizons = node.create_publisher(JointTrajectory, HORIZON, HORIZON_QOS)
        self._readers_of_horizons = Readers(self._horizons)

    def are_others_read(self) -> bool:
        """Return whether a node reads estimates other than the compensation."""
        return self.topics.are_read(OTHER_TOPICS)

    def give_horizons(self, messages: Iterable[bytes]) -> None:
        """Publish horizons, if a node subscribes to them.

        Args:
            messages: made only then.
        """
        if self._readers_of_horizons.are_there():
            for message in messages:
                self._horizons.publish(message)

    def give_forces(self, forces: dict[str, float], outputs: Sequence[float]) -> None:
        """Publish forces without samples.

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
