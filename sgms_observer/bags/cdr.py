"""JointState as bytes (XCDR1, what ROS 2 sends and records), fast enough for a 10 kHz callback in plain Python.

The places of all numbers follow from the lengths in the message: a ``JointStateLayout`` holds them, so that one
``struct`` call reads a message. Padding is never compared: Fast DDS leaves uninitialised bytes between the fields, and
up to 16 after the last one.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import Any

from sgms_observer.errors import DataError

Buffer = bytes | bytearray | memoryview

HEADER = 4
"""Bytes of encapsulation; alignment counts from their end."""
_ENCODINGS = {b"\x00\x01": "<", b"\x00\x00": ">"}
_SECOND = 1_000_000_000
_SEC_LIMIT = 2**31

JointStateFields = tuple[int, tuple[str, ...], tuple[float, ...], tuple[float, ...], tuple[float, ...]]

_KEPT_LAYOUTS = 8


def aligned(offset: int, size: int) -> int:
    """Return the first multiple of ``size`` at or after ``offset``, counted as in XCDR1.

    Args:
        offset: place in the message [bytes], encapsulation included.
        size: alignment [bytes].
    """
    return offset + (HEADER - offset) % size


class Cursor:
    """A place in a message, at first after the stamp; reading beyond the end raises DataError and no other error.

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


def _seconds_of(stamp_ns: int) -> tuple[int, int]:
    """Return seconds and nanoseconds of a stamp, as ROS counts them; DataError where it does not fit a ROS time."""
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
    message = bytearray(b"\x00\x01\x00\x00" + struct.pack("<iI", *_seconds_of(stamp_ns)))
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


@dataclass(frozen=True)
class JointStateLayout:
    """Where the numbers of one kind of JointState are.

    Attributes:
        encoding: the two bytes that name the encoding.
        names: entries of ``name``.
        counts: lengths of position, velocity and effort.
        offsets: first byte of each of the three arrays [bytes].
        size: bytes up to the last field's end; a message may be longer.
        constant: spans of bytes that are the same in every message of this layout.
        unpack: reads a message into a flat tuple.
        select: picks the constants from that tuple.
        key: the values that ``select`` must give.
        slices: where stamp, position, velocity and effort are in the flat tuple.
    """

    encoding: bytes
    names: tuple[str, ...]
    counts: tuple[int, int, int]
    offsets: tuple[int, int, int]
    size: int
    constant: tuple[tuple[int, int], ...]
    unpack: Callable[[Buffer], tuple[Any, ...]]
    select: Callable[[tuple[Any, ...]], tuple[Any, ...]]
    key: tuple[Any, ...]
    slices: tuple[slice, slice, slice]

    @classmethod
    def of(cls, message: Buffer) -> JointStateLayout:
        """Work out the layout of one message.

        Args:
            message: the whole message with its encapsulation.

        Raises:
            DataError: the bytes are no JointState.
        """
        scan = Cursor(message, "JointState")
        frame_length = scan.length(1)
        frame = f"I{frame_length}s"
        scan.skip(frame_length)
        parts, constant_items = ["2s2xiI", frame], [0, 3]
        item = 5
        constant = [(0, 2), (12, 16)]
        parts.append(f"{scan.pad(4)}x")
        constant.append((scan.at, scan.at + 4))
        name_count = scan.length(5)
        parts.append("I")
        constant_items.append(item)
        item += 1
        names = []
        for _ in range(name_count):
            parts.append(f"{scan.pad(4)}x")
            start = scan.at
            names.append(scan.text())
            parts.append(f"I{scan.at - start - 4}s")
            constant.append((start, scan.at))
            constant_items += [item, item + 1]
            item += 2
        counts, offsets, slices = [], [], []
        for _ in ("position", "velocity", "effort"):
            parts.append(f"{scan.pad(4)}x")
            constant.append((scan.at, scan.at + 4))
            count = scan.length(8)
            parts.append("I")
            constant_items.append(item)
            item += 1
            if count:
                parts.append(f"{scan.pad(8)}x")
                scan.skip(0)
            counts.append(count)
            offsets.append(scan.at)
            slices.append(slice(item, item + count))
            parts.append(f"{count}d")
            item += count
            scan.skip(8 * count)
        unpack = struct.Struct(scan.order + "".join(parts)).unpack_from
        select = itemgetter(*constant_items)
        return cls(
            bytes(message[:2]),
            tuple(names),
            (counts[0], counts[1], counts[2]),
            (offsets[0], offsets[1], offsets[2]),
            scan.at,
            tuple(constant),
            unpack,
            select,
            select(unpack(message)),
            (slices[0], slices[1], slices[2]),
        )


