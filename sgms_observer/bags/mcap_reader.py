"""Reads MCAP files in blocks, in order of time, as far as they are intact."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sgms_observer.arrays import Ints
from sgms_observer.bags.bag_folder import unpack
from sgms_observer.bags.blocks import MessageBlock, gather, join_blocks
from sgms_observer.bags.mcap_records import MAGIC, MESSAGE_HEAD, RECORD_HEAD, Op, find_messages, find_records, read_text
from sgms_observer.errors import RecordingError
from sgms_observer.jit import HAS_NUMBA

_WINDOW = 2**20  # bytes of messages outside chunks that are read at once
_LARGEST = 2**30  # bytes; a larger chunk is taken for damage
_CHUNK_HEAD = struct.Struct("<QQQI")


@dataclass(frozen=True)
class _Piece:
    """Bytes of the file that hold messages: a chunk's content, or messages outside chunks."""

    start_ns: int
    end_ns: int
    offset: int
    stored: int  # bytes in the file
    size: int  # bytes after unpacking
    crc: int
    compression: str
    is_whole: bool


class McapReader:
    """One MCAP file.

    Args:
        path: the file.

    Attributes:
        topics: name to message type of every topic in the file.
        warnings: sentences about what could not be read.

    Raises:
        RecordingError: it is no MCAP file, or it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.topics: dict[str, str] = {}
        self.warnings: list[str] = []
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, str] = {}
        self._pieces: list[_Piece] = []
        try:
            self._file = path.open("rb")
            self._size = os.fstat(self._file.fileno()).st_size
        except OSError as error:
            raise RecordingError(f"{path} cannot be read: {error.strerror}; check its permissions") from None
        try:
            self._scan()
        except BaseException:
            self._file.close()
            raise

    @property
    def span_ns(self) -> tuple[int, int]:
        """Return the times of the first and the last message as the file states them [ns]; (0, 0) if it is empty."""
        spans = [(piece.start_ns, piece.end_ns) for piece in self._pieces if piece.end_ns]
        return (min(start for start, _ in spans), max(end for _, end in spans)) if spans else (0, 0)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def blocks(self, topics: Sequence[str]) -> Iterator[MessageBlock]:
        """Read messages in order of their time.

        Args:
            topics: which to read; ``MessageBlock.topics`` of every block.

        Yields:
            Blocks of at least one message.
        """
        index_of = np.full(2**16, -1, np.int64)
        for channel, name in self._channels.items():
            if name in topics:
                index_of[channel] = list(topics).index(name)
        pieces = sorted(self._pieces, key=lambda piece: (piece.start_ns, piece.offset))
        in_file_order = pieces == sorted(pieces, key=lambda piece: piece.offset)
        waiting: MessageBlock | None = None
        for number, piece in enumerate(pieces):
            block = self._read_piece(piece, tuple(topics), index_of)
            if waiting is not None and len(waiting):
                block = join_blocks(waiting, block)
            if np.any(np.diff(block.log_ns) < 0):
                block = block.take(np.argsort(block.log_ns, kind="stable"))
            ready = len(block)
            if number + 1 < len(pieces):
                limit = pieces[number + 1].start_ns
                ready = int(np.searchsorted(block.log_ns, limit, "right" if in_file_order else "left"))
            if ready:
                yield block.take(slice(0, ready))
            waiting = block.take(slice(ready, None))

    def _read(self, offset: int, size: int) -> bytes:
        try:
            self._file.seek(offset)
            return self._file.read(size)
        except OSError as error:
            raise RecordingError(f"{self.path} cannot be read: {error.strerror}; check the disk") from None

    def _scan(self) -> None:
        """Find the pieces and the topics, record by record; stop where the file is cut off or damaged."""
        head = self._read(0, len(MAGIC))
        if head != MAGIC:
            if MAGIC.startswith(head):
                raise RecordingError(f"{self.path} is empty; nothing was recorded into it")
            raise RecordingError(f"{self.path} is no MCAP file; check what wrote it")
        at = len(MAGIC)
        is_complete = has_index = False
        while at + RECORD_HEAD.size <= self._size:
            op, length = RECORD_HEAD.unpack(self._read(at, RECORD_HEAD.size).ljust(RECORD_HEAD.size, b"\0"))
            start = at + RECORD_HEAD.size
            fits = length <= self._size - start
            if op == Op.MESSAGE and fits:
                at = self._scan_messages(at, length)
                continue
            if op == Op.CHUNK:
                self._scan_chunk(start, length)
            if not fits or op == 0:
                break
            if op in (Op.SCHEMA, Op.CHANNEL) and length < _LARGEST:
                self._define(op, self._read(start, length))
            at = start + length
            has_index |= op == Op.CHUNK_INDEX
            is_complete |= op == Op.FOOTER
        if not is_complete:
            self.warnings.append(
                f"{self.path} was not closed ({self._size} bytes, whole up to byte {at}): an interrupted or damaged"
                " recording; everything readable was read"
            )
        if not is_complete or not has_index or not self._channels:
            for piece in self._pieces:
                content = np.frombuffer(self._unpack(piece, quiet=True), np.uint8)
                ops, starts, lengths, _ = find_records(content)
                for row in np.flatnonzero((ops == Op.SCHEMA) | (ops == Op.CHANNEL)):
                    self._define(int(ops[row]), content[starts[row] : starts[row] + lengths[row]].tobytes())

    def _scan_messages(self, at: int, length: int) -> int:
        """Note a run of messages outside chunks as a piece; return the place after it."""
        size = max(_WINDOW, RECORD_HEAD.size + length)
        content = np.frombuffer(self._read(at, size), np.uint8)
        ops, starts, lengths, end = find_records(content)
        others = np.flatnonzero(ops != Op.MESSAGE)
        if others.size:
            end = int(starts[others[0]]) - RECORD_HEAD.size
            ops, starts, lengths = ops[: others[0]], starts[: others[0]], lengths[: others[0]]
        if ops.size == 0:
            return at + RECORD_HEAD.size + length
        whole = lengths >= MESSAGE_HEAD
        times = gather(content, starts[whole] + 6, 8).view("<i8")
        start_ns, end_ns = (int(times.min()), int(times.max())) if times.size else (0, 0)
        self._pieces.append(_Piece(start_ns, end_ns, at, end, end, 0, "", True))
        return at + end

    def _scan_chunk(self, start: int, length: int) -> None:
        """Note where a chunk's content is; a chunk cut off by the file's end counts as far as it goes."""
        head = self._read(start, min(length, 64))
        try:
            start_ns, end_ns, size, crc = _CHUNK_HEAD.unpack_from(head)
            compression, at = read_text(head, _CHUNK_HEAD.size)
            (stored,) = struct.unpack_from("<Q", head, at)
        except (struct.error, ValueError):
            return
        offset = start + at + 8
        available = min(start + length, self._size) - offset
        if size > _LARGEST or start_ns >= 2**63:
            self.warnings.append(f"{self.path} has a damaged chunk at byte {start}; its messages are missing")
            return
        self._pieces.append(
            _Piece(start_ns, end_ns, offset, min(stored, available), size, crc, compression, stored <= available)
        )

    def _define(self, op: int, content: bytes) -> None:
        """Note a message type or a topic."""
        try:
            if op == Op.SCHEMA:
                (number,) = struct.unpack_from("<H", content)
                self._schemas[number] = read_text(content, 2)[0]
                return
            channel, schema = struct.unpack_from("<HH", content)
            name = read_text(content, 4)[0]
        except (struct.error, ValueError):
            return
        kind = self._schemas.get(schema, "")
        if not (name.isprintable() and kind.isprintable()):
            self.warnings.append(f"{self.path} has a damaged topic; its messages are not read")
        elif self.topics.setdefault(name, kind) == kind:
            self._channels[channel] = name
        elif channel not in self._channels:
            self.warnings.append(
                f"{self.path} holds {name} as {self.topics[name]} and as {kind}; the latter is not read"
            )

    def _unpack(self, piece: _Piece, quiet: bool = False) -> bytes:
        """Return the readable content of a piece."""
        stored = self._read(piece.offset, piece.stored)
        content = unpack(stored, piece.compression, piece.size)
        is_damaged = piece.is_whole and (
            len(content) != piece.size or (piece.crc != 0 and zlib.crc32(content) != piece.crc)
        )
        if is_damaged and not quiet:
            self.warnings.append(f"{self.path} has a damaged chunk at byte {piece.offset}; its messages are missing")
        return b"" if is_damaged else content

    def _read_piece(self, piece: _Piece, topics: tuple[str, ...], index_of: Ints) -> MessageBlock:
        """Return the messages of a piece that belong to the topics asked for, as they are in the file."""
        content = np.frombuffer(self._unpack(piece), np.uint8)
        if HAS_NUMBA:
            room = np.empty((4, content.size // (RECORD_HEAD.size + MESSAGE_HEAD) + 1), np.int64)
            count = find_messages(content, index_of, room[0], room[1], room[2], room[3])
            return MessageBlock(topics, room[0, :count], room[1, :count], content, room[2, :count], room[3, :count])
        ops, starts, lengths, _ = find_records(content)
        messages = (ops == Op.MESSAGE) & (lengths >= MESSAGE_HEAD)
        starts, lengths = starts[messages], lengths[messages]
        head = gather(content, starts, MESSAGE_HEAD + 2)
        topic = index_of[head[:, :2].copy().view("<u2")[:, 0]] if starts.size else np.empty(0, np.int64)
        log_ns = head[:, 6:14].copy().view("<i8")[:, 0].astype(np.int64) if starts.size else np.empty(0, np.int64)
        block = MessageBlock(topics, topic, log_ns, content, starts + MESSAGE_HEAD, lengths - MESSAGE_HEAD)
        return block if np.all(topic >= 0) else block.take(np.flatnonzero(topic >= 0))
