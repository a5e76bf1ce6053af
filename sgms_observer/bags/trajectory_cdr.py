"""JointTrajectory as bytes (XCDR1): whole horizons in one numpy copy, without ROS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from sgms_observer.arrays import Floats, Ints
from sgms_observer.bags.cdr import Buffer, Cursor, aligned, append_string, append_uint32, begin_message
from sgms_observer.errors import DataError

FIELDS = ("positions", "velocities", "accelerations", "effort")

_SMALLEST_POINT = 24  # bytes: four empty arrays and a duration
_SECOND = 1_000_000_000


@dataclass(frozen=True)
class Trajectory:
    """Points of several axes.

    Attributes:
        names: axes, k of them.
        time_ns: time of each point, the header's stamp included [ns], shape (n,).
        stamp_ns: the header's stamp [ns]; 0 where the sender left it out.
        values: ``positions``, ``velocities``, ``accelerations`` and ``effort`` [SI units], each of shape (n, k), or
            (n, 0) where not every point has one number per axis.
    """

    names: tuple[str, ...]
    time_ns: Ints
    stamp_ns: int
    values: Mapping[str, Floats]


def encode_trajectory(stamp_ns: int, names: Sequence[str], time_ns: Ints, values: Mapping[str, Floats]) -> bytes:
    """Return one JointTrajectory.

    Args:
        stamp_ns: time of the header [ns].
        names: axes, k of them.
        time_ns: time of each point [ns], not before the stamp, shape (n,).
        values: any of ``FIELDS`` [SI units], each of shape (n, k).

    Raises:
        DataError: a time does not fit a ROS time, or a shape does not fit.
    """
    count = len(time_ns)
    if any(field.shape != (count, len(names)) for field in values.values()):
        shapes = [field.shape for field in values.values()]
        raise DataError(f"fields of shapes {shapes} were given for {count} points of {len(names)} axes")
    message = begin_message(stamp_ns)
    append_uint32(message, len(names))
    for name in names:
        append_string(message, name)
    append_uint32(message, count)
    widths = tuple(len(names) if field in values else 0 for field in FIELDS)
    since = np.asarray(time_ns - stamp_ns, dtype=np.int64)
    first = 0
    for rows in (min(1, count), count - min(1, count)):  # the first point may be padded in another way
        points = np.zeros(rows, _point_type("<", len(message) % 8, widths))
        chosen = slice(first, first + rows)
        points["sec"], points["nanosec"] = np.divmod(since[chosen], _SECOND)
        for field, width in zip(FIELDS, widths, strict=True):
            if width:
                points[f"{field}_length"] = width
                points[field] = values[field][chosen]
        message.extend(points.tobytes())
        first += rows
    return bytes(message)


def decode_trajectory(message: Buffer) -> Trajectory:
    """Decode one JointTrajectory.

    Args:
        message: the whole message with its encapsulation.

    Raises:
        DataError: the bytes are no JointTrajectory; nothing else is ever raised.
    """
    data = bytes(message)
    cursor = Cursor(data, "JointTrajectory")
    cursor.text()
    names = tuple(cursor.text() for _ in range(cursor.length(5)))
    count = cursor.length(_SMALLEST_POINT)
    time_ns = np.empty(count, np.int64)
    values: dict[str, Floats] = {field: np.empty((count, len(names))) for field in FIELDS}
    row = 0
    while row < count:
        begin = cursor.at
        widths = _widths(cursor)
        alike = 1 if row == 0 else count - row
        points = _points(data, cursor.order, begin, widths, alike)
        cursor.at = begin
        cursor.skip(points.nbytes)
        rows = slice(row, row + len(points))
        time_ns[rows] = cursor.stamp_ns + points["sec"].astype(np.int64) * _SECOND + points["nanosec"]
        for field, width in zip(FIELDS, widths, strict=True):
            if width == values[field].shape[1] and width:
                values[field][rows] = points[field]
            else:
                values[field] = np.empty((count, 0))
        row += len(points)
    return Trajectory(names, time_ns, cursor.stamp_ns, values)


def _points(data: bytes, order: str, begin: int, widths: tuple[int, ...], count: int) -> NDArray[np.void]:
    """Return the points from ``begin`` on that have the layout of the first; at least that one."""
    kind = _point_type(order, begin % 8, widths)
    count = max(1, min(count, (len(data) - begin) // kind.itemsize))
    room = data if begin + kind.itemsize <= len(data) else data + bytes(kind.itemsize)
    points = np.frombuffer(room, kind, count, begin)
    for field, width in zip(FIELDS, widths, strict=True):
        other = np.flatnonzero(points[f"{field}_length"] != width)
        if other.size:
            points = points[: max(1, int(other[0]))]
    return points


@lru_cache(maxsize=64)
def _point_type(order: str, begin: int, widths: tuple[int, ...]) -> np.dtype[np.void]:
    """Return where the parts of a point are that begins at this byte of the message, or at one 8 bytes from it."""
    names, formats, offsets = [], [], []
    at = begin
    for field, width in zip(FIELDS, widths, strict=True):
        at = aligned(at, 4)
        names.append(f"{field}_length")
        formats.append(order + "u4")
        offsets.append(at - begin)
        at += 4
        if width:
            at = aligned(at, 8)
            names.append(field)
            formats.append(f"({width},){order}f8")
            offsets.append(at - begin)
            at += 8 * width
    for name, kind in (("sec", "i4"), ("nanosec", "u4")):
        at = aligned(at, 4)
        names.append(name)
        formats.append(order + kind)
        offsets.append(at - begin)
        at += 4
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": at - begin})


def _widths(cursor: Cursor) -> tuple[int, ...]:
    """Return how many numbers each array of the point has that begins here."""
    found = []
    for _ in FIELDS:
        width = cursor.length(8)
        found.append(width)
        cursor.at = aligned(cursor.at, 8) + 8 * width if width else cursor.at
    return tuple(found)
