"""Motions of a commissioning, inside its limits, relative to the position of the axis at its beginning."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.errors import ConfigurationError
from sgms_observer.excitation.limits import ExcitationLimits, Track
from sim_plant.reference_file import write_reference_file

REST = 0.3
"""Rest at both ends of a motion [s]."""
SETTLING_SHARE = 0.01
"""Travel from rest after which a recording begins, as a share of the stroke: many presliding distances."""
SIGN_SPEED_SHARE, SIGN_STROKE_SHARE = 0.1, 0.1
"""Speed and width of the motion that checks the signs, as shares of the limits: small enough to be harmless."""
OWN_SPEED_SHARE, OWN_ACCELERATION_SHARE, OWN_STROKE_SHARE = 0.5, 0.1, 0.8
"""Speed, acceleration and width of the representative motion, as shares of the limits."""
PRESLIDING_MULTIPLE = 10.0
"""Length of a slow traverse over the presliding distance: most of it slides."""


@dataclass(frozen=True)
class Motion:
    """A reference that starts and ends at rest.

    Attributes:
        period: time between two samples [s].
        position: of each sample, relative to the position at the beginning of the commissioning [m], shape (n,).
    """

    period: float
    position: Floats

    @property
    def velocity(self) -> Floats:
        """Return the velocity of each sample [m/s], shape (n,)."""
        if len(self.position) < 2:
            return np.zeros(len(self.position))
        return np.asarray(np.gradient(self.position, self.period))

    @property
    def duration(self) -> float:
        """Return its duration [s]."""
        return self.period * max(0, len(self.position) - 1)

    @property
    def peak_speed(self) -> float:
        """Return the largest speed [m/s]."""
        return float(np.max(np.abs(self.velocity), initial=0.0))

    @property
    def peak_acceleration(self) -> float:
        """Return the largest acceleration [m/s^2]."""
        if len(self.position) < 3:
            return 0.0
        return float(np.max(np.abs(np.diff(self.position, 2)))) / self.period**2

    def sliding_from(self, way: float) -> int:
        """Return the first sample that is further than ``way`` from the start [m]; 0 if none is.

        The friction at the start is unknown. A recording begins where it has no influence any more.
        """
        return int(np.argmax(np.abs(self.position - self.position[0]) > way))

    def after(self, other: Motion) -> Motion:
        """Return another motion, which ends where this one starts, followed by this one."""
        return Motion(self.period, np.concatenate([other.position, self.position[1:]]))

    def write(self, path: Path) -> None:
        """Write it as CSV, as ``sgms excite`` does, relative to the middle of the stroke."""
        time = np.asarray(self.period * np.arange(len(self.position)), np.float64)
        write_reference_file(path, time, self.position, self.velocity)


class _Path(Track):
    """A track from the position of the axis on, of moves, cycles and rests."""

    def __init__(self, period: float, limits: ExcitationLimits, start: float = 0.0) -> None:
        super().__init__(period, limits, -math.inf, math.inf, start)
        self._start = start

    def rest(self, seconds: float = REST) -> None:
        """Add a rest."""
        self.dwell(seconds)

    def built(self) -> Motion:
        """Return the motion."""
        way = np.concatenate([np.zeros(1), np.cumsum(self.motion())])
        return Motion(self.period, self._start + self.period * way)


def approach(start: float, target: float, limits: ExcitationLimits, period: float) -> Motion:
    """Return a slow move from the position of the axis to the start of a motion, with a short forward slide at its end.

    So every motion starts with the friction in the same state, and a compensation that was just switched on has
    settled.

    Args:
        start: position of the axis [m].
        target: start of the motion [m].
        limits: what the machine may do.
        period: time between two samples [s].
    """
    path = _Path(period, limits, start)
    path.rest()
    speed, acceleration = OWN_SPEED_SHARE * limits.speed, OWN_ACCELERATION_SHARE * limits.acceleration
    slide = 2.0 * SETTLING_SHARE * limits.stroke
    path.move(target - math.copysign(slide, target), speed, acceleration)
    path.rest()
    path.move(target, speed, acceleration)
    path.rest()
    return path.built()


def longest_approach(limits: ExcitationLimits, period: float) -> float:
    """Return the duration of the longest approach, over the whole stroke [s].

    Args:
        limits: what the axis may do.
        period: time between two samples [s].
    """
    return approach(-0.5 * limits.stroke, 0.5 * limits.stroke, limits, period).duration


def sign_motion(limits: ExcitationLimits, period: float) -> Motion:
    """Return the small motion that checks the signs of position and effort.

    Args:
        limits: what the machine may do.
        period: time between two samples [s].
    """
    path = _Path(period, limits)
    width, speed = SIGN_STROKE_SHARE * limits.stroke, SIGN_SPEED_SHARE * limits.speed
    path.rest()
    for target in (0.5 * width, -0.5 * width, 0.0):
        path.move(target, speed, OWN_ACCELERATION_SHARE * limits.acceleration)
        path.rest()
    return path.built()


def learning_motion(
    limits: ExcitationLimits, period: float, presliding: float, stribeck_velocity: float, seconds: float
) -> Motion:
    """Return the motion for identification and diagnosis.

    Half of its time are traverses of the whole stroke at several speeds, twice in each direction, for effects of
    position and direction. The rest are reversals in and around the presliding distance, creep, and moves at the
    acceleration limit.

    Args:
        limits: what the machine may do.
        period: time between two samples [s].
        presliding: distance in which the friction builds up after a reversal [m].
        stribeck_velocity: velocity at which static friction has fallen towards Coulomb friction [m/s].
        seconds: approximate duration [s].
    """
    path = _Path(period, limits)
    half = 0.5 * OWN_STROKE_SHARE * limits.stroke
    gentle = OWN_ACCELERATION_SHARE * limits.acceleration
    presliding = min(presliding, 0.1 * half)
    path.rest()
    path.move(5.0 * SETTLING_SHARE * limits.stroke, 0.1 * limits.speed, gentle)
    for amplitude in np.geomspace(3.0 * presliding, 0.05 * presliding, 5):
        path.cycles(float(amplitude), 2, 4.0)
    creep = 0.05 * seconds
    for speed in np.geomspace(max(0.1 * stribeck_velocity, presliding / creep), 0.1 * limits.speed, 4):
        traverse = min(PRESLIDING_MULTIPLE * presliding, float(speed) * creep)
        path.move(path.at + traverse, float(speed), gentle)
        path.move(path.at - traverse, float(speed), gentle)
    longest = min(half, 0.5 * math.pi * limits.speed**2 / limits.acceleration)
    for share in (1.0, 0.5, 0.2):
        path.move(share * longest, limits.speed, limits.acceleration)
        path.move(-share * longest, limits.speed, limits.acceleration)
    path.rest()
    slowest = 2.0 * 4.0 * half / max(0.6 * (seconds - path.period * path.samples), 1.0e-3)
    for speed in np.geomspace(min(slowest, limits.speed), limits.speed, 4):
        for target in (half, -half) if speed < 0.5 * limits.speed else (half, -half, half, -half):
            path.move(target, float(speed), limits.acceleration)
    path.move(0.0, OWN_SPEED_SHARE * limits.speed, gentle)
    path.rest()
    return path.built()


def representative_motion(limits: ExcitationLimits, period: float) -> Motion:
    """Return the representative motion: moves over most of the stroke, a slow one, short steps.

    Its acceleration is a tenth of the limit, because a friction compensation cancels friction and not inertia.

    Args:
        limits: what the machine may do.
        period: time between two samples [s].
    """
    path = _Path(period, limits)
    half = 0.5 * OWN_STROKE_SHARE * limits.stroke
    fast, gentle = OWN_SPEED_SHARE * limits.speed, OWN_ACCELERATION_SHARE * limits.acceleration
    path.rest()
    for target in (half, -half):
        path.move(target, fast, gentle)
        path.rest()
    path.move(-0.5 * half, 0.2 * fast, gentle)
    for step in range(1, 4):
        path.move((-0.5 + 0.25 * step) * half, fast, gentle)
        path.rest()
    path.move(0.0, 0.2 * fast, gentle)
    path.rest()
    return path.built()


def checked(motion: Motion, limits: ExcitationLimits, start: float, source: str) -> Motion:
    """Return a motion after a check of its limits.

    Args:
        motion: the motion.
        limits: what the machine may do.
        start: middle of the stroke [m]; the motion is relative to it.
        source: its source, for the sentence.

    Raises:
        ConfigurationError: it exceeds a limit.
    """
    units = limits.units
    found = (
        ("goes as far as", float(np.max(np.abs(motion.position), initial=0.0)), 0.5 * limits.stroke, "m", "--stroke"),
        ("moves at up to", motion.peak_speed, limits.speed, "m/s", "--speed"),
        ("accelerates by up to", motion.peak_acceleration, limits.acceleration, "m/s^2", "--acceleration"),
    )
    sentences = [
        f"{source} {words} {units.readable(value, unit)}, more than the {units.readable(limit, unit)} that are allowed"
        f" around {units.readable(start)}; give a larger {option} if the machine may do that, or another motion"
        for words, value, limit, unit, option in found
        if value > 1.01 * limit
    ]
    if sentences:
        raise ConfigurationError(sentences)
    return motion


def motion_from_rows(time: Floats, position: Floats, period: float) -> Motion:
    """Return a motion on an even grid of times.

    Args:
        time: increasing [s], shape (m,).
        position: relative to the middle of the stroke [m], shape (m,).
        period: time between two samples [s].
    """
    even = np.arange(time[0], time[-1] + 0.5 * period, period)
    rest = max(1, round(REST / period))
    inside = np.interp(even, time, position)
    return Motion(period, np.concatenate([np.full(rest, inside[0]), inside, np.full(rest, inside[-1])]))


def read_motion(path: Path, rows: tuple[Floats, Floats], start: float, period: float) -> Motion:
    """Return the user's own motion, read from a file, relative to the middle of the stroke.

    Args:
        path: the file, for the sentence.
        rows: its times [s] and positions [m].
        start: middle of the stroke [m].
        period: time between two samples [s].

    Raises:
        ConfigurationError: it has no rows.
    """
    time, position = rows
    if len(time) < 2:
        raise ConfigurationError([f"{path} holds no motion: give a bag with the topic reference, or a CSV of excite"])
    return motion_from_rows(time, position - start, period)
