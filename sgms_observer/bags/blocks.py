"""Blocks of recorded messages: their places in a buffer, and JointStates read from them with numpy."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sgms_observer.arrays import Booleans, Bytes, Floats, Ints
from sgms_observer.bags.cdr import JointStateLayout
from sgms_observer.bags.rows import HALF, LOWER, SECOND, STAMP_PLACE, read_rows
from sgms_observer.errors import DataError
from sgms_observer.jit import HAS_NUMBA

_LAYOUTS_AT_ONCE = 16
_LITTLE_ENDIAN = b"\x00\x01"


@dataclass(frozen=True)
class MessageBlock:
    """n recorded messages in the order of the recording.

    Attributes:
        topics: names of the topics that ``topic`` points into.
        topic: topic of each message, shape (n,).
        log_ns: when each message was recorded [ns], shape (n,).
        data: bytes that hold the messages.
        start: first byte of each message in ``data``, shape (n,).
        length: bytes of each message, shape (n,).
    """

    topics: tuple[str, ...]
    topic: Ints
    log_ns: Ints
    data: Bytes
    start: Ints
    length: Ints

    def message(self, row: int) -> bytes:
        """Return one message's bytes.

        Args:
            row: its number.
        """
        return self.data[self.start[row] : self.start[row] + self.length[row]].tobytes()

    def take(self, rows: NDArray[np.intp] | Booleans | slice) -> MessageBlock:
        """Return some of the messages; the bytes are shared.

        Args:
            rows: their numbers, a mask, or a slice.
        """
        return MessageBlock(
            self.topics, self.topic[rows], self.log_ns[rows], self.data, self.start[rows], self.length[rows]
        )

    def of_topic(self, topic: str) -> NDArray[np.intp]:
        """Return the rows of one topic.

        Args:
            topic: full name.
        """
        if topic not in self.topics:
            return np.empty(0, np.intp)
        return np.flatnonzero(self.topic == self.topics.index(topic))

    def __len__(self) -> int:
        return self.start.size


@dataclass(frozen=True)
class JointStates:
    """n JointStates with the same names.

    Attributes:
        names: joints (axes), k of them.
        stamp_ns: stamps of the headers [ns], shape (n,).
        position: [m] or [rad], shape (n, k); NaN where the message had none.
        velocity: [m/s] or [rad/s], shape (n, k); NaN where the message had none.
        effort: [N] or [N m], shape (n, k); NaN where the message had none.
        row: row of each one in the block, shape (n,).
        filled: number of positions, velocities and efforts in each message; empty where the messages differ.
    """

    names: tuple[str, ...]
    stamp_ns: Ints
    position: Floats
    velocity: Floats
    effort: Floats
    row: NDArray[np.intp]
    filled: tuple[int, ...] = ()


def join_blocks(first: MessageBlock, second: MessageBlock) -> MessageBlock:
    """Return two blocks of the same topics as one; neither is empty.

    Args:
        first: the block before.
        second: the block after it.
    """
    begin, end = int(first.start.min()), int((first.start + first.length).max())
    first = replace(first, data=first.data[begin:end], start=first.start - begin)
    return MessageBlock(
        first.topics,
        np.concatenate([first.topic, second.topic]),
        np.concatenate([first.log_ns, second.log_ns]),
        np.concatenate([first.data, second.data]),
        np.concatenate([first.start, second.start + first.data.size]),
        np.concatenate([first.length, second.length]),
    )


def gather(data: Bytes, start: Ints, width: int) -> Bytes:
    """Copy ``width`` bytes from each start; zeros after the end of the data.

    Args:
        data: the buffer.
        start: first byte of each row, shape (n,), all inside the buffer.
        width: bytes per row.

    Returns:
        Array of shape (n, width).
    """
    if start.size == 0:
        return np.empty((0, width), np.uint8)
    if int(start.max()) + width > data.size:
        data = np.concatenate([data, np.zeros(width, np.uint8)])
    rows: Bytes = np.lib.stride_tricks.sliding_window_view(data, width)[start]
    return rows


@dataclass(frozen=True)
class Pattern:
    """A layout as bytes that messages are compared with.

    Attributes:
        layout: where the numbers are.
        template: a message of that layout.
        mask: 255 where messages of the layout agree, shape of ``template``.
        places: first byte of the stamp and of each number that is read, shape (1 + m,).
    """

    layout: JointStateLayout
    template: Bytes
    mask: Bytes
    places: Ints

    @classmethod
    def of(cls, message: bytes) -> Pattern:
        """Take a message as the pattern.

        Args:
            message: the whole message with its encapsulation.

        Raises:
            DataError: the bytes are no JointState.
        """
        layout = JointStateLayout.of(message)
        mask = np.zeros(layout.size, np.uint8)
        for begin, end in layout.constant:
            mask[begin:end] = 255
        places = [STAMP_PLACE]
        for start, used in zip(layout.offsets, _used(layout), strict=True):
            places += range(start, start + 8 * used, 8)
        return cls(layout, np.frombuffer(message[: layout.size], np.uint8), mask, np.array(places, np.int64))


def decode_joint_states(
    block: MessageBlock, rows: NDArray[np.intp], known: list[Pattern] | None = None
) -> tuple[list[JointStates], int]:
    """Decode JointStates among a block's messages.

    Args:
        block: the messages.
        rows: which of them to decode.
        known: the pattern that the latest messages of this topic had, if any; kept up to date.

    Returns:
        One ``JointStates`` per layout, its rows ascending; and how many of the messages are no JointState.
    """
    groups = []
    bad = 0
    rounds = 0
    known = [] if known is None else known
    while rows.size:
        rounds += 1
        first = rows[:1]
        if rounds > 1 or not known:
            try:
                known[:] = [Pattern.of(block.message(int(first[0])))]
            except DataError:
                bad += 1
                rows = rows[1:]
                continue
        # Many different layouts in one block are no recording of a machine: continue without a pattern.
        tried = rows if rounds <= _LAYOUTS_AT_ONCE else first
        found, group = _read(block, tried, known[0])
        if group.row.size:
            groups.append(group)
        rows = rows[tried.size :] if found.all() else np.concatenate([tried[~found], rows[tried.size :]])
    return groups, bad


def _used(layout: JointStateLayout) -> tuple[int, ...]:
    """Return the number of values of each array per name."""
    return tuple(min(entries, len(layout.names)) for entries in layout.counts)


def _read(block: MessageBlock, rows: NDArray[np.intp], pattern: Pattern) -> tuple[Booleans, JointStates]:
    """Read the messages that have this layout; also return which of ``rows`` those are."""
    layout = pattern.layout
    found, numbers = (_find_compiled if HAS_NUMBA else _find_by_arrays)(block, rows, pattern)
    if not found.all():
        rows = rows[found]
    if layout.encoding != _LITTLE_ENDIAN:
        numbers = numbers.byteswap()
        seconds, nanoseconds = numbers[0] >> HALF, numbers[0] & LOWER
    else:
        seconds, nanoseconds = numbers[0] & LOWER, numbers[0] >> HALF
    stamps = seconds.astype(np.uint32).view(np.int32).astype(np.int64) * SECOND + nanoseconds.astype(np.int64)
    fields = []
    at = 1
    for used in _used(layout):
        values = np.full((rows.size, len(layout.names)), np.nan)
        values[:, :used] = numbers[at : at + used].view(np.float64).T
        fields.append(values)
        at += used
    return found, JointStates(layout.names, stamps, fields[0], fields[1], fields[2], rows, layout.counts)


def _find_compiled(
    block: MessageBlock, rows: NDArray[np.intp], pattern: Pattern
) -> tuple[Booleans, NDArray[np.uint64]]:
    """Return which of the messages have the layout, and the bits of their stamps and numbers, shape (1 + m, found)."""
    found = np.empty(rows.size, np.bool_)
    numbers = np.empty((pattern.places.size, rows.size), np.uint64)
    start, length = block.start[rows], block.length[rows]
    count = read_rows(block.data, start, length, pattern.template, pattern.mask, pattern.places, found, numbers)
    return found, numbers[:, :count]


def _find_by_arrays(
    block: MessageBlock, rows: NDArray[np.intp], pattern: Pattern
) -> tuple[Booleans, NDArray[np.uint64]]:
    """Do the same without numba."""
    messages = gather(block.data, block.start[rows], pattern.template.size)
    found = block.length[rows] >= pattern.template.size
    found &= ~((messages ^ pattern.template) & pattern.mask).any(axis=1)
    messages = messages[found]
    numbers = np.empty((pattern.places.size, len(messages)), np.uint64)
    for row, place in enumerate(pattern.places.tolist()):
        numbers[row] = np.ascontiguousarray(messages[:, place : place + 8]).view("<u8")[:, 0]
    return found, numbers
