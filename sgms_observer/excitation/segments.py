"""The motion segments that a reference is made of; each begins and ends at rest at the same place.

Every segment returns to home from below, so that the contact is loaded the same way before every segment, and the
information of a segment does not depend on the order.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.excitation.limits import ExcitationLimits, TooLongError, Track
from sgms_observer.settings.axis import AxisSettings

HOME_SHARE = 0.25
"""Distance of home from the ends of the window, as a share of the stroke: sines of that amplitude fit below it."""
_SPEEDS = 9  # traverses, log-spaced
_SLOWEST_SHARE = 0.01  # slowest traverse over the Stribeck velocity
_SLOWEST_TIME = 3.0  # s, in which the slowest traverse passes the contact's own deflection
_TRAVERSE_TIME = 0.3  # s at constant speed of the shortest traverse
_AMPLITUDES = 12  # reversals, log-spaced
_REVERSAL_FREQUENCIES = (0.5, 2.0, 8.0)  # Hz
_REVERSAL_TIME = 1.5  # s of reversals of one size
_CYCLES = 3
_SINES = (0.5, 1.5, 5.0, 15.0)  # Hz
_SINE_SPEEDS = (3.0, 30.0)  # of the Stribeck velocity, beside the limit
_SWEEP = (2.0, 40.0)  # Hz
_DWELLS = (0.3, 1.0, 3.0)  # s
_STOPS = 8
_REST = 0.1  # s at the end of each segment
_APPROACH = 10.0  # presliding distances travelled upwards before home
_LONGEST_SHARE = 0.5  # of the whole time: a longer segment leaves no room for others


@dataclass(frozen=True)
class Segment:
    """One kind of motion.

    Attributes:
        kind: name of the kind; segments of one kind differ in size and speed only.
        name: with its size and speed.
        move: adds it to a track that rests at home.
    """

    kind: str
    name: str
    move: Callable[[Track], None]


@dataclass(frozen=True)
class Place:
    """Where the motion is.

    Attributes:
        low, high: ends of the window [m].
        home: start and end of segments [m].
        presliding: distance over which the contact of the file builds up its force [m].
        stribeck_velocity: of the file [m/s].
    """

    low: float
    high: float
    home: float
    presliding: float
    stribeck_velocity: float

    @staticmethod
    def of(axis: AxisSettings, limits: ExcitationLimits, start: float, centre: float) -> Place:
        """Return the place of an axis.

        Args:
            axis: settings; only orders of magnitude of its friction count.
            limits: what the table may do.
            start: where the table stands [m].
            centre: middle of the window [m].
        """
        friction = axis.friction
        deflection = np.array(friction.element_fraction) * friction.static_force / np.array(friction.element_stiffness)
        half, inner = 0.5 * limits.stroke, (0.5 - HOME_SHARE) * limits.stroke
        return Place(
            centre - half,
            centre + half,
            min(max(start, centre - inner), centre + inner),
            max(min(2.0 * float(np.max(deflection)), 0.02 * limits.stroke), limits.smallest),
            friction.stribeck_velocity,
        )

    @property
    def approach(self) -> float:
        """Travel of a segment upwards to home [m]."""
        return min(_APPROACH * self.presliding, 0.9 * (self.home - self.low))


def library(place: Place, limits: ExcitationLimits, period: float, seconds: float) -> list[tuple[Segment, Floats]]:
    """Return the segments that fit into the time, with their velocities at home.

    Args:
        place: where the motion is.
        limits: what the table may do.
        period: time between two samples [s].
        seconds: time of the whole reference [s].
    """
    out = []
    most = int(_LONGEST_SHARE * seconds / period)
    for segment in _segments(place, limits):
        with contextlib.suppress(TooLongError):
            out.append((segment, velocity_of(segment, place, limits, period, most)))
    return out


def velocity_of(
    segment: Segment, place: Place, limits: ExcitationLimits, period: float, most: int | None = None
) -> Floats:
    """Return the velocity of each sample of a segment, the rest at its end included [m/s].

    Args:
        segment: the segment.
        place: where the motion is.
        limits: what the table may do.
        period: time between two samples [s].
        most: largest number of samples; None for any number.

    Raises:
        TooLongError: if it has more.
    """
    track = Track(period, limits, place.low, place.high, place.home, most)
    segment.move(track)
    track.move(place.home, limits.speed)
    track.dwell(_REST)
    return track.motion()


def _segments(place: Place, limits: ExcitationLimits) -> list[Segment]:
    """Return all segments of any length."""
    return [
        Segment("approach", "down and up again", lambda track: _down(track, place)),
        *_traverses(place, limits),
        *_reversals(place, limits),
        *_fast(place, limits),
        *_sines(place, limits),
        *_dwells(place),
        *_stops(place, limits),
    ]


def _down(track: Track, place: Place) -> None:
    """Move below home, so that the move back loads the contact upwards."""
    track.move(place.home - place.approach, math.inf)


def _traverses(place: Place, limits: ExcitationLimits) -> list[Segment]:
    """Return traverses forth and back at constant speed, over the stroke and over parts of it around home."""
    presliding, stroke = place.presliding, place.high - place.low
    slowest = max(_SLOWEST_SHARE * place.stribeck_velocity, 2.0 * presliding / _SLOWEST_TIME)
    slowest = min(slowest, 0.1 * limits.speed)
    out = []
    for speed in np.geomspace(slowest, limits.speed, _SPEEDS).tolist():
        shortest = max(4.0 * presliding, _TRAVERSE_TIME * speed + 0.5 * math.pi * speed**2 / limits.acceleration)
        for length in _apart([stroke, 0.2 * stroke, min(shortest, stroke)]):
            low = min(max(place.home - 0.5 * length, place.low), place.high - length)

            def move(track: Track, low: float = low, high: float = low + length, speed: float = speed) -> None:
                track.move(low, math.inf)
                track.move(high, speed)
                track.move(low, speed)
                if low > place.home - place.approach:
                    _down(track, place)

            readable = limits.units.readable
            name = f"{readable(length)} forth and back at {readable(speed, 'm/s')}"
            out.append(Segment("traverses at constant speed", name, move))
    return out


def _apart(sizes: list[float]) -> list[float]:
    """Return sizes without those that nearly repeat a larger one."""
    out: list[float] = []
    for size in sizes:
        if all(size < other / 1.5 for other in out):
            out.append(size)
    return out


def _reversals(place: Place, limits: ExcitationLimits) -> list[Segment]:
    """Return reversals that begin and end at home, each of one size, and a series of nested ones."""
    largest = min(3.0 * place.presliding, 0.5 * (place.home - place.low))
    sizes = np.geomspace(largest, limits.smallest, _AMPLITUDES).tolist()
    out = []
    for frequency in _REVERSAL_FREQUENCIES:
        count = max(1, round(_REVERSAL_TIME * frequency))
        for size in sizes:

            def swing(track: Track, size: float = size, count: int = count, frequency: float = frequency) -> None:
                track.cycles(size, count, frequency)

            name = f"{count} of {limits.units.readable(2.0 * size)} at {frequency:g} Hz"
            out.append(Segment("reversals", name, swing))

        def nested(track: Track, count: int = max(1, count // 3), frequency: float = frequency) -> None:
            for size in sizes:
                track.cycles(size, count, frequency)

        name = f"from {limits.units.readable(2.0 * largest)} down to {limits.units.readable(2.0 * limits.smallest)}"
        out.append(Segment("nested reversals", f"{name} at {frequency:g} Hz", nested))
    return out


def _fast(place: Place, limits: ExcitationLimits) -> list[Segment]:
    """Return moves at the acceleration limit and at a third of it, of several lengths."""
    stroke = place.high - place.low
    out = []
    for share in (1.0, 1.0 / 3.0):
        top = limits.speed**2 / (share * limits.acceleration)
        for length in _apart([min(stroke, 3.0 * top), min(0.3 * stroke, top), min(0.1 * stroke, 0.3 * top)]):
            low = min(max(place.home - 0.5 * length, place.low), place.high - length)

            def move(track: Track, low: float = low, length: float = length, share: float = share) -> None:
                acceleration = share * limits.acceleration
                for target in (low, low + length, low, low + length, low):
                    track.move(target, math.inf, acceleration)
                if low > place.home - place.approach:
                    _down(track, place)

            readable = limits.units.readable
            name = f"{readable(length)} at {readable(share * limits.acceleration, 'm/s^2')}"
            out.append(Segment("moves at high acceleration", name, move))
    return out


def _sines(place: Place, limits: ExcitationLimits) -> list[Segment]:
    """Return sines that slide, of several speeds and frequencies, and a sweep."""
    out = []
    room = 0.5 * (place.home - place.low)
    speeds = [limits.speed, *(share * place.stribeck_velocity for share in _SINE_SPEEDS)]
    for speed in _apart(sorted((min(one, limits.speed) for one in speeds), reverse=True)):
        for frequency in _SINES:
            size = min(
                speed / (2.0 * math.pi * frequency), room, limits.acceleration / (2.0 * math.pi * frequency) ** 2
            )
            if size < 3.0 * place.presliding:
                continue
            count = max(_CYCLES, round(frequency))

            def swing(track: Track, size: float = size, count: int = count, frequency: float = frequency) -> None:
                track.cycles(size, count, frequency)

            name = f"{count} of {limits.units.readable(2.0 * size)} at {frequency:g} Hz"
            out.append(Segment("sines", name, swing))

    def sweep(track: Track) -> None:
        for frequency in np.geomspace(*_SWEEP, 7).tolist():
            rate = 2.0 * math.pi * frequency
            track.cycles(min(limits.speed / rate, limits.acceleration / rate**2, room), 2, frequency)

    out.append(Segment("sweep", f"from {_SWEEP[0]:g} to {_SWEEP[1]:g} Hz", sweep))
    return out


def _dwells(place: Place) -> list[Segment]:
    """Return rests, each followed by a slow break-away in either direction."""
    out = []
    for seconds in _DWELLS:

        def rest(track: Track, seconds: float = seconds) -> None:
            track.dwell(seconds)
            slow = 30.0 * place.presliding
            track.move(place.home - place.approach, slow)
            track.dwell(seconds)
            track.move(place.home, slow)

        out.append(Segment("rests and break-aways", f"{seconds:g} s at rest", rest))
    return out


def _stops(place: Place, limits: ExcitationLimits) -> list[Segment]:
    """Return traverses of the stroke in steps with rests between them."""

    def move(track: Track) -> None:
        track.move(place.low, math.inf)
        places = np.linspace(place.low, place.high, _STOPS + 1).tolist()
        for target in (*places[1:], *places[-2::-1]):
            track.move(target, 0.3 * limits.speed)
            track.dwell(_REST)

    return [Segment("stop and go", f"{_STOPS} stops each way over the stroke", move)]
