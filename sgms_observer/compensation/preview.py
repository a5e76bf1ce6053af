"""Compiled steps of the element forces along a future motion.

The model lies in the estimators' flat arrays (``estimators/layout.py``): ``scalars`` and the rows of ``elements``.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from sgms_observer.estimators.layout import (
    ATTRACTION,
    COULOMB,
    GAMMA,
    GMS,
    KAPPA,
    LAMBDA,
    MODEL,
    NU,
    PAPER_RESET,
    RESET,
    STATIC,
    STRIBECK,
    ZETA,
    Floats,
    Integers,
)
from sgms_observer.formulas.friction import stribeck_level
from sgms_observer.friction.gms import gms_step
from sgms_observer.friction.sgms import sgms_step
from sgms_observer.jit import njit

_SLOWEST = 1.0e-12  # speed at which a motion counts as at rest on the Stribeck curve [m/s]

_stribeck_level: Callable[..., float] = njit(stribeck_level)


@njit
def advance_elements(
    forces: Floats, modes: Integers, displacement: float, speed: float, factor: float, scalars: Floats, elements: Floats
) -> None:
    """Move every element along ``displacement``, in place.

    Args:
        forces: element forces [N], changed in place.
        modes: slip direction of GMS elements, changed in place; unused by S-GMS.
        displacement: signed travel of the step [m].
        speed: speed at which the Stribeck curve is read and the travel is made [m/s].
        factor: the effects' factor on the Stribeck level [-].
        scalars: model scalars.
        elements: rows kappa, nu, sigma.
    """
    if displacement == 0.0 or not math.isfinite(displacement):
        return
    rate = max(speed, _SLOWEST)
    level = factor * _stribeck_level(rate, scalars[STATIC], scalars[COULOMB], scalars[STRIBECK])
    velocity = math.copysign(rate, displacement)
    period = displacement / velocity
    gain = scalars[GAMMA]
    if scalars[RESET] == PAPER_RESET:
        gain *= rate / scalars[STRIBECK]
    for i in range(len(forces)):
        kappa, nu = elements[KAPPA, i], elements[NU, i]
        if scalars[MODEL] == GMS:
            after, mode = gms_step(forces[i], modes[i], velocity, period, kappa, nu, level, scalars[ATTRACTION])
            forces[i] = after
            modes[i] = mode
        else:
            forces[i] = sgms_step(forces[i], velocity, period, kappa, nu * level, scalars[LAMBDA], scalars[ZETA], gain)


@njit
def velocity_after(velocity: float, acceleration: float, jerk: float, time: float) -> float:
    """Return the velocity [m/s] after ``time`` [s] at constant jerk."""
    return velocity + (acceleration + 0.5 * jerk * time) * time


@njit
def travel_after(velocity: float, acceleration: float, jerk: float, time: float) -> float:
    """Return the travel [m] after ``time`` [s] at constant jerk."""
    return (velocity + (0.5 * acceleration + jerk * time / 6.0) * time) * time


@njit
def turning_times(velocity: float, acceleration: float, jerk: float, end: float) -> tuple[float, float]:
    """Return when the velocity passes through zero before ``end`` [s], in order; ``end`` where it does not.

    Args:
        velocity: velocity now [m/s].
        acceleration: acceleration now [m/s^2].
        jerk: constant jerk [m/s^3].
        end: the times after it do not count [s].
    """
    discriminant = acceleration * acceleration - 2.0 * jerk * velocity
    if not discriminant > 0.0:
        return end, end
    # q avoids the cancellation of -a +- sqrt(a^2 - 2 j v); the roots are q / (j / 2) and v / q
    q = -0.5 * (acceleration + math.copysign(math.sqrt(discriminant), acceleration))
    first = velocity / q if q != 0.0 else end
    second = 2.0 * q / jerk if jerk != 0.0 else end
    if not 0.0 < first < end:
        first = end
    if not 0.0 < second < end:
        second = end
    return min(first, second), max(first, second)


@njit
def preview_elements(
    forces: Floats,
    modes: Integers,
    velocity: float,
    acceleration: float,
    jerk: float,
    look_ahead: float,
    factor: float,
    scalars: Floats,
    elements: Floats,
) -> float:
    """Move the elements through the next ``look_ahead`` seconds at constant jerk, in place.

    The travel between two reversals is one step.

    Args:
        forces: element forces [N], changed in place.
        modes: slip direction of GMS elements, changed in place.
        velocity: velocity now [m/s].
        acceleration: acceleration now [m/s^2].
        jerk: jerk over the look-ahead [m/s^3].
        look_ahead: time to bridge [s].
        factor: the effects' factor on the Stribeck level [-].
        scalars: model scalars.
        elements: rows kappa, nu, sigma.

    Returns:
        Velocity at the end [m/s].
    """
    first, second = turning_times(velocity, acceleration, jerk, look_ahead)
    begin, behind = 0.0, 0.0
    if first < look_ahead:
        travel = travel_after(velocity, acceleration, jerk, first)
        advance_elements(forces, modes, travel, abs(travel) / first, factor, scalars, elements)
        begin, behind = first, travel
        if second < look_ahead:
            travel = travel_after(velocity, acceleration, jerk, second)
            speed = abs(travel - behind) / (second - begin)
            advance_elements(forces, modes, travel - behind, speed, factor, scalars, elements)
            behind = travel
    ahead = velocity_after(velocity, acceleration, jerk, look_ahead)
    travel = travel_after(velocity, acceleration, jerk, look_ahead)
    advance_elements(forces, modes, travel - behind, abs(ahead), factor, scalars, elements)
    return ahead
