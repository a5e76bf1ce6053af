"""A reference under construction: rests, moves and sines with smooth ramps, each within the limits by construction."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sgms_observer.excitation.limits import ExcitationLimits

Floats = NDArray[np.float64]

_NOTHING = 1.0e-6  # of the smallest reversal: rounding, not a way to go


class TooLongError(Exception):
    """A track would have more samples than it may have."""


@dataclass
class Track:
    """A reference under construction.

    Attributes:
        period: time between two samples [s].
        limits: what the table may do.
        low, high: ends of the window that the motion stays in [m].
        at: position reached [m].
        most: samples that it may have at most; None for any number.
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
            seconds: how long [s].
        """
        count = max(1, round(seconds / self.period))
        self._check(count)
        self.append(np.zeros(count))

    def move(self, target: float, speed: float, acceleration: float | None = None) -> None:
        """Go to a position with raised-cosine ramps; rounding to samples only ever slows the move.

        Args:
            target: where to; the nearest position of the window is taken [m].
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
        """Swing down by twice the amplitude and back, starting and ending at rest at the top.

        Args:
            amplitude: of the cosine; as much as the window leaves below is taken [m].
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
