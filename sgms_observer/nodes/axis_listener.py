"""Collects the messages of one axis on the graph during a motion, and writes them into a bag where it is recorded."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.node import Node

from sgms_observer.bags.cdr import JointStateDecoder
from sgms_observer.bags.message_types import JOINT_STATE
from sgms_observer.bags.writer import BagWriter
from sgms_observer.errors import DataError
from sgms_observer.nodes.topics import subscribe
from sgms_observer.observer.samples import Samples
from sgms_observer.settings.axis import AxisSettings

POSITION, EFFORT, REFERENCE, COMPENSATION = "position", "control_effort", "reference", "friction_compensation"

_LONGEST_GUESS = 0.1  # s after the latest stamp during which the table's clock counts as running


class AxisListener:
    """Receives position, effort and compensation of one axis.

    Args:
        axis: its name and scales are those of the messages.

    Attributes:
        positions: stamp [ns] and position [m] of each sample since ``forget``.
        heard_at: arrival time of the last message with a new stamp of each input, monotonic clock [s].
        names: the axes that each topic named.
        span: first and last stamp that is recorded [ns].
    """

    def __init__(self, axis: AxisSettings) -> None:
        self._axis = axis
        self._decoders = {topic: JointStateDecoder() for topic in (POSITION, EFFORT, COMPENSATION)}
        self._efforts: dict[int, float] = {}
        self._latest_effort = 0
        self._arrivals: dict[int, float] = {}
        self._ages: list[float] = []
        self.positions: list[tuple[int, float]] = []
        self.heard_at = {POSITION: 0.0, EFFORT: 0.0}
        self._repeats = dict.fromkeys(self.heard_at, False)
        self.names: dict[str, tuple[str, ...]] = {}
        self._writer: BagWriter | None = None
        self.span = (0, 0)

    def subscribe(self, node: Node) -> None:
        """Subscribe to the topics.

        Args:
            node: the node.
        """
        subscribe(node, POSITION, self._take_position)
        subscribe(node, EFFORT, self._take_effort)
        subscribe(node, COMPENSATION, self._take_compensation)

    def forget(self) -> None:
        """Drop the received messages."""
        for samples in (self.positions, self._efforts, self._ages, self._arrivals):
            samples.clear()
        self._latest_effort = 0
        self.heard_at = dict.fromkeys(self.heard_at, time.monotonic())
        self._repeats = dict.fromkeys(self.heard_at, False)

    def repeats_stamp(self, topic: str) -> bool:
        """Return whether the latest messages of a topic repeat a stamp or step back.

        Args:
            topic: position or effort.
        """
        return self._repeats[topic]

    @property
    def effort_count(self) -> int:
        """Return the number of received efforts."""
        return len(self._efforts)

    @property
    def ages(self) -> Sequence[float]:
        """Return the times from the arrival of each sample to that of its compensation [s]."""
        return self._ages

    def now_ns(self) -> int:
        """Return the table's time: the latest stamp plus a short time since its arrival [ns].

        Set-points follow this clock, because the computer of the table may have another clock, or a simulation that
        runs late. While the table's clock stands still, no set-point is sent.
        """
        since = time.monotonic() - self.heard_at[POSITION]
        return self.positions[-1][0] + round(1e9 * min(since, _LONGEST_GUESS))

    def ready(self, checked: int) -> int:
        """Return the number of positions whose effort has arrived or will not arrive any more.

        Args:
            checked: number of positions that are known to be ready.
        """
        ready = len(self.positions)
        while ready > checked and self.positions[ready - 1][0] > self._latest_effort:
            ready -= 1
        return ready

    def between_efforts(self, lead: float) -> Sequence[tuple[int, float]]:
        """Return the positions without those of a short time before the first effort and after the last one.

        Of two topics, or two subscriptions of one, one is connected first, and its messages are processed first.
        Positions that lack an effort for longer stay: their topic is at fault.

        Args:
            lead: longest time by which the messages of one topic are processed before those of the other [s].
        """
        begin, end = min(self._efforts, default=0), self._latest_effort
        first, last = begin - round(1e9 * lead), end + round(1e9 * lead)
        return [row for row in self.positions if not (first <= row[0] < begin or end < row[0] <= last)]

    def samples(self, rows: Sequence[tuple[int, float]], reference: tuple[Any, Any] | None = None) -> Samples:
        """Return positions with the efforts of their stamps [SI units].

        Args:
            rows: part of ``positions`` [ns, m].
            reference: positions [m] and velocities [m/s] of the set-points; None for none.
        """
        stamps = np.array([stamp for stamp, _ in rows], dtype=np.int64)
        positions = np.array([position for _, position in rows], dtype=np.float64)
        efforts = np.array([self._efforts.get(stamp, math.nan) for stamp, _ in rows], dtype=np.float64)
        nothing = np.full(len(rows), math.nan)
        return Samples(stamps, positions, efforts, *((nothing, nothing) if reference is None else reference))

    @property
    def is_recording(self) -> bool:
        """Return whether messages go into a bag."""
        return self._writer is not None

    @contextmanager
    def recording(self, bag: Path) -> Iterator[None]:
        """Write the messages between the stamps of ``span`` into a bag while the block runs.

        Args:
            bag: its folder; a bag that is there is replaced.
        """
        with BagWriter(bag, is_overwriting=True) as writer:
            self._writer = writer
            try:
                yield
            finally:  # messages that arrive later must not meet a closed bag
                self._writer = None

    def record(self, topic: str, stamp_ns: int, message: bytes) -> None:
        """Write a message into the bag, if it is recorded.

        Args:
            topic: its topic.
            stamp_ns: its stamp [ns].
            message: its bytes.
        """
        if self._writer is not None and self.span[0] <= stamp_ns <= self.span[1]:
            self._writer.write(topic, JOINT_STATE, time.time_ns(), message)

    def _take_position(self, message: bytes) -> None:
        found = self._number(POSITION, message, 2)
        if found is not None and self._note(POSITION, found[0], self.positions[-1][0] if self.positions else -1):
            self.positions.append((found[0], self._axis.position_scale * found[1]))
            self._arrivals[found[0]] = self.heard_at[POSITION]

    def _take_effort(self, message: bytes) -> None:
        found = self._number(EFFORT, message, 4)
        if found is not None:
            self._efforts[found[0]] = self._axis.effort_scale * found[1]
            if self._note(EFFORT, found[0], self._latest_effort):
                self._latest_effort = found[0]

    def _take_compensation(self, message: bytes) -> None:
        found = self._number(COMPENSATION, message, 4)
        if found is not None:
            arrived = self._arrivals.pop(found[0], None)
            if arrived is not None:
                self._ages.append(time.monotonic() - arrived)

    def _note(self, topic: str, stamp_ns: int, latest_ns: int) -> bool:
        """Return the message after noting whether its stamp is new: a machine with constant stamps counts as silent."""
        is_new = stamp_ns > latest_ns
        if is_new:
            self.heard_at[topic] = time.monotonic()
        self._repeats[topic] = not is_new
        return is_new

    def _number(self, topic: str, message: bytes, field: int) -> tuple[int, float] | None:
        """Return stamp and the axis's number in one field of a message."""
        try:
            decoded = self._decoders[topic].decode(message)
        except DataError:
            return None
        stamp_ns, names = decoded[:2]
        values: Sequence[float] = decoded[field]  # type: ignore[assignment]
        self.names[topic] = names
        if self._axis.name not in names:
            return None
        self.record(topic, stamp_ns, message)
        place = names.index(self._axis.name)
        if place >= len(values) or not math.isfinite(values[place]):
            return None
        return stamp_ns, float(values[place])
