"""Publishes the set-points of one motion with the stamps of samples: when due, ahead as a horizon, and to rest."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
from rclpy.duration import Duration
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from sgms_observer.application.commission.motion import Motion
from sgms_observer.application.commission.table import LEAD, HeldUp
from sgms_observer.arrays import Floats, Ints
from sgms_observer.bags.cdr import JointStateEncoder
from sgms_observer.compensation.horizon import EVERY
from sgms_observer.nodes.axis_listener import REFERENCE, AxisListener
from sgms_observer.nodes.horizons import encode_motion_ahead
from sgms_observer.nodes.topics import HORIZON_QOS, SAMPLE_QOS
from sgms_observer.observer.outgoing import REFERENCE_HORIZON
from sgms_observer.settings.axis import AxisSettings

_LATEST = 0.05  # s that a set-point may be late; a later one stops the motion
_MEETING_TIME = (
    1.0  # s without a new subscriber, after which a motion may begin: each node announces itself once in this time
)
_START = 0.2  # s from the first message to the first set-point's stamp, beyond the lead
_ACK_TIME = 2.0  # s for the last set-points to arrive


def braking(position: float, velocity: float, acceleration: float, period: float) -> tuple[Floats, Floats]:
    """Return position and velocity of the motion to rest.

    Args:
        position: start position [m].
        velocity: velocity there [m/s].
        acceleration: deceleration, not exceeded [m/s^2].
        period: time between two samples [s].

    Returns:
        Position [m] and velocity [m/s] of each sample, the last at rest.
    """
    count = max(1, math.ceil(abs(velocity) / (acceleration * period)))
    velocities: Floats = np.linspace(velocity, 0.0, count + 1)[1:]
    return np.asarray(position + period * np.cumsum(velocities)), velocities


class SetPoints:
    """Publishes set-points of one axis, and its future motion.

    Args:
        node: publishes them.
        axis: its name and scales are those of the messages.
    """

    def __init__(self, node: Node, axis: AxisSettings) -> None:
        self._axis = axis
        self._encoder = JointStateEncoder((axis.name,), ("position", "velocity"))
        self._publisher = node.create_publisher(JointState, REFERENCE, SAMPLE_QOS)
        self._ahead = node.create_publisher(JointTrajectory, REFERENCE_HORIZON, HORIZON_QOS)
        self._known = (0, -math.inf)  # number of subscriptions, and the time of its last change

    @property
    def reader_count(self) -> int:
        """Return how many nodes subscribe to the set-points."""
        return int(self._publisher.get_subscription_count())

    def has_met_all(self) -> bool:
        """Return whether the number of subscribers has not changed for a while.

        A recorder may be discovered before the table, which then misses the first set-points.
        """
        count, now = self.reader_count + int(self._ahead.get_subscription_count()), time.monotonic()
        if count != self._known[0]:
            self._known = count, now
        return now >= self._known[1] + _MEETING_TIME

    def send(self, stamp_ns: int, position: float, velocity: float) -> bytes:
        """Publish one set-point and return its message.

        Args:
            stamp_ns: its stamp [ns].
            position: of the axis [m].
            velocity: of the axis [m/s].
        """
        scale = self._axis.position_scale
        message = self._encoder.encode(stamp_ns, [position / scale], [velocity / scale])
        self._publisher.publish(message)
        return message

    def publish_ahead(self, period: float, begin_ns: int, now_ns: int, position: Floats, velocity: Floats) -> None:
        """Publish the future motion if a node subscribes to it, so that delays of the network do not matter.

        Args:
            period: time between two set-points [s].
            begin_ns: stamp of the first one [ns].
            now_ns: the table's time [ns].
            position: of every set-point [m], shape (n,).
            velocity: of every set-point [m/s], shape (n,).
        """
        if self._ahead.get_subscription_count():
            self._ahead.publish(encode_motion_ahead(self._axis, period, begin_ns, now_ns, position, velocity))

    def wait_acknowledged(self) -> None:
        """Wait until the last set-points have arrived; the last one ends the motion at rest."""
        self._publisher.wait_for_all_acked(Duration(seconds=_ACK_TIME))


class Playing:
    """A running motion; it begins a little later than now, on the stamps of the samples.

    Args:
        set_points: publishes it.
        listener: knows the table's time, and records the set-points.
        motion: relative to the origin.
        origin: position of its zero [m].
        lead: how long before its stamp a set-point is sent [s].

    Attributes:
        begin_ns: stamp of the first set-point [ns].
        end_ns: stamp of the last one [ns].
        sent: number of sent set-points.
    """

    def __init__(
        self, set_points: SetPoints, listener: AxisListener, motion: Motion, origin: float, lead: float
    ) -> None:
        self._set_points, self._listener, self._motion, self._lead = set_points, listener, motion, lead
        self._period_ns = round(motion.period * 1e9)
        self._position, self._velocity = origin + motion.position, motion.velocity
        self._published_ns = 0
        self._grid_ns = listener.positions[-1][0]  # the observer pairs set-points and samples by their stamps
        ahead_ns = listener.now_ns() + (lead + _START) * 1e9 - self._grid_ns
        self.begin_ns = self._grid_ns + math.ceil(ahead_ns / self._period_ns) * self._period_ns
        self.end_ns = self.begin_ns + (len(motion.position) - 1) * self._period_ns
        self.sent = 0

    @property
    def last_set_point(self) -> float:
        """Return where the motion ends [m]."""
        return float(self._position[-1])

    def send_due(self) -> None:
        """Publish the due set-points, and from time to time the future motion.

        Raises:
            HeldUp: this machine is too late.
        """
        now_ns = self._listener.now_ns() if self._listener.positions else self._grid_ns
        due = min(len(self._position), int((now_ns + self._lead * 1e9 - self.begin_ns) // self._period_ns) + 1)
        if self.sent < due and now_ns - (self.begin_ns + self.sent * self._period_ns) > _LATEST * 1e9:
            raise HeldUp(
                f"this machine was busy and sent the reference {_LATEST:g} s late; the motion was stopped;"
                " start again on a machine with less load"
            )
        self._send(self._position, self._velocity, self.begin_ns, range(self.sent, due))
        self.sent = max(self.sent, due)
        if now_ns >= self._published_ns + round(EVERY * 1e9):
            self._published_ns = now_ns
            self._set_points.publish_ahead(self._motion.period, self.begin_ns, now_ns, self._position, self._velocity)

    def at(self, stamps: Ints) -> tuple[Floats, Floats, Floats]:
        """Return samples since the beginning [-], set-point [m] and its velocity [m/s] at some stamps.

        Args:
            stamps: of samples [ns], shape (n,).
        """
        index = np.asarray((stamps - self.begin_ns) * 1e-9 / self._motion.period, dtype=np.float64)
        grid = np.arange(len(self._position))
        velocity = np.interp(index, grid, self._velocity, left=0.0, right=0.0)
        return index, np.interp(index, grid, self._position), velocity

    def brake(self, acceleration: float, wait: Callable[[], None]) -> float:
        """Take the set-point to rest from its present value, and return the rest position [m].

        Args:
            acceleration: deceleration, not exceeded [m/s^2].
            wait: called between two set-points.
        """
        period = self._motion.period
        now_ns = (self._listener.now_ns() if self._listener.positions else self.begin_ns) + 10_000_000
        at = min(max(0, math.ceil((now_ns - self.begin_ns) / self._period_ns)), self.sent - 1)
        places, speeds = braking(float(self._position[at]), float(self._velocity[at]), acceleration, period)
        rest = np.full(round(2.0 * LEAD / period), places[-1])
        places, speeds = np.concatenate([places, rest]), np.concatenate([speeds, 0.0 * rest])
        start_ns = self.begin_ns + (at + 1) * self._period_ns
        done, begun = 0, time.monotonic()  # by this computer's clock, because the table may be silent
        while done < len(places):
            ahead = time.monotonic() - begun + 0.5 * self._lead
            due = min(len(places), int((now_ns + ahead * 1e9 - start_ns) // self._period_ns) + 1)
            self._send(places, speeds, start_ns, range(done, due))
            done = max(done, due)
            wait()
        return float(places[-1])

    def _send(self, position: Floats, velocity: Floats, begin_ns: int, numbers: range) -> None:
        for i in numbers:
            stamp_ns = begin_ns + i * self._period_ns
            message = self._set_points.send(stamp_ns, float(position[i]), float(velocity[i]))
            self._listener.record(REFERENCE, stamp_ns, message)
