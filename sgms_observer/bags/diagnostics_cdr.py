"""DiagnosticArray as bytes (XCDR1): ``friction_parameters`` and ``/diagnostics`` in bags, without ROS."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from sgms_observer.bags.cdr import Buffer, aligned, append_string, append_uint32
from sgms_observer.errors import DataError

_ORDERS = {b"\x00\x01": "<", b"\x00\x00": ">"}


@dataclass(frozen=True)
class DiagnosticStatus:
    """One entry of a DiagnosticArray.

    Attributes:
        level: 0 ok, 1 warning, 2 error, 3 stale.
        name: what it is about.
        message: one sentence.
        hardware_id: the device, or empty.
        values: pairs of key and value.
    """

    level: int
    name: str
    message: str
    hardware_id: str = ""
    values: tuple[tuple[str, str], ...] = ()


def encode_diagnostics(stamp_ns: int, statuses: Sequence[DiagnosticStatus], frame_id: str = "") -> bytes:
    """Return one DiagnosticArray.

    Args:
        stamp_ns: time of the header [ns].
        statuses: its entries.
        frame_id: of the header.

    Raises:
        DataError: the stamp does not fit a ROS time.
    """
    seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
    if not -(2**31) <= seconds < 2**31:
        raise DataError(f"the stamp {stamp_ns} ns does not fit a ROS time; give a time within 68 years of 1970")
    message = bytearray(b"\x00\x01\x00\x00" + struct.pack("<iI", seconds, nanoseconds))
    append_string(message, frame_id)
    append_uint32(message, len(statuses))
    for status in statuses:
        message.append(status.level)
        for text in (status.name, status.message, status.hardware_id):
            append_string(message, text)
        append_uint32(message, len(status.values))
        for key, value in status.values:
            append_string(message, key)
            append_string(message, value)
    return bytes(message)


def decode_diagnostics(message: Buffer) -> tuple[int, tuple[DiagnosticStatus, ...]]:
    """Decode one DiagnosticArray.

    Args:
        message: the whole message with its encapsulation.

    Returns:
        Stamp [ns] and the entries.

    Raises:
        DataError: the bytes are no DiagnosticArray; nothing else is ever raised.
    """
    data = bytes(message)
    order = _ORDERS.get(data[:2])
    if order is None or len(data) < 16:
        raise DataError(f"a DiagnosticArray of {len(data)} bytes does not start like one; it was not used")
    seconds, nanoseconds = struct.unpack_from(order + "iI", data, 4)
    cursor = _Cursor(data, order)
    cursor.text()
    statuses = []
    for _ in range(cursor.count(17)):
        level = cursor.byte()
        name, about, hardware = cursor.text(), cursor.text(), cursor.text()
        pairs = [(cursor.text(), cursor.text()) for _ in range(cursor.count(8))]
        statuses.append(DiagnosticStatus(level, name, about, hardware, tuple(pairs)))
    return seconds * 1_000_000_000 + nanoseconds, tuple(statuses)


class _Cursor:
    """A place in a message behind the stamp; reading beyond the end is a DataError."""

    def __init__(self, data: bytes, order: str) -> None:
        self.data = data
        self.at = 12
        self.uint32 = struct.Struct(order + "I").unpack_from

    def byte(self) -> int:
        """Read one byte."""
        self.at += 1
        if self.at > len(self.data):
            raise self._cut_off()
        return self.data[self.at - 1]

    def count(self, item_size: int) -> int:
        """Read the length of an array or string whose items need ``item_size`` bytes at least."""
        start = aligned(self.at, 4)
        self.at = start + 4
        if self.at > len(self.data):
            raise self._cut_off()
        count = int(self.uint32(self.data, start)[0])
        if count * item_size > len(self.data) - self.at:
            raise self._cut_off()
        return count

    def text(self) -> str:
        """Read a string."""
        length = self.count(1)
        self.at += length
        return self.data[self.at - length : self.at].rstrip(b"\0").decode("utf-8", "replace")

    def _cut_off(self) -> DataError:
        return DataError(f"a DiagnosticArray of {len(self.data)} bytes is cut off; it was not used")
