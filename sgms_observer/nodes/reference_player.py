"""Publishes a reference in real time, from the position of the table on, and stops with a limited deceleration."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.errors import DataError, RecordingError
from sgms_observer.interrupts import listed_signals

if TYPE_CHECKING:
    from rclpy.node import Node

    from sgms_observer.settings.axis import AxisSettings


_TURN = 5.0e-4  # s from one reading of the clock to the next
_FIRST_POSITION_TIME = 10.0  # s to wait for the table's position and for a subscriber
_CLOCK_TIME = 0.1  # s of positions that give the table's clock
_LEAD = 5.0e-3  # s between the sending of a set-point and its stamp, so that the observer has it with its sample
_LATEST = 0.25  # s of delay after which the motion is stopped


def play_reference(
    axis: AxisSettings,
    reference_from: Callable[[float], tuple[Floats, Floats]],
    period: float,
    sample_period: float,
    acceleration: float,
    topics: Mapping[str, str],
) -> bool:
    """Publish a reference that starts at the position of the table, and its future part as a horizon.

    Set-points have the stamps of the table's samples, because the observer pairs them by stamp.

    Args:
        axis: its name and ``position_scale`` are those of the messages.
        reference_from: called with the position of the table [m]; returns position [m] and velocity [m/s] of
            each sample, shape (n,), at rest at that position in the beginning.
        period: time between two set-points [s].
        sample_period: time between two samples of the table [s].
        acceleration: deceleration when it is interrupted [m/s^2].
        topics: names of topics on the graph where they differ, by their usual names.

    Returns:
        Whether it was played to the end; False after SIGINT or SIGTERM.

    Raises:
        RecordingError: ROS is missing, no position arrives, or no node subscribes to the reference.
    """
    from sgms_observer.nodes.spin import MISSING_ROS

    try:
        import rclpy
        from rclpy.signals import SignalHandlerOptions
    except ImportError:
        raise RecordingError(MISSING_ROS) from None
    from sgms_observer.compensation.horizon import EVERY
    from sgms_observer.nodes.set_points import SetPoints, braking
    from sgms_observer.nodes.topics import remaps
    from sgms_observer.nodes.transport import prepare_transport

    prepare_transport()
    stop = listed_signals()
    rclpy.init(args=remaps(topics), signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("sgms_excite")
    try:
        position, velocity = reference_from(_standing_at(node, axis, stop).position)
        set_points = SetPoints(node, axis)
        _await(lambda: set_points.reader_count > 0, stop, "no node subscribes to reference; start the table")
        while not set_points.has_met_all() and not stop:
            time.sleep(0.02)
        clock = _standing_at(node, axis, stop)  # again, because a simulated table may have caught up meanwhile
        begun = time.monotonic()
        samples = math.ceil((begun + _LEAD - clock.heard_at) / sample_period)
        start_ns = clock.stamp_ns + samples * round(sample_period * 1e9)
        done, published, is_braking = 0, -math.inf, False
        while done < len(position):
            late = time.monotonic() - begun - done * period
            if (stop or late > _LATEST) and not is_braking:
                is_braking = True
                last = max(done - 1, 0)
                way = braking(float(position[last]), float(velocity[last]), acceleration, period)
                position, velocity = (
                    np.append(old[:done], new) for old, new in zip((position, velocity), way, strict=True)
                )
                missed = max(0, int(late / period))  # late set-points are left out, and the rest is delayed
                begun, start_ns, published = begun + missed * period, start_ns + round(missed * period * 1e9), -math.inf
            now = time.monotonic() - begun
            if now >= published + EVERY:
                published = now
                now_ns = start_ns + round((now - _LEAD) * 1e9)
                set_points.publish_ahead(period, start_ns, now_ns, position, velocity)
            due = min(len(position), int((time.monotonic() - begun) / period) + 1)
            for i in range(done, due):
                set_points.send(start_ns + round(i * period * 1e9), float(position[i]), float(velocity[i]))
            done = due
            time.sleep(_TURN)
        set_points.wait_acknowledged()
        if is_braking and not stop:
            raise DataError(f"the machine was busy for more than {_LATEST:g} s; the motion was stopped: start it again")
        return not is_braking
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def _await(condition: Callable[[], bool], stop: Sequence[int], sentence: str) -> None:
    """Wait for a condition; raise the sentence after a time-out."""
    end = time.monotonic() + _FIRST_POSITION_TIME
    while not condition():
        if stop or time.monotonic() > end:
            raise RecordingError(sentence)
        time.sleep(0.02)


class _Standing(NamedTuple):
    """Position of the table [m], stamp of that sample [ns], and its arrival time on the monotonic clock [s]."""

    position: float
    stamp_ns: int
    heard_at: float


def _standing_at(node: Node, axis: AxisSettings, stop: Sequence[int]) -> _Standing:
    """Return the position of the table: of its first samples, the one with the shortest delay."""
    import rclpy
    from sensor_msgs.msg import JointState

    from sgms_observer.nodes.topics import SAMPLE_QOS

    found: list[_Standing] = []

    def take(message: JointState) -> None:
        if axis.name in message.name and len(message.position) > message.name.index(axis.name):
            position = axis.position_scale * float(message.position[message.name.index(axis.name)])
            stamp = message.header.stamp
            found.append(_Standing(position, stamp.sec * 1_000_000_000 + stamp.nanosec, time.monotonic()))

    subscription = node.create_subscription(JointState, "position", take, SAMPLE_QOS)
    end = time.monotonic() + _FIRST_POSITION_TIME
    while not found or time.monotonic() < found[0].heard_at + _CLOCK_TIME:
        if not found and (stop or time.monotonic() > end):
            raise RecordingError(f"no position of axis {axis.name} arrives; start the table")
        rclpy.spin_once(node, timeout_sec=0.05)
    node.destroy_subscription(subscription)
    return max(found, key=lambda one: one.stamp_ns * 1e-9 - one.heard_at)
