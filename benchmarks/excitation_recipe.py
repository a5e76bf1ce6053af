"""The fixed recipe that ``sgms excite`` followed before it designed by information: the baseline of its benchmark.

Four kinds of motion, each for the parameters only it can show: nested reversals from far below the presliding distance
upwards (stiffness distribution), slow traverses at log-spaced speeds (Stribeck curve), fast ones (viscous friction),
and moves at the acceleration limit (mass). Dwells in between show offset and noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sgms_observer.excitation.limits import ExcitationLimits
from sgms_observer.settings.axis import AxisSettings

Floats = NDArray[np.float64]

_REVERSALS = 10  # amplitudes of the nested reversals
_CYCLES = 3  # of each amplitude
_REVERSAL_FREQUENCY = 4.0  # Hz
_SMALL_FREQUENCY = 2.0  # Hz, for reversals below the presliding distance
_SPEEDS = 10  # traverses, log-spaced
_SLOWEST_SHARE = 0.01  # slowest traverse over the Stribeck velocity
_SLOWEST_TIME = 3.0  # longest traverse in one direction [s]
_FAST_MOVES = 6
_DWELL = 0.25  # s


@dataclass(frozen=True)
class Section:
    """One part of the recipe.

    Attributes:
        name: what the axis does.
        start: when it begins [s].
        end: when it ends [s].
        shows: which parameters it is for.
    """

    name: str
    start: float
    end: float
    shows: str


@dataclass(frozen=True)
class Recipe:
    """A reference around position 0.

    Attributes:
        time: [s], shape (n,).
        position: [m], shape (n,).
        velocity: [m/s], shape (n,).
        sections: what each stretch of it is for.
    """

    time: Floats
    position: Floats
    velocity: Floats
    sections: tuple[Section, ...]


@dataclass
class _Track:
    """A reference under construction."""

    period: float
    limits: ExcitationLimits
    velocity: list[Floats] = field(default_factory=list)
    sections: list[Section] = field(default_factory=list)
    samples: int = 0
    at: float = 0.0

    def add(self, velocity: Floats) -> None:
        self.velocity.append(velocity)
        self.samples += len(velocity)
        self.at += float(np.sum(velocity)) * self.period

    def dwell(self, seconds: float) -> None:
        self.add(np.zeros(max(1, round(seconds / self.period))))

    def move(self, target: float, speed: float, acceleration: float) -> None:
        """Go to ``target`` with raised-cosine ramps; rounding to samples only ever slows the move."""
        distance = target - self.at
        if distance == 0.0:
            return
        top = min(speed, math.sqrt(2.0 * acceleration * abs(distance) / math.pi))
        ramp = max(2, math.ceil(math.pi * top / (2.0 * acceleration) / self.period))
        flat = max(0, math.ceil(abs(distance) / (top * self.period)) - ramp)
        up = 0.5 * (1.0 - np.cos(np.pi * (np.arange(ramp) + 0.5) / ramp))
        shape = np.concatenate([up, np.ones(flat), up[::-1]])
        self.add(shape * (distance / (float(np.sum(shape)) * self.period)))

    def cycles(self, amplitude: float, count: int, frequency: float) -> None:
        """Swing down by 2 ``amplitude`` and back, ``count`` times, starting and ending at rest at the top."""
        fastest = min(
            frequency,
            self.limits.speed / (2.0 * math.pi * amplitude),
            math.sqrt(self.limits.acceleration / amplitude) / (2.0 * math.pi),
        )
        n = math.ceil(1.0 / (fastest * self.period))
        edge = amplitude * np.cos(2.0 * np.pi * np.arange(n + 1) / n)
        self.add(np.tile(np.diff(edge) / self.period, count))

    def close(self, name: str, start: int, shows: str) -> None:
        self.sections.append(Section(name, start * self.period, self.samples * self.period, shows))


def build_recipe(axis: AxisSettings, limits: ExcitationLimits, period: float) -> Recipe:
    """Build the recipe for one axis.

    Args:
        axis: the start settings: only the order of magnitude of presliding distance and Stribeck velocity is used.
        limits: what the table may do.
        period: time between two samples of the reference [s].

    Returns:
        The reference, inside the limits.
    """
    friction = axis.friction
    fractions = np.array(friction.element_fraction)
    deflection = fractions * friction.static_force / np.array(friction.element_stiffness)
    presliding = min(2.0 * float(np.max(deflection)), 0.1 * limits.stroke)
    half = 0.5 * limits.stroke
    track = _Track(period, limits)
    track.dwell(2.0 * _DWELL)
    _reversals(track, presliding, half)
    _traverses(track, presliding, half, friction.stribeck_velocity)
    _fast(track, half)
    velocity = np.concatenate([np.zeros(1), *track.velocity])
    position = np.cumsum(velocity) * period
    return Recipe(np.asarray(period * np.arange(len(velocity))), position, velocity, tuple(track.sections))


def _reversals(track: _Track, presliding: float, half: float) -> None:
    """Add nested reversals, after sliding far enough that every element is at its limit."""
    start = track.samples
    largest = min(3.0 * presliding, 0.4 * half)
    slow = min(track.limits.speed, 50.0 * presliding)
    for _ in range(2):
        track.move(min(10.0 * presliding, 0.9 * half), slow, track.limits.acceleration)
        track.dwell(_DWELL)
        for amplitude in np.geomspace(largest, track.limits.smallest, _REVERSALS):
            frequency = _REVERSAL_FREQUENCY if 2.0 * amplitude > presliding else _SMALL_FREQUENCY
            track.cycles(float(amplitude), _CYCLES, frequency)
        track.dwell(_DWELL)
        track.move(-min(10.0 * presliding, 0.9 * half), slow, track.limits.acceleration)
        track.dwell(_DWELL)
    track.close("nested reversals", start, "element_stiffness, element_fraction")


def _traverses(track: _Track, presliding: float, half: float, stribeck_velocity: float) -> None:
    """Add traverses forth and back from creep to full speed."""
    start = track.samples
    slowest = max(_SLOWEST_SHARE * stribeck_velocity, 4.0 * presliding / _SLOWEST_TIME)
    slowest = min(slowest, 0.1 * track.limits.speed)
    for speed in np.geomspace(slowest, track.limits.speed, _SPEEDS):
        ramps = 0.5 * math.pi * float(speed) ** 2 / track.limits.acceleration
        reach = min(max(4.0 * presliding, 0.3 * float(speed) + ramps), 2.0 * half)
        for side in (0.5, -0.5):
            track.move(side * reach, float(speed), track.limits.acceleration)
            track.dwell(0.4 * _DWELL)
    shows = "coulomb_force, static_force, stribeck_velocity, viscous_coefficient"
    track.close("traverses at log-spaced speeds", start, shows)


def _fast(track: _Track, half: float) -> None:
    """Add moves at the acceleration limit, of several lengths."""
    start = track.samples
    longest = min(half, 0.5 * math.pi * track.limits.speed**2 / track.limits.acceleration)
    for share in np.geomspace(1.0, 0.1, _FAST_MOVES):
        for side in (1.0, -1.0):
            track.move(side * 0.5 * share * longest, track.limits.speed, track.limits.acceleration)
    track.move(0.0, track.limits.speed, track.limits.acceleration)
    track.dwell(2.0 * _DWELL)
    track.close("moves at the acceleration limit", start, "mass, delay, offset")
