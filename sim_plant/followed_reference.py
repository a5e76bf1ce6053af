"""The set-points of ``stage.reference.kind: topic``: they come while the stage runs, and it rests until one comes."""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

COAST = 0.02
"""How long the stage goes on at the velocity of the last set-point when the next one is overdue [s]; then it stops."""

LONGEST_STEP = 0.25
"""Set-points further apart than this are steps, not points of one motion [s]."""

FOREIGN_CLOCK = 10.0
"""A stamp that differs from the stage's time by more than this is another clock's: it counts from its arrival [s]."""

_MOST = 100_000


class FollowedReference:
    """A motion through set-points that are taken in one by one.

    A set-point is reached at its stamp, as a drive does that interpolates; a late one is followed from its arrival on.
    Between two set-points the motion is cubic, with the slopes of their neighbours. All times that come in are stamps;
    ``anchor`` says which of them the stage's own time is.
    """

    def __init__(self) -> None:
        self._points: deque[tuple[int, float, float]] = deque(maxlen=_MOST)
        self._held = 0.0
        self._anchor_ns = 0
        self._anchor_time = 0.0
        self._lock = threading.Lock()  # set-points come in one thread, the stage steps in another

    def anchor(self, stamp_ns: int, time: float) -> None:
        """Say which stamp belongs to which time of the stage.

        Args:
            stamp_ns: a stamp [ns].
            time: the stage's time of it [s].
        """
        self._anchor_ns, self._anchor_time = stamp_ns, time

    def put(self, stamp_ns: int, position: float, velocity: float, now_ns: int) -> None:
        """Take in a set-point.

        Args:
            stamp_ns: when it is to be reached [ns].
            position: where [m]; ignored unless finite.
            velocity: how fast [m/s]; NaN if unknown.
            now_ns: the stage's clock [ns].
        """
        if not math.isfinite(position):
            return
        if abs(stamp_ns - now_ns) > FOREIGN_CLOCK * 1e9:
            stamp_ns = now_ns
        with self._lock:
            while self._points and self._points[-1][0] >= stamp_ns:
                self._points.pop()  # another sender, or one that started anew
            self._points.append((stamp_ns, position, velocity))

    def at(self, time: Floats) -> tuple[Floats, Floats, Floats]:
        """Evaluate the motion; see ``sim_plant.reference.Reference.at``. Times must not go back.

        A turn of the stage asks for a handful of times: plain numbers are several times faster here than arrays.
        """
        times: list[float] = time.tolist()
        points = self._around(times[0], times[-1])
        rows: list[tuple[float, float, float]] = []
        i = -1
        piece = _Piece(0.0, self._held, 0.0, 0.0, 0.0, 0.0)
        for now in times:
            while i + 1 < len(points) and points[i + 1][0] <= now:
                i += 1
                piece = _piece(points, i)
            rows.append(piece.at(now))
        if rows:
            self._held = rows[-1][0]
        position, velocity, acceleration = np.array(rows).reshape(-1, 3).T
        return position, velocity, acceleration

    def _around(self, first: float, last: float) -> list[tuple[float, float, float]]:
        """Return the set-points around a span of time: time [s], position [m], velocity [m/s].

        One set-point before those that count and two behind them are among them where there are so many.
        """
        start = self._anchor_ns + (first - self._anchor_time) * 1e9
        end = self._anchor_ns + (last - self._anchor_time) * 1e9
        chosen = []
        with self._lock:
            while len(self._points) > 2 and self._points[2][0] <= start:
                self._points.popleft()
            behind = 0
            for stamp, position, velocity in self._points:
                chosen.append((self._anchor_time + (stamp - self._anchor_ns) * 1e-9, position, velocity))
                behind += stamp > end
                if behind == 2:
                    break
        return chosen


class _Piece(NamedTuple):
    """A cubic from one set-point on: it starts at ``start`` and holds until ``end`` later, then the axis rests."""

    start: float
    position: float
    velocity: float
    square: float
    cube: float
    end: float

    def at(self, now: float) -> tuple[float, float, float]:
        """Return position, velocity and acceleration at a time."""
        since = now - self.start
        if since >= self.end:
            since = self.end
            return self.position + since * (self.velocity + since * (self.square + since * self.cube)), 0.0, 0.0
        return (
            self.position + since * (self.velocity + since * (self.square + since * self.cube)),
            self.velocity + since * (2.0 * self.square + 3.0 * since * self.cube),
            2.0 * self.square + 6.0 * since * self.cube,
        )


def _piece(points: Sequence[tuple[float, float, float]], i: int) -> _Piece:
    """Return the motion from set-point ``i`` on."""
    start, position, _ = points[i]
    slope = _slope(points, i)
    if i + 1 == len(points):
        return _Piece(start, position, slope, 0.0, 0.0, COAST if slope != 0.0 else 0.0)
    span = points[i + 1][0] - start
    if span > LONGEST_STEP:
        return _Piece(start, position, 0.0, 0.0, 0.0, 0.0)
    rise = (points[i + 1][1] - position) / span
    next_slope = _slope(points, i + 1)
    square = (3.0 * rise - 2.0 * slope - next_slope) / span
    return _Piece(start, position, slope, square, (slope + next_slope - 2.0 * rise) / span**2, math.inf)


def _slope(points: Sequence[tuple[float, float, float]], i: int) -> float:
    """Return the velocity at a set-point [m/s]: that of its neighbours; at the last one its own, if it is known."""
    if i + 1 == len(points):
        if math.isfinite(points[i][2]):
            return points[i][2]
        after = i
    else:
        after = i + 1
    before = max(i - 1, 0)
    if before == after:
        return 0.0
    if any(points[k + 1][0] - points[k][0] > LONGEST_STEP for k in range(before, after)):
        return 0.0
    return (points[after][1] - points[before][1]) / (points[after][0] - points[before][0])
