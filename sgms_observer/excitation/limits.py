"""Limits of the table during an excitation, and a reference under construction within them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.units import PRISMATIC, REVOLUTE, Units

_NOTHING = 1.0e-6  # of the smallest reversal; a shorter travel is rounding


@dataclass(frozen=True)
class ExcitationLimits:
    """What the table may do.

    Attributes:
        stroke: full width of the motion [m].
        speed: largest speed [m/s].
        acceleration: largest acceleration [m/s^2].
        smallest: smallest reversal [m].
        units: of the axis; those above are a prismatic one's.
    """

    stroke: float
    speed: float
    acceleration: float
    smallest: float = 1.0e-7
    units: Units = field(default_factory=Units)

    def __post_init__(self) -> None:
        sentences = [
            f"{name} = {value:g} must be a positive number; give the table's own limit"
            for name, value in (
                ("stroke", self.stroke),
                ("speed", self.speed),
                ("acceleration", self.acceleration),
                ("smallest", self.smallest),
            )
            if not (math.isfinite(value) and value > 0.0)
        ]
        if not sentences and self.stroke < 20.0 * self.smallest:
            sentences.append(
                f"stroke = {self.units.readable(self.stroke)} leaves no room for reversals from"
                f" {self.units.readable(self.smallest)};"
                " allow 20 times as much"
            )
        if sentences:
            raise ConfigurationError(sentences)


#: What ``sgms excite`` asks of an axis whose limits nobody gave, by joint type: a cautious part of what a positioning
#: table (some centimetres, encoder in nanometres) and a robot joint (a turn, encoder of 20 bits) can do.
CAUTIOUS_LIMITS = {
    PRISMATIC: ExcitationLimits(0.02, 0.05, 1.0, 1.0e-7, Units(PRISMATIC)),
    REVOLUTE: ExcitationLimits(0.5, 0.5, 2.0, 1.0e-5, Units(REVOLUTE)),
}


def limits_of(
    joint_type: str,
    stroke: float | None = None,
    speed: float | None = None,
    acceleration: float | None = None,
    smallest: float | None = None,
) -> ExcitationLimits:
    """Return the given limits, and cautious ones for the rest.

    Args:
        joint_type: of the axis.
        stroke: full width of the motion [m].
        speed: largest speed [m/s].
        acceleration: largest acceleration [m/s^2].
        smallest: smallest reversal [m].

    Raises:
        ConfigurationError: one of them is not valid.
    """
    cautious = CAUTIOUS_LIMITS[joint_type]
    return ExcitationLimits(
        cautious.stroke if stroke is None else stroke,
        cautious.speed if speed is None else speed,
        cautious.acceleration if acceleration is None else acceleration,
        cautious.smallest if smallest is None else smallest,
        cautious.units,
    )


class TooLongError(Exception):
    """A track is longer than its largest number of samples."""


@dataclass
class Track:
    """A reference under construction.

    Attributes:
        period: time between two samples [s].
        limits: what the table may do.
        low, high: ends of the window of the motion [m].
        at: present position [m].
        most: largest number of samples; None for any number.
        velocity: velocity of each sample, piece by piece [m/s].
        samples: how many there are.
    """

    period: float
    limits: ExcitationLimits
    low: float
    high: float
    at: float
    most: int | None = None
    velocity: list[Floats] = field(default_factory=list)
    samples: int = 0

    def append(self, velocity: Floats) -> None:
        """Add samples.

        Args:
            velocity: of each sample [m/s].
        """
        self.velocity.append(velocity)
        self.samples += len(velocity)
        self.at += float(np.sum(velocity)) * self.period

    def dwell(self, seconds: float) -> None:
        """Rest.

        Args:
            seconds: duration [s].
        """
        count = max(1, round(seconds / self.period))
        self._check(count)
        self.append(np.zeros(count))

    def move(self, target: float, speed: float, acceleration: float | None = None) -> None:
        """Move to a position with raised-cosine ramps; rounding to samples makes the move slower, never faster.

        Args:
            target: end of the move, limited to the window [m].
            speed: largest speed; the limit is not exceeded [m/s].
            acceleration: largest acceleration [m/s^2]; None for the limit.
        """
        target = min(max(target, self.low), self.high)
        distance = target - self.at
        if abs(distance) < _NOTHING * self.limits.smallest:
            return
        largest = self.limits.acceleration if acceleration is None else min(acceleration, self.limits.acceleration)
        top = min(speed, self.limits.speed, math.sqrt(2.0 * largest * abs(distance) / math.pi))
        ramp = max(2, math.ceil(math.pi * top / (2.0 * largest) / self.period))
        flat = max(0, math.ceil(abs(distance) / (top * self.period)) - ramp)
        self._check(2 * ramp + flat)
        up = 0.5 * (1.0 - np.cos(np.pi * (np.arange(ramp) + 0.5) / ramp))
        shape = np.concatenate([up, np.ones(flat), up[::-1]])
        self.append(shape * (distance / (float(np.sum(shape)) * self.period)))

    def cycles(self, amplitude: float, count: int, frequency: float) -> None:
        """Add cycles down by twice the amplitude and back, with rest at the top at both ends.

        Args:
            amplitude: of the cosine, limited to the window [m].
            count: number of cycles.
            frequency: largest frequency; speed and acceleration limits lower it [Hz].
        """
        amplitude = min(amplitude, 0.5 * (self.at - self.low))
        fastest = min(
            frequency,
            self.limits.speed / (2.0 * math.pi * amplitude),
            math.sqrt(self.limits.acceleration / amplitude) / (2.0 * math.pi),
        )
        n = max(4, math.ceil(1.0 / (fastest * self.period)))
        self._check(n * count)
        edge = amplitude * np.cos(2.0 * np.pi * np.arange(n + 1) / n)
        self.append(np.tile(np.diff(edge) / self.period, count))

    def _check(self, count: int) -> None:
        """Raise if so many samples more are too many."""
        if self.most is not None and self.samples + count > self.most:
            raise TooLongError

    def motion(self) -> Floats:
        """Return the velocity of all samples [m/s]."""
        return np.concatenate([np.zeros(0), *self.velocity])
