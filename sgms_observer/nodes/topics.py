"""Topics of the nodes: quality of service, and blocks of messages sent as prepared bytes."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions, QoSPolicyKind
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from sgms_observer.bags.blocks import BY_ARRAYS, encode_joint_states
from sgms_observer.bags.cdr import JointStateEncoder
from sgms_observer.observer.outgoing import OutgoingBlock

#: A depth of 10 loses samples at 1 kHz; this one holds a second at 10 kHz.
SAMPLE_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=10_000,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
#: Horizons: a newer one replaces the one before it.
HORIZON_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=10,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
#: How long the last messages of a node that ends are waited for, by whoever wants them acknowledged.
LAST_WORDS = Duration(seconds=0.2)


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
