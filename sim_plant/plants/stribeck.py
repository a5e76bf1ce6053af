"""The sliding force over speed that four of the contact laws share."""

from __future__ import annotations

import math

from sgms_observer.arrays import Floats
from sgms_observer.jit import njit

COULOMB, STATIC, KNEE, POWER = 0, 1, 2, 3
"""Columns of a sliding curve: force at high speed [N], force at low speed [N], speed of the fall [m/s], its power."""


@njit
def sliding_force(velocity: float, curve: Floats) -> float:
    """Return the force of steady sliding without the viscous part [N].

    Args:
        velocity: sliding velocity [m/s]; the curve is even in it.
        curve: columns named above.

    Source: Stribeck's curve in the form of Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7), eq. 7.
    """
    fall = math.exp(-((abs(velocity) / curve[KNEE]) ** curve[POWER]))
    return float(curve[COULOMB] + (curve[STATIC] - curve[COULOMB]) * fall)


@njit
def relaxed(value: float, drive: float, rate: float, step: float) -> float:
    """Return ``value`` after ``step`` [s] of value' = drive - rate * value with constant drive and rate, exactly.

    Args:
        value: state now, in the unit of the state.
        drive: its inflow, in the unit of the state per second.
        rate: its decay [1/s], not negative.
        step: duration [s].
    """
    x = rate * step
    mean = 1.0 - 0.5 * x if x < 1.0e-6 else -math.expm1(-x) / x
    return value + (drive - rate * value) * step * mean
