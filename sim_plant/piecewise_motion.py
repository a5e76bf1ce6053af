"""Periodic motions made of cubic pieces, which reference files become, and jerk-limited moves from rest to rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_JERK_SIGNS = np.array([1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0])


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


def s_curve_durations(stroke: float, velocity: float, acceleration: float, jerk: float) -> Floats:
    """Return the lengths of the seven pieces of the fastest jerk-limited move.

    Args:
        stroke: distance, not negative [m].
        velocity: largest velocity [m/s].
        acceleration: largest acceleration [m/s^2].
        jerk: largest jerk [m/s^3].

    Returns:
        Durations [s] of jerk +, 0, -, 0, -, 0, +; shape (7,); pieces that a short move has no room for are 0.

    Source: the double-S profile; L. Biagiotti and C. Melchiorri, Trajectory Planning for Automatic Machines and
        Robots, Springer 2008, section 3.4, for equal limits in both directions and rest at both ends.
    """
    reaches_acceleration = velocity * jerk >= acceleration**2
    ramp = acceleration / jerk if reaches_acceleration else np.sqrt(velocity / jerk)
    rise = velocity / acceleration + ramp if reaches_acceleration else 2.0 * ramp
    cruise = stroke / velocity - rise
    if cruise < 0.0:
        cruise = 0.0
        if reaches_acceleration and stroke >= 2.0 * acceleration**3 / jerk**2:
            rise = ramp / 2.0 + np.sqrt((ramp / 2.0) ** 2 + stroke / acceleration)
        else:
            ramp = np.cbrt(stroke / (2.0 * jerk))
            rise = 2.0 * ramp
    hold = max(rise - 2.0 * ramp, 0.0)
    return np.array([ramp, hold, ramp, cruise, ramp, hold, ramp])


def s_curve(start: float, stroke: float, velocity: float, acceleration: float, jerk: float) -> tuple[Floats, Floats]:
    """Return a move from rest at ``start`` to rest at ``start + stroke``.

    Args:
        start: first position [m].
        stroke: signed distance [m].
        velocity: largest velocity [m/s].
        acceleration: largest acceleration [m/s^2].
        jerk: largest jerk [m/s^3].

    Returns:
        Durations of the pieces [s], shape (7,), and their coefficients as in ``PiecewiseCubic``, shape (7, 4).
    """
    durations = s_curve_durations(abs(stroke), velocity, acceleration, jerk)
    coefficients, _ = from_jerks(start, durations, np.copysign(jerk, stroke) * _JERK_SIGNS)
    return durations, coefficients


def back_and_forth(stroke: float, velocity: float, acceleration: float, jerk: float, dwell: float) -> PiecewiseCubic:
    """Return rest, a move by ``stroke``, rest, the move back, and so on.

    Args:
        stroke: signed distance [m].
        velocity: largest velocity [m/s].
        acceleration: largest acceleration [m/s^2].
        jerk: largest jerk [m/s^3].
        dwell: rest at each end [s].
    """
    durations, out = s_curve(0.0, stroke, velocity, acceleration, jerk)
    _, back = s_curve(stroke, -stroke, velocity, acceleration, jerk)
    rest = np.zeros((1, 4))
    rest_there = np.array([[stroke, 0.0, 0.0, 0.0]])
    lengths = np.concatenate([[dwell], durations, [dwell], durations])
    return join(lengths, np.concatenate([rest, out, rest_there, back]))


def join(durations: Floats, coefficients: Floats) -> PiecewiseCubic:
    """Chain pieces into a periodic motion, leaving out those without length.

    Args:
        durations: length of each piece [s], shape (n,).
        coefficients: as in ``PiecewiseCubic``, shape (n, 4).
    """
    kept = durations > 0.0
    knots = np.concatenate([[0.0], np.cumsum(durations[kept])])
    return PiecewiseCubic(knots, coefficients[kept])
