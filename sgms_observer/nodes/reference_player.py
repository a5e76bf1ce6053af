"""Publishes a reference in real time: from where the table stands, and to a stop with a limited deceleration."""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sgms_observer.errors import DataError, RecordingError

if TYPE_CHECKING:
    from rclpy.node import Node

    from sgms_observer.settings.axis import AxisSettings

Floats = NDArray[np.float64]

_TURN = 5.0e-4  # s from one look at the clock to the next
_FIRST_POSITION_TIME = 10.0  # s to wait for the table's position, and for a listener
_ACK_TIME = 2.0  # s for the last set-points to arrive
_LATEST = 0.25  # s of delay after which the motion is stopped rather than caught up


def braking(position: float, velocity: float, acceleration: float, period: float) -> tuple[Floats, Floats]:
    """Return position and velocity of the way to rest.

    Args:
        position: where it starts [m].
        velocity: velocity there [m/s].
        acceleration: deceleration, not exceeded [m/s^2].
        period: time between two samples [s].

    Returns:
        Position [m] and velocity [m/s] of each sample, the last at rest.
    """
    count = max(1, math.ceil(abs(velocity) / (acceleration * period)))
    velocities: Floats = np.linspace(velocity, 0.0, count + 1)[1:]
    return np.asarray(position + period * np.cumsum(velocities)), velocities


def play_reference(
    axis: AxisSettings,
    reference_from: Callable[[float], tuple[Floats, Floats]],
    period: float,
    acceleration: float,
) -> bool:
    """Publish a reference that starts where the table stands.

    Args:
        axis: its name and ``position_scale`` are those of the messages.
        reference_from: gets the position at which the table stands [m]; returns position [m] and velocity [m/s] of
            each sample, shape (n,), at rest at that position in the beginning.
        period: time between two samples [s].
        acceleration: deceleration when it is interrupted [m/s^2].

    Returns:
        Whether it was played to the end; False after SIGINT or SIGTERM.

    Raises:
        RecordingError: ROS is missing, the table does not say where it stands, or nobody listens.
    """
    from sgms_observer.nodes.spin import MISSING_ROS

    try:
        import rclpy
        from rclpy.signals import SignalHandlerOptions
    except ImportError:
        raise RecordingError(MISSING_ROS) from None
    from rclpy.duration import Duration
    from sensor_msgs.msg import JointState

    from sgms_observer.bags.cdr import JointStateEncoder
    from sgms_observer.nodes.topics import SAMPLE_QOS
    from sgms_observer.nodes.transport import prepare_transport

    prepare_transport()
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("sgms_excite")
    try:
        position, velocity = reference_from(_standing_at(node, axis, stop))
        publisher = node.create_publisher(JointState, "reference", SAMPLE_QOS)
        _await(lambda: publisher.get_subscription_count() > 0, stop, "no node subscribes to reference; start the table")
        encoder = JointStateEncoder((axis.name,), ("position", "velocity"))
        scale = axis.position_scale
        clock = node.get_clock()
        begun, start_ns = time.monotonic(), clock.now().nanoseconds
        done, is_braking = 0, False
        while done < len(position):
            late = time.monotonic() - begun - done * period
            if (stop.is_set() or late > _LATEST) and not is_braking:
                is_braking = True
                last = max(done - 1, 0)
                position, velocity = braking(float(position[last]), float(velocity[last]), acceleration, period)
                begun, start_ns, done = time.monotonic(), clock.now().nanoseconds, 0
            due = min(len(position), int((time.monotonic() - begun) / period) + 1)
            for i in range(done, due):
                stamp = start_ns + round(i * period * 1e9)
                set_point = float(position[i]) / scale
                publisher.publish(encoder.encode(stamp, [set_point], [float(velocity[i]) / scale]))
            done = due
            time.sleep(_TURN)
        publisher.wait_for_all_acked(Duration(seconds=_ACK_TIME))  # the last of them is the one that says rest
        if is_braking and not stop.is_set():
            raise DataError(f"the machine was busy for more than {_LATEST:g} s; the motion was stopped: start it again")
        return not is_braking
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def _await(condition: Callable[[], bool], stop: threading.Event, sentence: str) -> None:
    """Wait for a condition, or say the sentence."""
    end = time.monotonic() + _FIRST_POSITION_TIME
    while not condition():
        if stop.is_set() or time.monotonic() > end:
            raise RecordingError(sentence)
        time.sleep(0.02)


def _standing_at(node: Node, axis: AxisSettings, stop: threading.Event) -> float:
    """Return where the table stands [m]: the first position it publishes."""
    import rclpy
    from sensor_msgs.msg import JointState

    from sgms_observer.nodes.topics import SAMPLE_QOS

    found: list[float] = []

    def take(message: JointState) -> None:
        if axis.name in message.name and len(message.position) > message.name.index(axis.name):
            found.append(axis.position_scale * float(message.position[message.name.index(axis.name)]))

    subscription = node.create_subscription(JointState, "position", take, SAMPLE_QOS)
    end = time.monotonic() + _FIRST_POSITION_TIME
    while not found:
        if stop.is_set() or time.monotonic() > end:
            raise RecordingError(f"no position of axis {axis.name} arrives; start the table")
        rclpy.spin_once(node, timeout_sec=0.05)
    node.destroy_subscription(subscription)
    return found[-1]
