"""One step of a GMS element: closed form, with the stick-slip event inside the step, and exact derivatives.

The mode is the element's memory: 0 sticks, +1 and -1 slip in that direction until the velocity reverses.
"""

from __future__ import annotations

import math

from sgms_observer.jit import njit_bare

STICKS, SLIPS = range(2)  # branches of a step, for ``gms_step_in_branch``


@njit_bare
def gms_decay(period: float, stribeck: float, rate: float) -> float:
    """Return the share of an element's distance from its limit that a step of slip leaves [-].

    Args: as ``gms_step_with_slopes``.
    """
    return math.exp(-rate * period / stribeck)


@njit_bare
def gms_step_with_decay(
    force: float,
    mode: int,
    velocity: float,
    period: float,
    stiffness: float,
    fraction: float,
    stribeck: float,
    rate: float,
    decay: float,
) -> tuple[float, int, float, float, float]:
    """Advance one element's force and mode by one step, with a decay that all elements share.

    Args: as ``gms_step_with_slopes``, but
        decay: ``gms_decay`` of the step, or a negative number to compute it only where the element slips [-].

    Returns:
        As ``gms_step_with_slopes``.
    """
    if velocity == 0.0:
        return force, mode, 1.0, 0.0, 0.0
    direction = 1 if velocity > 0.0 else -1
    steady = direction * fraction * stribeck
    if mode != direction:
        stuck = force + stiffness * velocity * period
        if direction * (stuck - steady) < 0.0:
            return stuck, 0, 1.0, velocity * period, 0.0
        if direction * (force - steady) <= 0.0:
            return steady, direction, 0.0, 0.0, direction * fraction
    if decay < 0.0:
        decay = gms_decay(period, stribeck, rate)
    distance = force - steady
    slope = direction * fraction * (1.0 - decay) + distance * decay * rate * period / (stribeck * stribeck)
    return steady + distance * decay, direction, decay, 0.0, slope


@njit_bare
def gms_step_with_slopes(
    force: float,
    mode: int,
    velocity: float,
    period: float,
    stiffness: float,
    fraction: float,
    stribeck: float,
    rate: float,
) -> tuple[float, int, float, float, float]:
    """Advance one element's force and mode by one step of constant velocity.

    Args:
        force: element force kappa z before the step [N].
        mode: 0 while the element sticks, else the direction in which it slips.
        velocity: velocity over the step [m/s].
        period: step h [s].
        stiffness: kappa [N/m].
        fraction: nu [-].
        stribeck: s(v) [N].
        rate: attraction parameter C [N/s].

    Returns:
        force after the step [N], mode after the step; derivatives of the force with respect to the force before
        [-], the stiffness [m] and s [-].

    Source: Boegli et al., eqs 1-2; an element that reaches its limit mid-step slips from there, on the limit.
    """
    return gms_step_with_decay(force, mode, velocity, period, stiffness, fraction, stribeck, rate, -1.0)


@njit_bare
def gms_branch(force: float, mode: int, velocity: float, fraction: float, stribeck: float) -> int:
    """Decide a step's branch from what holds where it begins: the element's state, its mode, the velocity's sign.

    An element that reaches its limit within the step sticks to the step's end, beyond the limit.

    Args: as ``gms_step_with_slopes``.

    Returns:
        ``STICKS`` or ``SLIPS``.

    Source: Boegli et al., section III-D3, the conditions checked at each time instant.
    """
    if velocity == 0.0:
        return STICKS
    direction = 1 if velocity > 0.0 else -1
    return SLIPS if mode == direction or direction * force >= fraction * stribeck else STICKS


@njit_bare
def gms_step_in_branch(
    force: float,
    branch: int,
    velocity: float,
    period: float,
    stiffness: float,
    fraction: float,
    stribeck: float,
    rate: float,
) -> tuple[float, int, float, float, float]:
    """Advance one element's force by one step with a branch that was decided before, independent of the present force.

    Args: as ``gms_step_with_slopes``, but
        branch: ``STICKS`` or ``SLIPS``.

    Returns:
        As ``gms_step_with_slopes``.

    Source: Boegli et al., section III-D3: the modes are no variables of the MHE, a-priori rules set them.
    """
    if branch == STICKS:
        return force + stiffness * velocity * period, 0, 1.0, velocity * period, 0.0
    direction = 1 if velocity > 0.0 else -1
    return gms_step_with_slopes(force, direction, velocity, period, stiffness, fraction, stribeck, rate)


@njit_bare
def gms_step(
    force: float,
    mode: int,
    velocity: float,
    period: float,
    stiffness: float,
    fraction: float,
    stribeck: float,
    rate: float,
) -> tuple[float, int]:
    """Advance one element's force and mode by one step; see ``gms_step_with_slopes``.

    Args: as ``gms_step_with_slopes``.

    Returns:
        force after the step [N], mode after the step.
    """
    after, next_mode, _by_force, _by_stiffness, _by_level = gms_step_with_slopes(
        force, mode, velocity, period, stiffness, fraction, stribeck, rate
    )
    return after, next_mode


@njit_bare
def gms_rate(
    force: float, mode: int, velocity: float, stiffness: float, fraction: float, stribeck: float, rate: float
) -> tuple[float, float, float]:
    """Deflection rate dz/dt of eqs 1-2 with its derivatives.

    Args: as ``gms_step_with_slopes``.

    Returns:
        dz/dt [m/s]; its derivatives with respect to the force [m/(s N)] and s [m/(s N)].
    """
    direction = 1.0 if velocity > 0.0 else -1.0
    if mode * direction <= 0.0:
        return velocity, 0.0, 0.0
    speed = fraction * rate / stiffness
    level = fraction * stribeck
    return speed * (direction - force / level), -speed / level, speed * force / (level * stribeck)
