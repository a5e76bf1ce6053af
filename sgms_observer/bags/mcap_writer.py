"""Writes MCAP files as rosbag2 reads them: chunked, indexed, readable up to the last flush if the process is killed."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sgms_observer.arrays import Bytes, Floats, Ints
from sgms_observer.bags.bag_folder import dump_metadata, dump_qos
from sgms_observer.bags.mcap_records import MAGIC, MESSAGE_HEAD, RECORD_HEAD, Op, record, text, text_map
from sgms_observer.bags.message_types import JOINT_STATE, MessageType, describe_type
from sgms_observer.bags.rows import MessageRows, joint_state_rows
from sgms_observer.errors import RecordingError

_CHUNK = 2**20  # bytes of one chunk
_PENDING = 8 * _CHUNK  # bytes that wait to be put in order of time
_KEPT = 4 * _PENDING  # bytes written last that the operating system keeps in memory
_OVERHEAD = RECORD_HEAD.size + MESSAGE_HEAD
_MESSAGE = struct.Struct("<BQHIQQ")
_TIMES = np.array([15, 23])  # first bytes of log time and publish time in a message record


@dataclass(frozen=True)
class _Rows:
    """Whole message records of one channel, all of the same size."""

    channel: int
    log_ns: Ints
    records: MessageRows


class McapWriter:
    """One MCAP file.

    Messages wait until some megabytes are there, or ``flush`` is called, and go into chunks in order of their time.

    Args:
        path: the file to create.

    Raises:
        OSError: it cannot be created; every other method may raise it too.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("xb")
        self._offset = 0
        self._summary: dict[Op, list[bytes]] = {Op.SCHEMA: [], Op.CHANNEL: [], Op.CHUNK_INDEX: []}
        self._schemas: dict[str, int] = {}
        self._counts: dict[int, int] = {}
        self._singles: list[tuple[int, int, bytes]] = []
        self._rows: list[_Rows] = []
        self._pending = 0
        self._span = (2**63 - 1, 0)
        self._sorted = np.empty(0, np.uint8)  # kept: the operating system takes time to give new memory
        self._put(MAGIC)
        self._put(record(Op.HEADER, text("ros2"), text("sgms_observer")))

    def add_topic(self, topic: str, kind: MessageType) -> int:
        """Introduce a topic; return its channel.

        Args:
            topic: full name.
            kind: type of its messages.
        """
        if kind.name not in self._schemas:
            schema = len(self._schemas) + 1
            self._schemas[kind.name] = schema
            encoding = "ros2msg" if kind.definition else ""
            definition = struct.pack("<H", schema) + text(kind.name) + text(encoding) + text(kind.definition)
            self._introduce(Op.SCHEMA, definition)
        channel = len(self._counts) + 1
        self._counts[channel] = 0
        about = text_map({"offered_qos_profiles": dump_qos(), "topic_type_hash": kind.digest})
        head = struct.pack("<HH", channel, self._schemas[kind.name])
        self._introduce(Op.CHANNEL, head + text(topic) + text("cdr") + about)
        return channel

    def write(self, channel: int, log_ns: int, data: bytes) -> None:
        """Add one message.

        Args:
            channel: number of the topic.
            log_ns: time of the recording [ns].
            data: the message's bytes.
        """
        self._singles.append((channel, log_ns, data))
        self._pending += len(data) + _OVERHEAD
        if self._pending > _PENDING:
            self.flush()

    def write_rows(self, channel: int, log_ns: Ints, messages: MessageRows) -> None:
        """Add n messages of one size.

        Args:
            channel: number of the topic.
            log_ns: times of the recording [ns], shape (n,).
            messages: the messages.
        """
        head = _MESSAGE.pack(Op.MESSAGE, messages.size + MESSAGE_HEAD, channel, 0, 0, 0)
        records = messages.behind(head, _TIMES, np.stack([log_ns, log_ns]).view(np.uint64))
        rows_at_once = max(1, _PENDING // records.size)
        for first in range(0, len(records), rows_at_once):
            last = min(first + rows_at_once, len(records))
            self._rows.append(_Rows(channel, log_ns[first:last], records.part(first, last)))
            self._pending += (last - first) * records.size
            if self._pending > _PENDING:
                self.flush()

    def flush(self) -> None:
        """Hand everything that waits to the operating system: it survives the end of this process."""
        if self._pending:
            data, channel, log_ns, start = self._in_order()
            self._singles, self._rows, self._pending = [], [], 0
            cuts = np.flatnonzero(np.diff(start // _CHUNK)) + 1
            for first, last in zip([0, *cuts.tolist()], [*cuts.tolist(), start.size], strict=True):
                end = int(start[last]) if last < start.size else data.size
                rows = slice(first, last)
                self._put_chunk(data[int(start[first]) : end], channel[rows], log_ns[rows], start[rows] - start[first])
        self._file.flush()
        self._let_go()

    def close(self, metadata: str) -> None:
        """Write what waits, the index and the end.

        Args:
            metadata: text of metadata.yaml, kept in the file too.
        """
        self.flush()
        about_start = self._offset
        self._put(record(Op.METADATA, text("rosbag2"), text_map({"serialized_metadata": metadata})))
        about_index = struct.pack("<QQ", about_start, self._offset - about_start) + text("rosbag2")
        self._put(record(Op.DATA_END, bytes(4)))
        counts = b"".join(struct.pack("<HQ", *item) for item in self._counts.items())
        chunks = self._summary[Op.CHUNK_INDEX]
        has_messages = any(self._counts.values())
        statistics = struct.pack(
            "<QHIIIIQQI", sum(self._counts.values()), len(self._schemas), len(self._counts), 0, 1, len(chunks),
            *(self._span if has_messages else (0, 0)), len(counts),
        )  # fmt: skip
        groups = {**self._summary, Op.METADATA_INDEX: [about_index], Op.STATISTICS: [statistics + counts]}
        summary_start = self._offset
        offsets = b""
        for op, contents in groups.items():
            start = self._offset
            for content in contents:
                self._put(record(op, content))
            if contents:
                offsets += record(Op.SUMMARY_OFFSET, struct.pack("<BQQ", op, start, self._offset - start))
        offsets_start = self._offset
        self._put(offsets)
        self._put(record(Op.FOOTER, struct.pack("<QQI", summary_start, offsets_start, 0)))
        self._put(MAGIC)
        self._file.close()

    def abort(self) -> None:
        """Close the file as it is."""
        self._file.close()

    def _let_go(self) -> None:
        """Tell the operating system that the written part is not read again, so that it can reuse the memory.

        A long recording then pushes nothing else out of memory, and goes to the disk steadily instead of in bursts.
        """
        advise = getattr(os, "posix_fadvise", None)
        if advise is not None and self._offset > _KEPT:
            with suppress(OSError):  # a file system that knows no advice
                advise(self._file.fileno(), 0, self._offset - _KEPT, os.POSIX_FADV_DONTNEED)

    def _put(self, data: bytes | memoryview) -> None:
        self._file.write(data)
        self._offset += len(data)

    def _introduce(self, op: Op, content: bytes) -> None:
        self._summary[op].append(content)
        self._put(record(op, content))

    def _in_order(self) -> tuple[Bytes, NDArray[np.intp], Ints, Ints]:
        """Return all waiting records in order of time: bytes, channel, time and first byte of each."""
        singles = [
            _MESSAGE.pack(Op.MESSAGE, len(data) + MESSAGE_HEAD, channel, 0, log, log) + data
            for channel, log, data in self._singles
        ]
        channel = np.concatenate(
            [np.array([single[0] for single in self._singles], np.intp)]
            + [np.full(rows.log_ns.size, rows.channel, np.intp) for rows in self._rows]
        )
        log_ns = np.concatenate(
            [np.array([single[1] for single in self._singles], np.int64)] + [rows.log_ns for rows in self._rows]
        )
        length = np.concatenate(
            [np.array([len(single) for single in singles], np.int64)]
            + [np.full(rows.log_ns.size, rows.records.size, np.int64) for rows in self._rows]
        )
        order = np.argsort(log_ns, kind="stable")
        start_in_order = np.cumsum(length[order]) - length[order]
        start = np.empty_like(start_in_order)
        start[order] = start_in_order
        if not self._rows and np.array_equal(order, np.arange(order.size)):
            return np.frombuffer(b"".join(singles), np.uint8), channel, log_ns, start
        if self._sorted.size < self._pending:
            self._sorted = np.empty(self._pending, np.uint8)
        data = self._sorted[: self._pending]
        for at, single in zip(start[: len(singles)].tolist(), singles, strict=True):
            data[at : at + len(single)] = np.frombuffer(single, np.uint8)
        done = len(singles)
        for rows in self._rows:
            rows.records.write(data, start[done : done + len(rows.records)])
            done += len(rows.records)
        return data, channel[order], log_ns[order], start_in_order

    def _put_chunk(self, data: Bytes, channel: NDArray[np.intp], log_ns: Ints, start: Ints) -> None:
        content = data.data
        first, last = int(log_ns.min()), int(log_ns.max())
        self._span = (min(self._span[0], first), max(self._span[1], last))
        chunk_start = self._offset
        head = (
            struct.pack("<QQQI", first, last, len(content), zlib.crc32(content))
            + text("")
            + struct.pack("<Q", len(content))
        )
        self._put(RECORD_HEAD.pack(Op.CHUNK, len(head) + len(content)) + head)
        self._put(content)
        chunk_end = self._offset
        offsets = b""
        for used in np.flatnonzero(np.bincount(channel)).tolist():
            rows = channel == used
            entries = np.stack([log_ns[rows], start[rows]], axis=1).astype("<u8").tobytes()
            self._counts[used] += len(entries) // 16
            offsets += struct.pack("<HQ", used, self._offset)
            self._put(record(Op.MESSAGE_INDEX, struct.pack("<HI", used, len(entries)), entries))
        index = struct.pack("<QQQQI", first, last, chunk_start, chunk_end - chunk_start, len(offsets)) + offsets
        index += struct.pack("<Q", self._offset - chunk_end) + text("") + struct.pack("<QQ", len(content), len(content))
        self._summary[Op.CHUNK_INDEX].append(index)


@dataclass(frozen=True)
class JointStates:
    """Messages of one topic.

    Attributes:
        topic: full name.
        stamp_ns: sample times [ns], shape (n,).
        names: k entries of each message.
        fields: ``position`` [m or rad], ``velocity`` [per s] and ``effort`` [N or N m], as far as there are any, shape
            (n, k).
    """

    topic: str
    stamp_ns: Ints
    names: Sequence[str]
    fields: dict[str, Floats]


def write_mcap(topics: Sequence[JointStates], path: Path) -> None:
    """Write a file; one of that name is replaced.

    Args:
        topics: what it holds.
        path: the file.

    Raises:
        RecordingError: it cannot be written; one sentence.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    kind = describe_type(JOINT_STATE)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.unlink(missing_ok=True)
        writer = McapWriter(partial)
        try:
            for states in topics:
                channel = writer.add_topic(states.topic, kind)
                if states.stamp_ns.size:
                    rows = joint_state_rows(states.stamp_ns, states.names, states.fields)
                    writer.write_rows(channel, states.stamp_ns, rows)
            stamps = np.concatenate([states.stamp_ns for states in topics])
            counts = {states.topic: (kind, states.stamp_ns.size) for states in topics}
            writer.close(dump_metadata("mcap", path.name, int(stamps.min()), int(stamps.max()), counts))
        except BaseException:
            writer.abort()
            raise
        os.replace(partial, path)
    except OSError as error:
        reason = error.strerror or str(error)
        raise RecordingError(f"{path} cannot be written: {reason}; make room or choose another folder") from None
    finally:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
