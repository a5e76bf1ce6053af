"""Many recorded messages at once: where they are in a buffer, and JointStates read from them with numpy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sgms_observer.bags.cdr import JointStateEncoder, JointStateLayout
from sgms_observer.errors import DataError

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

_LAYOUTS_AT_ONCE = 16
_SECOND = 1_000_000_000


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
        """Return one message's bytes."""
        return self.data[self.start[row] : self.start[row] + self.length[row]].tobytes()

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_] | slice) -> MessageBlock:
        """Return some of the messages; the bytes are shared."""
        return MessageBlock(
            self.topics, self.topic[rows], self.log_ns[rows], self.data, self.start[rows], self.length[rows]
        )

    def of_topic(self, topic: str) -> NDArray[np.intp]:
        """Return the rows of one topic."""
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
        row: which row of the block each one was, shape (n,).
        filled: how many positions, velocities and efforts each message had; empty where messages differ in that.
    """

    names: tuple[str, ...]
    stamp_ns: Ints
    position: Floats
    velocity: Floats
    effort: Floats
    row: NDArray[np.intp]
    filled: tuple[int, ...] = ()


def join_blocks(first: MessageBlock, second: MessageBlock) -> MessageBlock:
    """Return two blocks of the same topics as one."""
    return MessageBlock(
        first.topics,
        np.concatenate([first.topic, second.topic]),
        np.concatenate([first.log_ns, second.log_ns]),
        np.concatenate([first.data, second.data]),
        np.concatenate([first.start, second.start + first.data.size]),
        np.concatenate([first.length, second.length]),
    )


def gather(data: Bytes, start: Ints, width: int) -> Bytes:
    """Copy ``width`` bytes from each start; behind the end of the data there are zeros.

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


def decode_joint_states(block: MessageBlock, rows: NDArray[np.intp]) -> tuple[list[JointStates], int]:
    """Decode JointStates among a block's messages.

    Args:
        block: the messages.
        rows: which of them to decode.

    Returns:
        One ``JointStates`` per layout, its rows ascending; and how many of the messages are no JointState.
    """
    groups = []
    bad = 0
    rounds = 0
    while rows.size:
        rounds += 1
        first = rows[:1]
        try:
            layout = JointStateLayout.of(block.message(int(first[0])))
        except DataError:
            bad += 1
            rows = rows[1:]
            continue
        # Many different layouts in one block are no recording of a machine: go on without looking ahead.
        tried = rows if rounds <= _LAYOUTS_AT_ONCE else first
        found, group = _read(block, tried, layout)
        groups.append(group)
        rows = np.concatenate([tried[~found], rows[tried.size :]])
    return groups, bad


def _read(
    block: MessageBlock, rows: NDArray[np.intp], layout: JointStateLayout
) -> tuple[NDArray[np.bool_], JointStates]:
    """Read the messages that have this layout; also return which of ``rows`` those are."""
    width = layout.size + (-layout.size) % 8
    template = np.frombuffer(block.message(int(rows[0]))[: layout.size].ljust(width, b"\0"), np.uint8)
    mask = np.zeros(width, np.uint8)
    for begin, end in layout.constant:
        mask[begin:end] = 255
    found = block.length[rows] >= layout.size
    messages = gather(block.data, block.start[rows], width)
    differs = (messages.view(np.uint64) ^ template.view(np.uint64)) & mask.view(np.uint64)
    found &= ~differs.any(axis=1)
    if not found.all():
        messages, rows = messages[found], rows[found]
    order = "<" if layout.encoding == b"\x00\x01" else ">"
    count = len(layout.names)
    seconds = _column(messages, 4, order + "i4", 1)[:, 0].astype(np.int64)
    nanoseconds = _column(messages, 8, order + "u4", 1)[:, 0].astype(np.int64)
    fields = []
    for start, entries in zip(layout.offsets, layout.counts, strict=True):
        values = np.full((rows.size, count), np.nan)
        used = min(entries, count)
        if used:
            values[:, :used] = _column(messages, start, order + "f8", used)
        fields.append(values)
    stamps = seconds * _SECOND + nanoseconds
    return found, JointStates(layout.names, stamps, fields[0], fields[1], fields[2], rows, layout.counts)


def _column(messages: Bytes, start: int, kind: str, count: int) -> NDArray[np.generic]:
    """Read ``count`` numbers at the same place of every message, shape (n, count)."""
    width = np.dtype(kind).itemsize * count
    return np.ascontiguousarray(messages[:, start : start + width]).view(kind)


def encode_joint_states(stamp_ns: Ints, names: Sequence[str], fields: dict[str, Floats], frame_id: str = "") -> Bytes:
    """Encode n JointStates that differ in their numbers only.

    Args:
        stamp_ns: stamps [ns], shape (n,).
        names: joints (axes), k of them.
        fields: any of ``position``, ``velocity`` and ``effort``, each of shape (n, k).
        frame_id: of the headers.

    Returns:
        One message per row, shape (n, size), uint8.

    Raises:
        DataError: a shape does not fit, or a stamp does not fit a ROS time.
    """
    encoder = JointStateEncoder(names, tuple(fields), frame_id)
    rows = np.tile(np.frombuffer(encoder.template, np.uint8), (stamp_ns.size, 1))
    seconds, nanoseconds = np.divmod(stamp_ns, _SECOND)
    if stamp_ns.size and not -(2**31) <= int(seconds.min()) <= int(seconds.max()) < 2**31:
        raise DataError("a stamp does not fit a ROS time; give times within 68 years of 1970")
    rows[:, 4:8] = seconds.astype("<i4").view(np.uint8).reshape(-1, 4)
    rows[:, 8:12] = nanoseconds.astype("<u4").view(np.uint8).reshape(-1, 4)
    ordered = [fields[name] for name in ("position", "velocity", "effort") if name in fields]
    for start, values in zip(encoder.starts, ordered, strict=True):
        if values.shape != (stamp_ns.size, len(names)):
            raise DataError(
                f"a field of shape {values.shape} was given for {stamp_ns.size} stamps of {len(names)} axes"
            )
        rows[:, start : start + 8 * len(names)] = np.ascontiguousarray(values, "<f8").view(np.uint8)
    return rows
