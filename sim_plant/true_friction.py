"""The friction of the simulated stage: the compiled steps of ``sgms_observer.friction``, element by element."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sgms_observer.formulas import friction as formulas
from sgms_observer.friction.gms import gms_step
from sgms_observer.friction.sgms import sgms_step
from sgms_observer.jit import njit
from sgms_observer.settings.friction import FrictionSettings

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

stribeck_level: Callable[..., float] = njit(formulas.stribeck_level)
reset_gain_paper: Callable[..., float] = njit(formulas.reset_gain_paper)
reset_gain_rate_independent: Callable[..., float] = njit(formulas.reset_gain_rate_independent)


class TrueFriction(NamedTuple):
    """Parameters of the true friction, in the units of ``FrictionSettings``; arrays of shape (n_z,)."""

    is_gms: bool
    is_paper_reset: bool
    stiffness: Floats
    fraction: Floats
    damping: Floats
    viscous: float
    static_force: float
    coulomb_force: float
    stribeck_velocity: float
    attraction_rate: float
    smoothing_lambda: float
    smoothing_zeta: float
    smoothing_gamma: float


def true_friction(settings: FrictionSettings) -> TrueFriction:
    """Turn checked settings into what the kernel takes."""
    return TrueFriction(
        is_gms=settings.model == "gms",
        is_paper_reset=settings.reset == "paper",
        stiffness=np.array(settings.element_stiffness, dtype=np.float64),
        fraction=np.array(settings.element_fraction, dtype=np.float64),
        damping=np.array(settings.element_damping, dtype=np.float64),
        viscous=float(settings.viscous_coefficient),
        static_force=float(settings.static_force),
        coulomb_force=float(settings.coulomb_force),
        stribeck_velocity=float(settings.stribeck_velocity),
        attraction_rate=float(settings.attraction_rate),
        smoothing_lambda=float(settings.smoothing_lambda),
        smoothing_zeta=float(settings.smoothing_zeta),
        smoothing_gamma=float(settings.smoothing_gamma),
    )


@njit
def level_of(friction: TrueFriction, velocity: float) -> float:
    """Return the Stribeck curve s(v) [N] at ``velocity`` [m/s]."""
    return stribeck_level(velocity, friction.static_force, friction.coulomb_force, friction.stribeck_velocity)


@njit
def advance_elements(
    friction: TrueFriction,
    level: float,
    velocity: float,
    period: float,
    force: Floats,
    mode: Integers,
    next_force: Floats,
    next_mode: Integers,
) -> tuple[float, float]:
    """Advance every element by one step at constant velocity.

    Args:
        friction: the true friction.
        level: s(v) times the effects' factor [N].
        velocity: velocity over the step [m/s].
        period: length of the step [s].
        force: element forces before the step [N], shape (n_z,).
        mode: GMS modes before the step, shape (n_z,).
        next_force: element forces after the step, written.
        next_mode: GMS modes after the step, written.

    Returns:
        Mean force of the elements over the step [N], and the force of their micro-viscous damping [N].
    """
    if friction.is_paper_reset:
        gain = reset_gain_paper(abs(velocity), friction.smoothing_gamma, friction.stribeck_velocity)
    else:
        gain = reset_gain_rate_independent(abs(velocity), friction.smoothing_gamma, friction.stribeck_velocity)
    mean = 0.0
    damped = 0.0
    for i in range(force.shape[0]):
        stiffness = friction.stiffness[i]
        fraction = friction.fraction[i]
        if friction.is_gms:
            next_force[i], next_mode[i] = gms_step(
                force[i], mode[i], velocity, period, stiffness, fraction, level, friction.attraction_rate
            )
        else:
            next_force[i] = sgms_step(
                force[i], velocity, period, stiffness, fraction * level,
                friction.smoothing_lambda, friction.smoothing_zeta, gain,
            )  # fmt: skip
        mean += 0.5 * (force[i] + next_force[i])
        damped += friction.damping[i] * (next_force[i] - force[i]) / (stiffness * period)
    return mean, damped