class JointStateDecoder:
    """Decodes the messages of one topic; the layouts of the latest kinds of message are remembered."""

    def __init__(self) -> None:
        self._layouts: list[JointStateLayout] = []

    def decode(self, message: Buffer) -> JointStateFields:
        """Decode one message.

        Args:
            message: the whole message with its encapsulation, as rclpy hands it over with ``raw=True``.

        Returns:
            Stamp [ns], names, position, velocity, effort; a field that the sender left empty is ``()``.

        Raises:
            DataError: the bytes are no JointState; nothing else is ever raised.
        """
        size = len(message)
        for layout in self._layouts:
            if layout.size <= size:
                values = layout.unpack(message)
                if layout.select(values) == layout.key:
                    position, velocity, effort = layout.slices
                    stamp_ns = values[1] * 1_000_000_000 + values[2]
                    return stamp_ns, layout.names, values[position], values[velocity], values[effort]
        self._layouts.insert(0, JointStateLayout.of(message))
        del self._layouts[_KEPT_LAYOUTS:]
        return self.decode(message)


class JointStateEncoder:
    """Writes messages of one layout: everything but the numbers is written once.

    Args:
        names: entries of ``name``.
        fields: which of ``position``, ``velocity``, ``effort`` the messages carry; the others stay empty.
        frame_id: of the header.

    Attributes:
        template: a message with all numbers zero.
        starts: first byte of the array of each chosen field [bytes].
    """

    def __init__(self, names: Sequence[str], fields: Sequence[str], frame_id: str = "") -> None:
        template = begin_message(0, frame_id)
        append_uint32(template, len(names))
        for name in names:
            append_string(template, name)
        starts = []
        for field in ("position", "velocity", "effort"):
            count = len(names) if field in fields else 0
            append_uint32(template, count)
            if count:
                template.extend(bytes(aligned(len(template), 8) - len(template)))
            if field in fields:
                starts.append(len(template))
            template.extend(bytes(8 * count))
        self.template = bytes(template)
        self.starts = tuple(starts)
        self._buffer = template
        self._count = len(names)
        self._pack_stamp = struct.Struct("<iI").pack_into
        self._pack_field = struct.Struct(f"<{len(names)}d").pack_into

    def encode(self, stamp_ns: int, *fields: Sequence[float]) -> bytes:
        """Return one message.

        Args:
            stamp_ns: sample time [ns].
            fields: one sequence, as long as the names, for each field chosen at the start, in the order
                position, velocity, effort.

        Raises:
            DataError: the stamp does not fit a ROS time, or a field does not fit the names.
        """
        buffer = self._buffer
        self._pack_stamp(buffer, HEADER, *_seconds_of(stamp_ns))
        try:
            for start, values in zip(self.starts, fields, strict=True):
                self._pack_field(buffer, start, *values)
        except (struct.error, ValueError):
            raise DataError(
                f"fields of {[len(values) for values in fields]} numbers do not fit {len(self.starts)} fields of"
                f" {self._count} axes; give each field one number per axis"
            ) from None
        return bytes(buffer)


def effort_template(names: Sequence[str]) -> tuple[Callable[..., bytes], bytes, bytes]:
    """Return ``pack``, ``head`` and ``middle``: a message is ``pack(head, seconds, nanoseconds, middle, *efforts)``.

    Args:
        names: entries of ``name``, as many as there are efforts.

    Returns:
        ``pack``, and the bytes before and after the stamp.
    """
    encoder = JointStateEncoder(names, ("effort",))
    head, middle = encoder.template[:HEADER], encoder.template[HEADER + 8 : encoder.starts[0]]
    return struct.Struct(f"<{len(head)}siI{len(middle)}s{len(names)}d").pack, head, middle
