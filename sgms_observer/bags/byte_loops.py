"""Loops over the bytes of many messages, compiled: one pass and no copies where numpy needs several.

Only called where numba is (``jit.HAS_NUMBA``); ``blocks`` and ``mcap_writer`` say the same in numpy.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sgms_observer.jit import njit

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]
Words = NDArray[np.uint64]


@njit
def _word(data: Bytes, at: int) -> np.uint64:
    """Return eight bytes as a little-endian number."""
    value = np.uint64(data[at])
    for i in range(1, 8):
        value |= np.uint64(data[at + i]) << np.uint64(8 * i)
    return value


@njit
def find_messages(data: Bytes, index_of: Ints, topic: Ints, log_ns: Ints, start: Ints, length: Ints) -> int:
    """Find the messages of some channels among MCAP records.

    Args:
        data: content of a chunk, or a piece of a file; starts with a record.
        index_of: number of each channel's topic, negative for those that are not wanted, shape (2**16,).
        topic: number of each message's topic, written; this and the others as long as there may be messages.
        log_ns: when each message was recorded [ns], written.
        start: first byte of each message, written.
        length: bytes of each message, written.

    Returns:
        How many messages were found.

    Source: the MCAP format specification, version 0 (mcap.dev/spec).
    """
    size = data.shape[0]
    at = 0
    count = 0
    while at + 9 <= size:
        content = np.int64(_word(data, at + 1))
        if content < 0 or content > size - at - 9:
            break
        if data[at] == 5 and content >= 22:
            number = index_of[np.int64(data[at + 9]) | np.int64(data[at + 10]) << 8]
            if number >= 0:
                topic[count] = number
                log_ns[count] = np.int64(_word(data, at + 15))
                start[count] = at + 31
                length[count] = content - 22
                count += 1
        at += 9 + int(content)
    return count


@njit
def read_rows(
    data: Bytes,
    start: Ints,
    length: Ints,
    template: Bytes,
    mask: Bytes,
    places: Ints,
    found: NDArray[np.bool_],
    out: Words,
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
                out[j, count] = _word(data, at + places[j])
            count += 1
    return count


@njit
def write_rows(template: Bytes, places: Ints, numbers: Words, data: Bytes, start: Ints) -> None:
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
