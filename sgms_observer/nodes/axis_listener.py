"""What one axis says on the graph, kept while a motion runs, and written into a bag where it is recorded."""

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

_LONGEST_GUESS = 0.1  # s behind the latest stamp that the table's clock is taken to go on


class AxisListener:
    """Hears position, effort and compensation of one axis.

    Args:
        axis: its name and scales are those of the messages.

    Attributes:
        positions: stamp [ns] and position [m] of each sample since ``forget``.
        heard_at: when each input last gave a sample with a new stamp, by the monotonic clock [s].
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
        """Start to hear.

        Args:
            node: the node.
        """
        subscribe(node, POSITION, self._take_position)
        subscribe(node, EFFORT, self._take_effort)
        subscribe(node, COMPENSATION, self._take_compensation)

    def forget(self) -> None:
        """Forget what was heard."""
        for samples in (self.positions, self._efforts, self._ages, self._arrivals):
            samples.clear()
        self._latest_effort = 0
        self.heard_at = dict.fromkeys(self.heard_at, time.monotonic())
        self._repeats = dict.fromkeys(self.heard_at, False)

    def repeats_stamp(self, topic: str) -> bool:
        """Return whether messages of a topic came whose stamp is not new, and none behind them whose stamp is.

        Args:
            topic: position or effort.
        """
        return self._repeats[topic]

    @property
    def effort_count(self) -> int:
        """Return how many efforts were heard."""
        return len(self._efforts)

    @property
    def ages(self) -> Sequence[float]:
        """Return the times from a sample's arrival to its compensation's [s]."""
        return self._ages

    def now_ns(self) -> int:
        """Return the table's time: the latest stamp, and what went by since it came, for a short while [ns].

        Set-points follow this clock: a table whose computer has another clock, or whose simulation runs late, gets them
        by its own, and none while it stands still.
        """
        since = time.monotonic() - self.heard_at[POSITION]
        return self.positions[-1][0] + round(1e9 * min(since, _LONGEST_GUESS))

    def ready(self, checked: int) -> int:
        """Return how many positions have their effort, or will not get it any more.

        Args:
            checked: so many are ready for sure.
        """
        ready = len(self.positions)
        while ready > checked and self.positions[ready - 1][0] > self._latest_effort:
            ready -= 1
        return ready

    def samples(self, rows: Sequence[tuple[int, float]], reference: tuple[Any, Any] | None = None) -> Samples:
        """Return positions with the efforts of their stamps [SI units].

        Args:
            rows: some of ``positions`` [ns, m].
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
            finally:  # messages that still come find no closed bag
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
        """Note whether a message has a new stamp, and return it: a machine whose stamps stand still is silent."""
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
