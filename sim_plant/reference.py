"""References of the simulated stage as functions of time."""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.axis import ReferenceSettings
from sim_plant.reference_file import PiecewiseCubic, back_and_forth, read_reference_file

COAST = 0.02
"""Time for which the stage keeps the velocity of the last set-point when the next one is late [s]; then it stops."""

MAX_SET_POINT_INTERVAL = 0.25
"""Set-points further apart than this are steps, not points of one motion [s]."""

FOREIGN_CLOCK = 10.0
"""A stamp that differs from the stage's time by more than this is of another clock; the arrival time is used [s]."""

_MOST = 100_000


class FollowedReference:
    """A motion through set-points that arrive one by one.

    A set-point is reached at its stamp, as by a drive that interpolates; a late one is followed from its arrival on.
    Between two set-points the motion is cubic, with the slopes of their neighbours. All inputs have stamps; ``anchor``
    relates them to the stage's time.
    """

    def __init__(self) -> None:
        self._points: deque[tuple[int, float, float]] = deque(maxlen=_MOST)
        self._held = 0.0
        self._anchor_ns = 0
        self._anchor_time = 0.0
        self._lock = threading.Lock()  # set-points arrive in one thread, the stage steps in another

    def anchor(self, stamp_ns: int, time: float) -> None:
        """Relate a stamp to the time of the stage.

        Args:
            stamp_ns: a stamp [ns].
            time: of the stage at this stamp [s].
        """
        self._anchor_ns, self._anchor_time = stamp_ns, time

    def put(self, stamp_ns: int, position: float, velocity: float, now_ns: int) -> None:
        """Add a set-point.

        Args:
            stamp_ns: time at which it is to be reached [ns].
            position: its position [m]; ignored unless finite.
            velocity: its velocity [m/s]; NaN if unknown.
            now_ns: the stage's clock [ns].
        """
        if not math.isfinite(position):
            return
        if abs(stamp_ns - now_ns) > FOREIGN_CLOCK * 1e9:
            stamp_ns = now_ns
        with self._lock:
            while self._points and self._points[-1][0] >= stamp_ns:
                self._points.pop()  # another publisher, or one that was restarted
            self._points.append((stamp_ns, position, velocity))

    def at(self, time: Floats) -> tuple[Floats, Floats, Floats]:
        """Evaluate the motion; see ``sim_plant.reference.Reference.at``. Times must not go back.

        A step of the stage needs a few times only, for which plain numbers are several times faster than arrays.
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

        One set-point before the span and two after it are included where they exist.
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
    if span > MAX_SET_POINT_INTERVAL:
        return _Piece(start, position, 0.0, 0.0, 0.0, 0.0)
    rise = (points[i + 1][1] - position) / span
    next_slope = _slope(points, i + 1)
    square = (3.0 * rise - 2.0 * slope - next_slope) / span
    return _Piece(start, position, slope, square, (slope + next_slope - 2.0 * rise) / span**2, math.inf)


def _slope(points: Sequence[tuple[float, float, float]], i: int) -> float:
    """Return the velocity at a set-point [m/s]: the slope of its neighbours; at the last one its own, if known."""
    if i + 1 == len(points):
        if math.isfinite(points[i][2]):
            return points[i][2]
        after = i
    else:
        after = i + 1
    before = max(i - 1, 0)
    if before == after:
        return 0.0
    if any(points[k + 1][0] - points[k][0] > MAX_SET_POINT_INTERVAL for k in range(before, after)):
        return 0.0
    return (points[after][1] - points[before][1]) / (points[after][0] - points[before][0])


class Reference(Protocol):
    """A motion as a function of time."""

    def at(self, time: Floats) -> tuple[Floats, Floats, Floats]:
        """Evaluate the motion.

        Args:
            time: times [s], from 0 on, shape (n,).

        Returns:
            Position [m], velocity [m/s] and acceleration [m/s^2], each of shape (n,).
        """
        ...


@dataclass(frozen=True)
class Sines:
    """A sum of sines, starting at position sum(amplitude sin(phase)).

    Attributes:
        amplitudes: amplitude of each sine [m], shape (n,).
        frequencies: frequency of each sine [Hz], shape (n,).
        phases: phase of each sine at time 0 [rad], shape (n,).
    """

    amplitudes: Floats
    frequencies: Floats
    phases: Floats

    def at(self, time: Floats) -> tuple[Floats, Floats, Floats]:
        """Evaluate the motion; see ``Reference.at``."""
        position, velocity, acceleration = np.zeros_like(time), np.zeros_like(time), np.zeros_like(time)
        for amplitude, frequency, phase in zip(self.amplitudes, self.frequencies, self.phases, strict=True):
            rate = 2.0 * np.pi * frequency
            sine = amplitude * np.sin(rate * time + phase)
            position += sine
            velocity += rate * amplitude * np.cos(rate * time + phase)
            acceleration -= rate * rate * sine
        return position, velocity, acceleration


def make_reference(settings: ReferenceSettings, name: str = "x") -> Reference:
    """Build the reference of one axis.

    Args:
        settings: the axis's ``stage.reference``.
        name: the axis, for error sentences.

    Returns:
        The motion.

    Raises:
        ConfigurationError: if a multi_sine's lists do not match, a stroke is zero, or a file cannot be used.
    """
    if settings.kind == "sine":
        return Sines(np.array([settings.amplitude]), np.array([settings.frequency]), np.zeros(1))
    if settings.kind == "topic":
        return FollowedReference()
    if settings.kind == "multi_sine":
        return _multi_sine(settings, name)
    if settings.kind == "point_to_point":
        return _point_to_point(settings, name)
    return _from_file(settings, name)


def _multi_sine(settings: ReferenceSettings, name: str) -> Sines:
    counts = {len(settings.amplitudes), len(settings.frequencies), len(settings.phases or settings.frequencies)}
    if len(counts) != 1 or 0 in counts:
        raise ConfigurationError(
            [
                f"{name}.stage.reference of kind multi_sine has {len(settings.amplitudes)} amplitudes,"
                f" {len(settings.frequencies)} frequencies and {len(settings.phases)} phases; give one of each per"
                " sine, or no phases"
            ]
        )
    phases = np.array(settings.phases or [0.0] * len(settings.frequencies))
    return Sines(np.array(settings.amplitudes), np.array(settings.frequencies), phases)


def _point_to_point(settings: ReferenceSettings, name: str) -> PiecewiseCubic:
    if settings.amplitude == 0.0:
        raise ConfigurationError(
            [f"{name}.stage.reference.amplitude = 0 gives a point_to_point motion no stroke; set it to the stroke"]
        )
    return back_and_forth(settings.amplitude, settings.velocity, settings.acceleration, settings.jerk, settings.dwell)


def _from_file(settings: ReferenceSettings, name: str) -> PiecewiseCubic:
    if not settings.file:
        raise ConfigurationError(
            [f"{name}.stage.reference.file is empty; name a CSV with the columns time [s] and position [m; rad]"]
        )
    return read_reference_file(
        Path(settings.file),
        settings.interpolation,
        velocity=settings.velocity,
        acceleration=settings.acceleration,
        jerk=settings.jerk,
    )
