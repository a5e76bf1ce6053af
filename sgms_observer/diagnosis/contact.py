"""Element friction along a measured motion."""

from __future__ import annotations

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.friction.gms import gms_decay, gms_step_with_decay
from sgms_observer.friction.sgms import sgms_step
from sgms_observer.jit import njit
from sgms_observer.settings.axis import FrictionSettings

UNSMOOTHED_SETTLING_TIME = 1.0e-4
"""Time constant of the sliding elements of an unsmoothed contact [s]; too short to show in a recording."""


@njit
def _element_friction(
    first: Floats, second: Floats, period: float, kappa: Floats, fraction: Floats, sliding_force: Floats,
    numbers: Floats, sides: Floats, out: Floats, stiffness: Floats,
) -> None:  # fmt: skip
    """Write the sum of the element forces after each step, and the stiffness of the sticking elements.

    ``numbers``: is_gms, lambda, zeta, gamma, is_paper, v_s, C. ``sides``: factors on the sliding force for forward and
    backward motion.
    """
    n_z = kappa.shape[0]
    force = np.zeros(n_z)
    mode = np.zeros(n_z, dtype=np.int64)
    for k in range(first.shape[0]):
        for part in range(2):
            travel = first[k] if part == 0 else second[k]
            if travel == 0.0:
                continue
            velocity = travel / period
            limit = sliding_force[k] * (sides[0] if travel > 0.0 else sides[1])
            gain = numbers[3]
            if numbers[4] > 0.5:
                gain *= abs(velocity) / numbers[5]
            decay = gms_decay(period, limit, numbers[6]) if numbers[0] > 0.5 else 0.0
            for i in range(n_z):
                if numbers[0] > 0.5:
                    force[i], mode[i], _by_force, _by_stiffness, _by_level = gms_step_with_decay(
                        force[i], mode[i], velocity, period, kappa[i], fraction[i], limit, numbers[6], decay
                    )
                else:
                    force[i] = sgms_step(
                        force[i], velocity, period, kappa[i], fraction[i] * limit, numbers[1], numbers[2], gain
                    )
        limit = sliding_force[k] * (sides[0] if first[k] + second[k] > 0.0 else sides[1])
        total = 0.0
        stuck = 0.0
        for i in range(n_z):
            total += force[i]
            if abs(force[i]) < 0.95 * fraction[i] * limit:
                stuck += kappa[i]
        out[k] = total
        stiffness[k] = stuck


def element_friction(
    friction: FrictionSettings,
    first: Floats,
    second: Floats,
    period: float,
    sliding_force: Floats,
    sides: tuple[float, float] = (1.0, 1.0),
    is_unsmoothed: bool = False,
) -> tuple[Floats, Floats]:
    """Return the element friction along a motion, without the viscous term [N], and the sticking stiffness [N/m].

    Args:
        friction: the model.
        first, second: displacement of each step before and after a reversal in the step [m].
        period: length of a step [s].
        sliding_force: sliding force at each sample, effects included [N].
        sides: factors on the sliding force for forward and backward motion [-].
        is_unsmoothed: whether S-GMS elements are computed as unsmoothed Maxwell-slip elements: GMS elements with a
            fast attraction.
    """
    is_gms = friction.model == "gms"
    numbers = np.array(
        [
            float(is_gms or is_unsmoothed),
            friction.smoothing_lambda,
            friction.smoothing_zeta,
            friction.smoothing_gamma,
            float(friction.reset == "paper"),
            friction.stribeck_velocity,
            friction.attraction_rate if is_gms else friction.coulomb_force / UNSMOOTHED_SETTLING_TIME,
        ]
    )
    out, stiffness = np.empty(len(first)), np.empty(len(first))
    _element_friction(
        first,
        second,
        period,
        np.array(friction.element_stiffness),
        np.array(friction.element_fraction),
        sliding_force,
        numbers,
        np.array(sides),
        out,
        stiffness,
    )
    return out, stiffness
