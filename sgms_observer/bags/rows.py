"""Messages that differ in some numbers only: kept as numbers until it is known where their bytes go; JointStates so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sgms_observer.arrays import Booleans, Bytes, Floats, Ints
from sgms_observer.bags.cdr import JointStateEncoder
from sgms_observer.errors import DataError
from sgms_observer.jit import HAS_NUMBA, njit

Words = NDArray[np.uint64]

#: Rows from which numpy encodes faster than struct.
BY_ARRAYS = 24

SECOND = 1_000_000_000
STAMP_PLACE = 4  # seconds and nanoseconds, directly after the encapsulation
HALF, LOWER = np.uint64(32), np.uint64(2**32 - 1)


@dataclass(frozen=True)
class MessageRows:
    """n messages of one size.

    Attributes:
        template: a message, shape (size,).
        places: first byte of each number of eight bytes in a message, shape (m,).
        numbers: their bits, shape (m, n), contiguous.
    """

    template: Bytes
    places: Ints
    numbers: Words

    def __len__(self) -> int:
        return int(self.numbers.shape[1])

    @property
    def size(self) -> int:
        """Return the bytes of one message."""
        return self.template.size

    def part(self, first: int, last: int) -> MessageRows:
        """Return the messages from ``first`` to the one before ``last``.

        Args:
            first: number of a message.
            last: number of a message, or n.
        """
        return MessageRows(self.template, self.places, np.ascontiguousarray(self.numbers[:, first:last]))

    def behind(self, head: bytes, places: Ints, numbers: Words) -> MessageRows:
        """Return the same messages with something in front of each.

        Args:
            head: what comes in front.
            places: first byte of each number in it that differs between messages, shape (k,).
            numbers: their bits, shape (k, n).
        """
        return MessageRows(
            np.concatenate([np.frombuffer(head, np.uint8), self.template]),
            np.concatenate([places, self.places + len(head)]),
            np.concatenate([numbers, self.numbers]),
        )

    def write(self, data: Bytes, start: Ints) -> None:
        """Write the messages into a buffer.

        Args:
            data: the buffer.
            start: first byte of each message in it, shape (n,).
        """
        if HAS_NUMBA:
            _write_rows(self.template, self.places, self.numbers, data, start)
        elif len(self):
            anywhere = np.lib.stride_tricks.sliding_window_view(data, self.size, writeable=True)
            anywhere[start] = self.to_bytes()

    def to_bytes(self) -> Bytes:
        """Return one message per row, shape (n, size)."""
        rows = np.empty((len(self), self.size), np.uint8)
        if HAS_NUMBA:
            _write_rows(self.template, self.places, self.numbers, rows.reshape(-1), np.arange(len(self)) * self.size)
            return rows
        rows[:] = self.template
        for place, values in zip(self.places.tolist(), self.numbers, strict=True):
            rows[:, place : place + 8] = values.astype("<u8").view(np.uint8).reshape(-1, 8)
        return rows


def warm_up_encoding() -> None:
    """Encode a block once, so that its kernel is not compiled while a block waits to be sent."""
    encode_joint_states(np.arange(BY_ARRAYS, dtype=np.int64), ("x",), {"effort": np.zeros((BY_ARRAYS, 1))})


def encode_joint_states(stamp_ns: Ints, names: Sequence[str], fields: dict[str, Floats], frame_id: str = "") -> Bytes:
    """Encode n JointStates that differ in their numbers only.

    Args:
        stamp_ns: stamps [ns], shape (n,).
        names: joints (axes), k of them.
        fields: any of ``position``, ``velocity`` and ``effort``, each of shape (n, k) [m], [m/s], [N].
        frame_id: of the headers.

    Returns:
        One message per row, shape (n, size), uint8.

    Raises:
        DataError: as ``joint_state_rows``.
    """
    return joint_state_rows(stamp_ns, names, fields, frame_id).to_bytes()


def joint_state_rows(
    stamp_ns: Ints, names: Sequence[str], fields: dict[str, Floats], frame_id: str = ""
) -> MessageRows:
    """Prepare n JointStates that differ in their numbers only.

    Args:
        stamp_ns: stamps [ns], shape (n,).
        names: joints (axes), k of them.
        fields: any of ``position``, ``velocity`` and ``effort``, each of shape (n, k) [m], [m/s], [N].
        frame_id: of the headers.

    Raises:
        DataError: a shape does not fit, or a stamp does not fit a ROS time.
    """
    encoder = JointStateEncoder(names, tuple(fields), frame_id)
    count = stamp_ns.size
    if count and not -(2**31) * SECOND <= int(stamp_ns.min()) <= int(stamp_ns.max()) < 2**31 * SECOND:
        raise DataError("a stamp does not fit a ROS time; give times within 68 years of 1970")
    numbers = np.empty((1 + len(encoder.starts) * len(names), count), np.uint64)
    seconds, nanoseconds = np.divmod(stamp_ns, SECOND)
    numbers[0] = (seconds.astype(np.uint64) & LOWER) | nanoseconds.astype(np.uint64) << HALF
    places = [STAMP_PLACE]
    ordered = [fields[name] for name in ("position", "velocity", "effort") if name in fields]
    for start, values in zip(encoder.starts, ordered, strict=True):
        if values.shape != (count, len(names)):
            raise DataError(
                f"a field of shape {values.shape} was given for {stamp_ns.size} stamps of {len(names)} axes"
            )
        numbers[len(places) : len(places) + len(names)].view(np.float64)[:] = values.T
        places += range(start, start + 8 * len(names), 8)
    return MessageRows(np.frombuffer(encoder.template, np.uint8), np.array(places, np.int64), numbers)


# Compiled: one pass and no copies where numpy needs several. Only called where numba is.


@njit
def word(data: Bytes, at: int) -> np.uint64:
    """Return eight bytes as a little-endian number.

    Args:
        data: bytes that hold it.
        at: the first of them.
    """
    value = np.uint64(data[at])
    for i in range(1, 8):
        value |= np.uint64(data[at + i]) << np.uint64(8 * i)
    return value


@njit
def read_rows(
    data: Bytes, start: Ints, length: Ints, template: Bytes, mask: Bytes, places: Ints, found: Booleans, out: Words
) -> int:
    """Read numbers from every message that has a layout.

    Args:
        data: bytes that hold the messages.
        start: first byte of each message, shape (n,).
        length: bytes of each message, shape (n,).
        template: a message of the layout.
        mask: 255 where a message must agree with the template, shape of ``template``.
        places: first byte of each number of eight bytes in a message, shape (m,).
        found: whether each message has the layout, shape (n,), written.
        out: the numbers' bits, one message that has the layout per column from the left, shape (m, n), written.

    Returns:
        How many messages have the layout.
    """
    size = template.shape[0]
    count = 0
    for k in range(start.shape[0]):
        at = start[k]
        agrees = length[k] >= size and at + size <= data.shape[0]
        if agrees:
            message = data[at : at + size]
            differs = np.uint8(0)
            for i in range(size):
                differs |= (message[i] ^ template[i]) & mask[i]
            agrees = differs == 0
        found[k] = agrees
        if agrees:
            for j in range(places.shape[0]):
                out[j, count] = word(data, at + places[j])
            count += 1
    return count


@njit
def _write_rows(template: Bytes, places: Ints, numbers: Words, data: Bytes, start: Ints) -> None:
    """Write messages that differ in some numbers only.

    Args:
        template: a message.
        places: first byte of each number of eight bytes in a message, shape (m,).
        numbers: their bits, shape (m, n).
        data: the buffer, written.
        start: first byte of each message in the buffer, shape (n,).
    """
    size = template.shape[0]
    for k in range(start.shape[0]):
        at = start[k]
        data[at : at + size] = template
        for j in range(places.shape[0]):
            value = numbers[j, k]
            place = at + places[j]
            for i in range(8):
                data[place + i] = np.uint8(value >> np.uint64(8 * i) & np.uint64(255))
