"""A periodic motion made of cubic pieces: what point-to-point moves and reference files become."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class PiecewiseCubic:
    """Position over time as cubic pieces that repeat after the last knot.

    Attributes:
        knots: start of each piece and, last, the end of the period [s], increasing from 0, shape (n + 1,).
        coefficients: position, velocity, acceleration and jerk at the start of each piece
            [m, m/s, m/s^2, m/s^3], shape (n, 4).
    """

    knots: Floats
    coefficients: Floats

    @property
    def period(self) -> float:
        """Return the time after which the motion repeats [s]."""
        return float(self.knots[-1])

    def at(self, time: Floats) -> tuple[Floats, Floats, Floats]:
        """Evaluate the motion.

        Args:
            time: times [s], from 0 on, shape (n,).

        Returns:
            Position [m], velocity [m/s] and acceleration [m/s^2], each of shape (n,).
        """
        phase = np.mod(time, self.period)
        piece = np.clip(np.searchsorted(self.knots, phase, side="right") - 1, 0, len(self.coefficients) - 1)
        since = phase - self.knots[piece]
        start, rate, curvature, jerk = self.coefficients[piece].T
        position = start + since * (rate + since * (curvature / 2.0 + since * jerk / 6.0))
        velocity = rate + since * (curvature + since * jerk / 2.0)
        return position, velocity, curvature + since * jerk


def from_jerks(start: float, durations: Floats, jerks: Floats) -> tuple[Floats, float]:
    """Integrate a sequence of constant jerks from rest.

    Args:
        start: first position [m].
        durations: length of each piece [s], shape (n,).
        jerks: jerk in each piece [m/s^3], shape (n,).

    Returns:
        Coefficients as in ``PiecewiseCubic``, shape (n, 4), and the last position [m].
    """
    rows = np.zeros((len(durations), 4))
    position, velocity, acceleration = start, 0.0, 0.0
    for i, (duration, jerk) in enumerate(zip(durations, jerks, strict=True)):
        rows[i] = position, velocity, acceleration, jerk
        position += duration * (velocity + duration * (acceleration / 2.0 + duration * jerk / 6.0))
        velocity += duration * (acceleration + duration * jerk / 2.0)
        acceleration += duration * jerk
    return rows, position
