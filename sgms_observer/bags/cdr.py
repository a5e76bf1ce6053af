"""JointState as bytes (XCDR1, what ROS 2 sends and records), fast enough for a 10 kHz callback in plain Python.

The places of all numbers follow from the lengths in the message: a ``JointStateLayout`` holds them, so that one
``struct`` call reads a message. Padding is never compared: Fast DDS leaves uninitialised bytes between the fields, and
up to 16 behind the last one.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import Any

from sgms_observer.bags.cdr_bytes import (
    HEADER,
    Buffer,
    Cursor,
    aligned,
    append_string,
    append_uint32,
    begin_message,
    seconds_of,
)
from sgms_observer.errors import DataError

JointStateFields = tuple[int, tuple[str, ...], tuple[float, ...], tuple[float, ...], tuple[float, ...]]

_KEPT_LAYOUTS = 8


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


_SHARED = JointStateDecoder()


def decode_joint_state(message: Buffer) -> JointStateFields:
    """Decode one JointState; a topic with a decoder of its own is served a little faster.

    Args:
        message: the whole message with its encapsulation.

    Returns:
        Stamp [ns], names, position, velocity, effort, as ``JointStateDecoder.decode``.

    Raises:
        DataError: the bytes are no JointState; nothing else is ever raised.
    """
    return _SHARED.decode(message)


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
        self._pack_stamp(buffer, HEADER, *seconds_of(stamp_ns))
        try:
            for start, values in zip(self.starts, fields, strict=True):
                self._pack_field(buffer, start, *values)
        except (struct.error, ValueError):
            raise DataError(
                f"fields of {[len(values) for values in fields]} numbers do not fit {len(self.starts)} fields of"
                f" {self._count} axes; give each field one number per axis"
            ) from None
        return bytes(buffer)
