"""Pairing of position, effort and reference of one axis by their stamps, for any order of arrival.

A sample is complete when each awaited stream has delivered a stamp as late as the position's. Live messages are pushed
one by one; recordings are pushed in blocks, which gives the same samples faster (``block_pairing``).
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from sgms_observer.observer.samples import Samples
from sgms_observer.settings.units import UNSCALED, Scales

CLOCK_RESET_NS = 1_000_000_000  # stamps that jump back further are a restarted clock, not a late message
MAX_LAG = 0.25
"""Largest difference of two stamps of one sample, as a share of the sample period."""
_ROWS = 4096
_NEVER = -(2**63)
_NAN = math.nan
_ONE = {
    "positions": "position",
    "control_efforts": "control_effort",
    "references": "reference",
    "messages": "message",
    "times": "time",
}
_ONE_LATER = (("they were", "it was"), ("and were", "and was"), ("before them", "before it"))


@dataclass
class PairingCounts:
    """Counts of messages of one axis by outcome.

    Attributes:
        samples: complete samples.
        missing_efforts: samples without an effort.
        unmatched_efforts: efforts without a position at the same time.
        unmatched_references: references without a position at the same time.
        late: messages that arrived after one with a later stamp.
        duplicates: messages with the same stamp as the message before.
        invalid: messages with NaN or infinity.
        clock_resets: number of backward jumps of the position's stamps by more than a second.
        stream_resets: the same for effort or reference.
    """

    samples: int = 0
    missing_efforts: int = 0
    unmatched_efforts: int = 0
    unmatched_references: int = 0
    late: int = 0
    duplicates: int = 0
    invalid: int = 0
    clock_resets: int = 0
    stream_resets: int = 0

    def sentences(self) -> tuple[str, ...]:
        """Return one sentence for each kind of trouble that occurred."""
        found = (
            (self.missing_efforts, "positions had no control_effort of the same time; friction was predicted there"),
            (
                self.unmatched_efforts,
                "control_efforts had no position of the same time; stamp both with the sample time",
            ),
            (self.unmatched_references, "references had no position of the same time; they were not used"),
            (self.late, "messages came after a later one of their topic and were dropped; check for two publishers"),
            (self.duplicates, "messages repeated the stamp before them and were dropped; check for two publishers"),
            (self.invalid, "messages held NaN or infinity and were dropped; check the sensor or drive"),
            (
                self.clock_resets,
                "times the position's stamps jumped back by more than a second; the observer restarted",
            ),
            (self.stream_resets, "times the stamps of control_effort or reference jumped back by more than a second"),
        )
        return tuple(f"{count} {text if count > 1 else _of_one(text)}" for count, text in found if count)


@dataclass
class Stream:
    """Messages of one topic that wait for the other topics.

    Attributes:
        last_ns: latest stamp [ns].
        queue: (stamp [ns], position or effort, velocity) of each waiting message, with increasing stamps.
        is_awaited: whether a sample needs a message of this topic.
    """

    last_ns: int = _NEVER
    queue: deque[tuple[int, float, float]] = field(default_factory=deque)
    is_awaited: bool = True


class Pairing:
    """Merges the streams of one axis. The result does not depend on the order of arrival between streams.

    Stamps count as equal within a quarter of a sample period. If the effort of a position is missing and a later effort
    has arrived, the sample gets effort NaN. A stream without messages is awaited for the time ``hold``. Then it counts
    as absent until its next message, so that the samples continue and no queue grows.

    Args:
        sample_period: nominal time between two samples [s].
        scales: factors from the messages to SI; the samples that ``pop`` returns are in SI.
        hold: longest waiting time for an effort [s], in which DDS may send it again; 1/25 of it for a reference.
        most: largest number of waiting samples, for any ``hold``.
    """

    def __init__(self, sample_period: float, scales: Scales = UNSCALED, *, hold: float = 0.5, most: int = 4096) -> None:
        self._scales = None if scales.are_one else scales
        self.tolerance_ns = round(MAX_LAG * sample_period * 1e9)
        self.limit = min(most, max(16, round(hold / sample_period)))
        self.reference_limit = max(8, self.limit // 25)
        self.counts = PairingCounts()
        self.position = Stream()
        self.effort = Stream()
        self.reference = Stream(is_awaited=False)
        self.ready: deque[Samples] = deque()
        self._first = self._next = self._alone_at = 0
        self._allocate()

    def push_position(self, stamp_ns: int, position: float) -> None:
        """Add a measured position.

        Args:
            stamp_ns: sample time [ns].
            position: position as the message has it [topic units].
        """
        stream = self.position
        if not math.isfinite(position):
            self.counts.invalid += 1
            return
        if stamp_ns <= stream.last_ns:
            if stream.last_ns - stamp_ns <= CLOCK_RESET_NS:
                self._drop(stamp_ns, stream)
                return
            self._restart(stamp_ns)
        stream.last_ns = stamp_ns
        stream.queue.append((stamp_ns, position, _NAN))
        self._join()
        waiting = len(stream.queue)
        if waiting > self.reference_limit:
            if (
                self.reference.is_awaited
                and not self.reference.queue
                and (self.effort.queue or not self.effort.is_awaited)
            ):
                self.reference.is_awaited = False
                self._join()
            if len(stream.queue) > self.limit:
                self._give_up()

    def push_effort(self, stamp_ns: int, effort: float) -> None:
        """Add an effort of the actuator.

        Args:
            stamp_ns: sample time [ns].
            effort: effort as the message has it [topic units].
        """
        if math.isfinite(effort):
            given_up = self._push(self.effort, stamp_ns, effort, _NAN)
            self.counts.unmatched_efforts += given_up
        else:
            self.counts.invalid += 1

    def push_reference(self, stamp_ns: int, position: float, velocity: float) -> None:
        """Add a set-point.

        Args:
            stamp_ns: sample time [ns].
            position: set-point as the message has it [topic units].
            velocity: its velocity [topic units]; NaN if unknown.
        """
        if math.isfinite(position) and not math.isinf(velocity):
            given_up = self._push(self.reference, stamp_ns, position, velocity)
            self.counts.unmatched_references += given_up
        else:
            self.counts.invalid += 1

    def pop(self) -> Samples | None:
        """Return complete samples that were not returned yet, in SI, or None.

        Stamps increase inside a block. A block that starts before the end of the one before it follows a reset of the
        clock. Call until it returns None.
        """
        if self.ready:
            samples = self.ready.popleft()
        elif self._first != self._next:
            samples = self._take()
        else:
            return None
        return samples if self._scales is None else samples.in_si(self._scales)

    def prepare(self) -> None:
        """Make the next sample for ``pop_alone`` before it comes."""
        if self._alone_at != self._first:
            self._alone_at, self._alone = self._first, self._view(self._first, self._first + 1)

    @property
    def alone_ns(self) -> int | None:
        """Return the stamp [ns] of the sample that ``prepare`` was called for, if it is complete and alone."""
        first = self._first
        if self._alone_at != first or self._next != first + 1 or self.ready:
            return None
        return self._alone.stamp_ns.item()

    def pop_alone(self) -> Samples:
        """Return what ``pop`` would, where ``alone_ns`` is not None."""
        self._first += 1
        return self._alone if self._scales is None else self._alone.in_si(self._scales)

    @property
    def has_samples(self) -> bool:
        """Return whether ``pop`` would return a block."""
        return bool(self.ready) or self._first != self._next

    def flush(self) -> None:
        """Complete every waiting position at the end of the streams."""
        awaited = self.effort.is_awaited, self.reference.is_awaited
        self.effort.is_awaited = self.reference.is_awaited = False
        self._join()
        self.effort.is_awaited, self.reference.is_awaited = awaited

    def cut(self) -> None:
        """End the block of samples that ``pop`` will return."""
        if self._first != self._next:
            self.ready.append(self._take())

    def _take(self) -> Samples:
        """Return the rows since the last call, as views that are never overwritten."""
        first, last = self._first, self._next
        samples = self._view(first, last)
        self._first = last
        if last == _ROWS:
            self._allocate()
        return samples

    def _view(self, first: int, last: int) -> Samples:
        """Return rows as samples."""
        stamps, values = self._stamps, self._values
        return Samples.of(
            stamp_ns=stamps[first:last],
            position=values[0, first:last],
            effort=values[1, first:last],
            reference_position=values[2, first:last],
            reference_velocity=values[3, first:last],
        )

    def _allocate(self) -> None:
        """Allocate new arrays; returned blocks are views of the old ones."""
        self._stamps = np.empty(_ROWS, np.int64)
        self._values = np.empty((4, _ROWS))
        self._first = self._next = 0
        self._alone_at = 0
        self._alone = self._view(0, 1)

    def _drop(self, stamp_ns: int, stream: Stream) -> None:
        if stamp_ns == stream.last_ns:
            self.counts.duplicates += 1
        else:
            self.counts.late += 1

    def _push(self, stream: Stream, stamp_ns: int, first: float, second: float) -> int:
        """Add an effort or reference; return the number of messages of its stream dropped without a position."""
        given_up = 0
        if stamp_ns <= stream.last_ns:
            if stream.last_ns - stamp_ns <= CLOCK_RESET_NS:
                self._drop(stamp_ns, stream)
                return 0
            self.counts.stream_resets += 1
            given_up = len(stream.queue)
            stream.queue.clear()
        stream.last_ns = stamp_ns
        stream.is_awaited = True
        stream.queue.append((stamp_ns, first, second))
        if self.position.queue:
            self._join()
        if len(stream.queue) > self.limit:
            stream.queue.popleft()
            given_up += 1
        return given_up

    def _restart(self, stamp_ns: int) -> None:
        """Complete the waiting samples after a reset of the clock and drop messages of the time before."""
        self.counts.clock_resets += 1
        self.flush()
        self.cut()
        for stream in (self.effort, self.reference):
            remaining = [item for item in stream.queue if item[0] <= stamp_ns + CLOCK_RESET_NS]
            given_up = len(stream.queue) - len(remaining)
            if stream is self.effort:
                self.counts.unmatched_efforts += given_up
            else:
                self.counts.unmatched_references += given_up
            stream.queue = deque(remaining)
            if stream.last_ns > stamp_ns + CLOCK_RESET_NS:
                stream.last_ns = remaining[-1][0] if remaining else _NEVER

    def _give_up(self) -> None:
        """Mark streams without messages as absent, because the oldest position has waited long enough."""
        for stream in (self.effort, self.reference):
            if not stream.queue:
                stream.is_awaited = False
        self._join()

    def _join(self) -> None:
        """Complete every position for which all awaited streams have a message."""
        positions, efforts, references = self.position.queue, self.effort.queue, self.reference.queue
        tolerance = self.tolerance_ns
        while positions:
            stamp, position, _ = positions[0]
            earliest = stamp - tolerance
            while efforts and efforts[0][0] < earliest:
                efforts.popleft()
                self.counts.unmatched_efforts += 1
            while references and references[0][0] < earliest:
                references.popleft()
                self.counts.unmatched_references += 1
            if (self.effort.is_awaited and not efforts) or (self.reference.is_awaited and not references):
                return
            row = self._next
            values = self._values
            self._stamps[row] = stamp
            values[0, row] = position
            if efforts and efforts[0][0] <= stamp + tolerance:
                values[1, row] = efforts.popleft()[1]
            else:
                values[1, row] = _NAN
                self.counts.missing_efforts += 1
            if references and references[0][0] <= stamp + tolerance:
                _, values[2, row], values[3, row] = references.popleft()
            else:
                values[2, row] = values[3, row] = _NAN
            positions.popleft()
            self.counts.samples += 1
            self._next = row + 1
            if self._next == _ROWS:
                self.cut()


def _of_one(text: str) -> str:
    """Return the words of a count for a count of one."""
    noun, _, rest = text.partition(" ")
    for several, one in _ONE_LATER:
        rest = rest.replace(several, one)
    return f"{_ONE[noun]} {rest}"
