"""Messages that differ in some numbers only: kept as numbers until it is known where their bytes go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sgms_observer.bags.byte_loops import write_rows
from sgms_observer.jit import HAS_NUMBA

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]
Words = NDArray[np.uint64]


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
            write_rows(self.template, self.places, self.numbers, data, start)
        elif len(self):
            anywhere = np.lib.stride_tricks.sliding_window_view(data, self.size, writeable=True)
            anywhere[start] = self.to_bytes()

    def to_bytes(self) -> Bytes:
        """Return one message per row, shape (n, size)."""
        rows = np.empty((len(self), self.size), np.uint8)
        if HAS_NUMBA:
            write_rows(self.template, self.places, self.numbers, rows.reshape(-1), np.arange(len(self)) * self.size)
            return rows
        rows[:] = self.template
        for place, values in zip(self.places.tolist(), self.numbers, strict=True):
            rows[:, place : place + 8] = values.astype("<u8").view(np.uint8).reshape(-1, 8)
        return rows
