"""Records of the MCAP container: opcodes, packing, and finding them in a buffer.

Source: the MCAP format specification, version 0 (mcap.dev/spec).
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from enum import IntEnum

import numpy as np

from sgms_observer.arrays import Bytes, Ints
from sgms_observer.bags.rows import word
from sgms_observer.jit import HAS_NUMBA, njit

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEAD = struct.Struct("<BQ")
MESSAGE_HEAD = 22  # bytes of channel, sequence, log time and publish time in front of a message's data


class Op(IntEnum):
    """Opcodes of the records that are read or written here."""

    HEADER = 0x01
    FOOTER = 0x02
    SCHEMA = 0x03
    CHANNEL = 0x04
    MESSAGE = 0x05
    CHUNK = 0x06
    MESSAGE_INDEX = 0x07
    CHUNK_INDEX = 0x08
    STATISTICS = 0x0B
    METADATA = 0x0C
    METADATA_INDEX = 0x0D
    SUMMARY_OFFSET = 0x0E
    DATA_END = 0x0F


def record(op: Op, *parts: bytes) -> bytes:
    """Return one record: opcode, length, content.

    Args:
        op: opcode.
        parts: content, joined.
    """
    content = b"".join(parts)
    return RECORD_HEAD.pack(op, len(content)) + content


def text(value: str) -> bytes:
    """Return a string with its length in front.

    Args:
        value: the string.
    """
    data = value.encode()
    return struct.pack("<I", len(data)) + data


def text_map(values: Mapping[str, str]) -> bytes:
    """Return a map of strings with its length in bytes in front.

    Args:
        values: key to value.
    """
    data = b"".join(text(key) + text(value) for key, value in values.items())
    return struct.pack("<I", len(data)) + data


def read_text(content: bytes, at: int) -> tuple[str, int]:
    """Read a string; return it and the place after it. Raises ``struct.error`` or ``ValueError`` where there is none.

    Args:
        content: of a record.
        at: where the string begins.
    """
    (length,) = struct.unpack_from("<I", content, at)
    if at + 4 + length > len(content):
        raise ValueError("a string reaches beyond its record")
    return content[at + 4 : at + 4 + length].decode(), at + 4 + length


@njit
def _find(data: Bytes, op: Bytes, start: Ints, length: Ints) -> tuple[int, int]:
    """Fill op, start and length of each whole record in ``data``; return their number and the place after them."""
    size = data.size
    at = np.int64(0)
    count = 0
    while at + 9 <= size:
        content = np.int64(0)
        for i in range(8):
            content |= np.int64(data[at + 1 + i]) << np.int64(8 * i)
        if content < 0 or content > size - at - 9:
            break
        op[count] = data[at]
        start[count] = at + 9
        length[count] = content
        count += 1
        at += 9 + content
    return count, int(at)


def find_records(data: Bytes) -> tuple[Bytes, Ints, Ints, int]:
    """Find the records in a buffer that starts with one.

    Args:
        data: content of a chunk, or a piece of a file.

    Returns:
        Opcode, first byte of the content and length of the content of each whole record, each of shape (n,), and the
        place after the last whole record.
    """
    if not HAS_NUMBA:
        return find_in_python(data.tobytes())
    limit = data.size // 9 + 1
    op = np.empty(limit, np.uint8)
    start = np.empty(limit, np.int64)
    length = np.empty(limit, np.int64)
    count, end = _find(data, op, start, length)
    return op[:count].copy(), start[:count].copy(), length[:count].copy(), end


def find_in_python(data: bytes) -> tuple[Bytes, Ints, Ints, int]:
    """Return what ``find_records`` returns, without numba: indexing numpy arrays one by one would be slow.

    Args:
        data: the records, of the file or of a chunk.
    """
    size = len(data)
    found: list[tuple[int, int, int]] = []
    at = 0
    while at + 9 <= size:
        op, content = RECORD_HEAD.unpack_from(data, at)
        if content > size - at - 9:
            break
        found.append((op, at + 9, content))
        at += 9 + content
    table = np.array(found, np.int64).reshape(-1, 3)
    return table[:, 0].astype(np.uint8), table[:, 1].copy(), table[:, 2].copy(), at


@njit
def find_messages(data: Bytes, index_of: Ints, topic: Ints, log_ns: Ints, start: Ints, length: Ints) -> int:
    """Find the messages of some channels among MCAP records; only called where numba is.

    Args:
        data: content of a chunk, or a piece of a file; starts with a record.
        index_of: number of each channel's topic, negative for those that are not wanted, shape (2**16,).
        topic: number of each message's topic, written; this and the others as long as there may be messages.
        log_ns: when each message was recorded [ns], written.
        start: first byte of each message, written.
        length: bytes of each message, written.

    Returns:
        How many messages were found.
    """
    size = data.shape[0]
    at = 0
    count = 0
    while at + 9 <= size:
        content = np.int64(word(data, at + 1))
        if content < 0 or content > size - at - 9:
            break
        if data[at] == 5 and content >= 22:
            number = index_of[np.int64(data[at + 9]) | np.int64(data[at + 10]) << 8]
            if number >= 0:
                topic[count] = number
                log_ns[count] = np.int64(word(data, at + 15))
                start[count] = at + 31
                length[count] = content - 22
                count += 1
        at += 9 + int(content)
    return count
