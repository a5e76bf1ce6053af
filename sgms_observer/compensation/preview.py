"""Compiled steps of the element forces along a motion that is meant to happen.

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
def preview_elements(
    forces: Floats,
    modes: Integers,
    velocity: float,
    acceleration: float,
    look_ahead: float,
    factor: float,
    scalars: Floats,
    elements: Floats,
) -> float:
    """Move the elements through the next ``look_ahead`` seconds at constant acceleration, in place.

    A reversal inside the look-ahead is made in two legs.

    Args:
        forces: element forces [N], changed in place.
        modes: slip direction of GMS elements, changed in place.
        velocity: velocity now [m/s].
        acceleration: acceleration over the look-ahead [m/s^2].
        look_ahead: time to bridge [s].
        factor: the effects' factor on the Stribeck level [-].
        scalars: model scalars.
        elements: rows kappa, nu, sigma.

    Returns:
        Velocity at the end [m/s].
    """
    ahead = velocity + acceleration * look_ahead
    if velocity * ahead < 0.0:
        turn = -velocity / acceleration
        rest = look_ahead - turn
        advance_elements(forces, modes, 0.5 * velocity * turn, 0.5 * abs(velocity), factor, scalars, elements)
        advance_elements(forces, modes, 0.5 * ahead * rest, abs(ahead), factor, scalars, elements)
    else:
        travel = 0.5 * (velocity + ahead) * look_ahead
        advance_elements(forces, modes, travel, abs(ahead), factor, scalars, elements)
    return ahead
