"""How a table follows a reference: mass, contact and the controller of ``stage`` without integral action.

At a reversal the contact sticks, and the table moves by the share of the reference that the stiffness of controller
and contact leave it; where it breaks loose it rings. A recording shows that motion, not the reference.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sgms_observer.formulas.friction import stribeck_level
from sgms_observer.jit import njit
from sgms_observer.settings.axis import AxisSettings, FrictionSettings

Floats = NDArray[np.float64]

_STEP = 0.15  # of an integration step times the largest natural frequency: symplectic Euler is stable below 2
_MOST_STEPS = 200  # in one sample

_stribeck_level: Callable[..., float] = njit(stribeck_level)


@njit
def _follow(
    reference: Floats, velocity: Floats, period: float, steps: int, gains: Floats, kappa: Floats, share: Floats,
    curve: Floats, out: Floats,
) -> None:  # fmt: skip
    """Write the position at each sample; ``gains``: mass, position, velocity, acceleration, viscous."""
    n_z = kappa.shape[0]
    force = np.zeros(n_z)
    mass, stiff, damp, ahead, viscous = gains[0], gains[1], gains[2], gains[3], gains[4]
    static, coulomb, v_s = curve[0], curve[1], curve[2]
    step = period / steps
    place, speed = reference[0], 0.0
    out[0] = place
    for k in range(1, reference.shape[0]):
        change = (velocity[k] - velocity[k - 1]) / period
        for j in range(steps):
            time = (j + 0.5) * step
            aim_speed = velocity[k - 1] + change * time
            aim = reference[k - 1] + (velocity[k - 1] + 0.5 * change * time) * time
            total = 0.0
            for i in range(n_z):
                total += force[i]
            effort = stiff * (aim - place) + damp * (aim_speed - speed) + ahead * change
            speed += step * (effort - total - viscous * speed) / mass
            place += step * speed
            level = _stribeck_level(speed, static, coulomb, v_s)
            for i in range(n_z):
                limit = share[i] * level
                force[i] = min(max(force[i] + kappa[i] * step * speed, -limit), limit)
        out[k] = place


def followed(reference: Floats, period: float, axis: AxisSettings, friction: FrictionSettings) -> Floats:
    """Return the position of a table that follows a reference.

    Args:
        reference: set-point [m], shape (n,).
        period: time between two samples [s].
        axis: mass, viscous friction, and the controller of ``stage``.
        friction: what holds the table.
    """
    controller, mass = axis.stage.controller, axis.mass
    omega = 2.0 * math.pi * controller.bandwidth
    kappa = np.array(friction.element_stiffness)
    gains = np.array([
        mass, mass * omega**2, 2.0 * controller.damping_ratio * omega * mass, controller.feedforward_mass * mass,
        friction.viscous_coefficient,
    ])  # fmt: skip
    fastest = math.sqrt(omega**2 + float(kappa.sum()) / mass)
    steps = min(_MOST_STEPS, max(1, math.ceil(period * fastest / _STEP)))
    curve = np.array([friction.static_force, friction.coulomb_force, friction.stribeck_velocity])
    out = np.empty(len(reference))
    velocity: Floats = np.gradient(reference, period)
    _follow(
        np.ascontiguousarray(reference), velocity, period, steps, gains, kappa, np.array(friction.element_fraction),
        curve, out,
    )  # fmt: skip
    return out
