"""The bytes of ROS messages (XCDR1) that begin with a header: a place that reads them, and what appends to them."""

from __future__ import annotations

import struct

from sgms_observer.errors import DataError

Buffer = bytes | bytearray | memoryview

HEADER = 4
"""Bytes of encapsulation; alignment counts from behind them."""
_ENCODINGS = {b"\x00\x01": "<", b"\x00\x00": ">"}
_SECOND = 1_000_000_000
_SEC_LIMIT = 2**31


def aligned(offset: int, size: int) -> int:
    """Return the first multiple of ``size`` at or behind ``offset``, counted as XCDR1 does.

    Args:
        offset: place in the message [bytes], encapsulation included.
        size: alignment [bytes].
    """
    return offset + (HEADER - offset) % size


class Cursor:
    """A place in a message, at first behind the stamp; reading beyond the end is a DataError, nothing else.

    Args:
        message: the whole message with its encapsulation.
        kind: of the message, for errors.

    Attributes:
        at: the place [bytes].
        order: ``<`` or ``>``, as ``struct`` writes the order of bytes.
        stamp_ns: of the header [ns].

    Raises:
        DataError: the bytes do not start like a message with a header.
    """

    def __init__(self, message: Buffer, kind: str) -> None:
        order = _ENCODINGS.get(bytes(message[:2]))
        if order is None or len(message) < 16:
            raise DataError(f"a {kind} of {len(message)} bytes does not start like one; it was not used")
        self._message = message
        self._kind = kind
        self._uint32 = struct.Struct(order + "I").unpack_from
        seconds, nanoseconds = struct.unpack_from(order + "iI", message, HEADER)
        self.order = order
        self.stamp_ns: int = seconds * _SECOND + nanoseconds
        self.at = HEADER + 8

    def pad(self, size: int) -> int:
        """Move on to the next alignment; return how many bytes were skipped.

        Args:
            size: alignment [bytes].
        """
        start, self.at = self.at, aligned(self.at, size)
        return self.at - start

    def skip(self, size: int) -> None:
        """Move on.

        Args:
            size: by how much [bytes].
        """
        self.at += size
        if self.at > len(self._message):
            raise DataError(f"a {self._kind} of {len(self._message)} bytes is cut off; it was not used")

    def byte(self) -> int:
        """Read one byte."""
        self.skip(1)
        return int(self._message[self.at - 1])

    def length(self, item_size: int) -> int:
        """Read the length of an array or string.

        Args:
            item_size: what one of its items takes at least [bytes].
        """
        start = aligned(self.at, 4)
        self.at = start
        self.skip(4)
        length = int(self._uint32(self._message, start)[0])
        if length * item_size > len(self._message) - self.at:
            self.skip(length * item_size)
        return length

    def text(self) -> str:
        """Read a string."""
        length = self.length(1)
        self.skip(length)
        return bytes(self._message[self.at - length : self.at]).rstrip(b"\0").decode("utf-8", "replace")


def seconds_of(stamp_ns: int) -> tuple[int, int]:
    """Return seconds and nanoseconds of a stamp, as ROS counts them.

    Args:
        stamp_ns: time [ns].

    Raises:
        DataError: the stamp does not fit a ROS time.
    """
    seconds, nanoseconds = divmod(stamp_ns, _SECOND)
    if not -_SEC_LIMIT <= seconds < _SEC_LIMIT:
        raise DataError(f"the stamp {stamp_ns} ns does not fit a ROS time; give a time within 68 years of 1970")
    return seconds, nanoseconds


def begin_message(stamp_ns: int, frame_id: str = "") -> bytearray:
    """Return a message up to the end of its header.

    Args:
        stamp_ns: time of the header [ns].
        frame_id: of the header.

    Raises:
        DataError: the stamp does not fit a ROS time.
    """
    message = bytearray(b"\x00\x01\x00\x00" + struct.pack("<iI", *seconds_of(stamp_ns)))
    append_string(message, frame_id)
    return message


def append_uint32(buffer: bytearray, value: int) -> None:
    """Append an unsigned integer at the next multiple of four.

    Args:
        buffer: the message so far.
        value: the number.
    """
    buffer.extend(bytes(aligned(len(buffer), 4) - len(buffer)))
    buffer.extend(struct.pack("<I", value))


def append_string(buffer: bytearray, text: str) -> None:
    """Append a string with its length in front.

    Args:
        buffer: the message so far.
        text: the string.
    """
    data = text.encode() + b"\0"
    append_uint32(buffer, len(data))
    buffer.extend(data)
