"""Event-driven generalised Maxwell-slip contact: the instant of slip and of reversal lies inside the step."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sgms_observer.jit import njit

Floats = NDArray[np.float64]


@njit
def sliding_curve(speed: float, low_speed_force: float, high_speed_force: float, knee: float) -> float:
    """Return the friction of steady sliding [N] at ``speed`` [m/s]: it falls with the square of speed over ``knee``."""
    return high_speed_force + (low_speed_force - high_speed_force) * math.exp(-((speed / knee) ** 2))


@njit
def carry(
    loads: Floats,
    is_slipping: NDArray[np.bool_],
    springs: Floats,
    shares: Floats,
    travel: float,
    duration: float,
    level: float,
    rate: float,
) -> float:
    """Move the contact by ``travel`` in one direction and return its force.

    Args:
        loads: force of each element [N]; changed in place.
        is_slipping: mode of each element; changed in place.
        springs: stiffness of each element [N/m].
        shares: share of the level each element carries.
        travel: signed displacement [m].
        duration: time it takes [s].
        level: sliding friction at this speed [N].
        rate: attraction of slipping elements to the level [N/s].

    Returns:
        Friction force, positive against positive motion [N].
    """
    if travel == 0.0:
        return float(loads.sum())
    side = 1.0 if travel > 0.0 else -1.0
    forget = math.exp(-rate * duration / level)
    total = 0.0
    for i in range(loads.shape[0]):
        target = side * shares[i] * level
        if is_slipping[i]:
            loads[i] = target + (loads[i] - target) * forget
        else:
            tried = loads[i] + springs[i] * travel
            if side * tried < side * target:
                loads[i] = tried
            else:
                used = side * (target - loads[i]) / (springs[i] * abs(travel))
                start = target
                if used < 0.0:  # the level fell below what the element carries
                    used = 0.0
                    start = loads[i]
                loads[i] = target + (start - target) * math.exp(-rate * duration * (1.0 - used) / level)
                is_slipping[i] = True
        total += loads[i]
    return total
