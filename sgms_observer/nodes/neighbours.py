"""Finds other nodes on the observer's topics: a second publisher of the compensation, or a tool that slows the node."""

from __future__ import annotations

from dataclasses import replace

from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy

from sgms_observer.nodes.topics import COMMANDS
from sgms_observer.observer.outgoing import COMPENSATION, HORIZON, JOINT_STATE_TOPICS
from sgms_observer.settings.axis import Settings

_COMMAND_LINE = "_ros2cli"  # beginning of the names of the nodes of `ros2 topic echo` and `hz`


class Neighbours:
    """Checks the graph around a node.

    Args:
        node: the observer.

    Attributes:
        rivals: topics of the compensation that another node published too at the last check.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._readers: dict[str, list[str]] = {}
        self._looked_at = -1
        self.rivals: tuple[str, ...] = ()

    def _rivals(self) -> tuple[str, ...]:
        topics = (self._node.resolve_topic_name(topic) for topic in (COMPENSATION, HORIZON, COMMANDS))
        return tuple(topic for topic in topics if self._node.count_publishers(topic) > 1)

    def judge_rivals(self) -> list[str]:
        """Check for rivals again; return one sentence for each."""
        self.rivals = self._rivals()
        return [
            f"{topic} is published by another node as well; the compensation stays at zero until only one node does;"
            " stop one of them or give it a namespace of its own"
            for topic in self.rivals
        ]

    def judge_readers(self) -> list[str]:
        """Return the sentence about a command-line tool that reads one of the topics with every sample reliably.

        Each call checks one topic, because a query of the graph takes a part of a millisecond.
        """
        self._looked_at += 1
        topic = self._node.resolve_topic_name(JOINT_STATE_TOPICS[self._looked_at % len(JOINT_STATE_TOPICS)])
        found = [
            info.node_name
            for info in self._node.get_subscriptions_info_by_topic(topic)
            if info.node_name.startswith(_COMMAND_LINE) and info.qos_profile.reliability == ReliabilityPolicy.RELIABLE
        ]
        self._readers = {name: names for name, names in {**self._readers, topic: found}.items() if names}
        return [
            f"{name} is read by a command-line tool ({names[0]}), which loses samples and slows this node;"
            " take rates from /diagnostics"
            for name, names in self._readers.items()
        ]


def without_compensation(settings: Settings) -> Settings:
    """Return settings whose compensation is switched off on every axis.

    Args:
        settings: any settings.
    """
    axes = (replace(axis, compensation=replace(axis.compensation, enabled=False)) for axis in settings.axes)
    return replace(settings, axes=tuple(axes))
