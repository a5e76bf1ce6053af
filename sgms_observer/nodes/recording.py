"""Records topics of the live graph into a bag: bytes as they arrive, flushed twice a second."""

from __future__ import annotations

import importlib
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.task import Future

from sgms_observer.bags.message_types import DIAGNOSTICS, JOINT_STATE, TRAJECTORY
from sgms_observer.bags.writer import BagWriter
from sgms_observer.errors import RecordingError

#: Topics that are recorded by default, with their types.
TOPICS = {
    "position": JOINT_STATE,
    "control_effort": JOINT_STATE,
    "reference": JOINT_STATE,
    "friction_estimate": JOINT_STATE,
    "friction_std": JOINT_STATE,
    "friction_compensation": JOINT_STATE,
    "friction_elements": JOINT_STATE,
    "compensation_horizon": TRAJECTORY,
    "reference_horizon": TRAJECTORY,
    "friction_parameters": DIAGNOSTICS,
    "/diagnostics": DIAGNOSTICS,
}

_TICK = 0.5  # s
_DEPTH = 10_000  # messages; a depth of 10 loses some at 1 kHz, and this holds a second at 10 kHz


def load_type(name: str) -> Any:
    """Import a message class.

    Args:
        name: such as ``sensor_msgs/msg/JointState``.

    Raises:
        RecordingError: the type is not installed here.
    """
    package, _, kind = name.partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), kind)
    except (ImportError, AttributeError, ValueError):
        raise RecordingError(
            f"the message type {name} is not installed; install its package or leave the topic out"
        ) from None


class RecorderNode(Node):
    """Subscribes to topics and writes their messages as they arrive.

    Args:
        writer: takes the messages.
        topics: names, relative or absolute; none for all topics of this package.

    Attributes:
        done: completes when recording cannot continue.
        fault: the reason; None without one.
    """

    def __init__(self, writer: BagWriter, topics: Sequence[str]) -> None:
        super().__init__("sgms_record")
        self.done: Future = Future()
        self.fault: RecordingError | None = None
        self._writer = writer
        self._subscriptions_by_topic: dict[str, Subscription] = {}
        self._is_reliable: dict[str, bool] = {}
        self._wanted = {self.resolve_topic_name(topic): TOPICS.get(topic, "") for topic in topics or TOPICS}
        for topic, kind in self._wanted.items():
            if kind:
                self._subscribe(topic, kind, is_reliable=True)
        self.create_timer(_TICK, self._tick)

    def _tick(self) -> None:
        """Flush the recording to the disk, and look for new publishers."""
        try:
            self._writer.flush()
            self._look_around()
        except RecordingError as error:
            self._stop(error)

    def _look_around(self) -> None:
        """Subscribe to topics whose type was unknown, with best effort where a publisher offers nothing else."""
        for topic, kind in self._wanted.items():
            offered = self.get_publishers_info_by_topic(topic)
            if not offered:
                continue
            is_reliable = all(info.qos_profile.reliability != ReliabilityPolicy.BEST_EFFORT for info in offered)
            if topic not in self._subscriptions_by_topic:
                self._wanted[topic] = offered[0].topic_type
                self._subscribe(topic, offered[0].topic_type, is_reliable)
            elif self._is_reliable[topic] and not is_reliable:
                self.destroy_subscription(self._subscriptions_by_topic[topic])
                self._subscribe(topic, self._wanted[topic], is_reliable)
            if kind and all(info.topic_type != kind for info in offered):
                print(
                    f"Warning: {topic} is published as {offered[0].topic_type}, not {kind}; it is not recorded",
                    file=sys.stderr,
                )
                self._wanted[topic] = offered[0].topic_type
                self.destroy_subscription(self._subscriptions_by_topic.pop(topic))

    def _subscribe(self, topic: str, kind: str, is_reliable: bool) -> None:
        reliability = ReliabilityPolicy.RELIABLE if is_reliable else ReliabilityPolicy.BEST_EFFORT
        qos = QoSProfile(
            history=HistoryPolicy.KEEP_LAST, depth=_DEPTH, reliability=reliability, durability=DurabilityPolicy.VOLATILE
        )
        self._subscriptions_by_topic[topic] = self.create_subscription(
            load_type(kind), topic, self._writing(topic, kind), qos, raw=True
        )
        self._is_reliable[topic] = is_reliable

    def _writing(self, topic: str, kind: str) -> Callable[[bytes], None]:
        """Return the callback for the messages of a topic."""
        write, now = self._writer.write, time.time_ns

        def take(message: bytes) -> None:
            try:
                write(topic, kind, now(), message)
            except RecordingError as error:
                self._stop(error)

        return take

    def _stop(self, error: RecordingError) -> None:
        """End the recording; the first error is reported."""
        if self.fault is None:
            self.fault = error
        if not self.done.done():
            self.done.set_result(None)
