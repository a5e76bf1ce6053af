"""One integration step of the stage: friction, element by element, and the implicit midpoint rule for the velocity."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from sgms_observer.arrays import Floats, Ints
from sgms_observer.effects.kernels import effects_step
from sgms_observer.formulas import friction as formulas
from sgms_observer.friction.gms import gms_step
from sgms_observer.friction.sgms import sgms_step
from sgms_observer.jit import njit
from sgms_observer.settings.axis import FrictionSettings

stribeck_level: Callable[..., float] = njit(formulas.stribeck_level)
reset_gain_paper: Callable[..., float] = njit(formulas.reset_gain_paper)
reset_gain_rate_independent: Callable[..., float] = njit(formulas.reset_gain_rate_independent)

_MAX_ITERATIONS = 60
_RELATIVE_TOLERANCE = 1e-7
_ABSOLUTE_TOLERANCE = 1e-13  # m/s


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
    """Convert checked settings to arguments of the kernel."""
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
    mode: Ints,
    next_force: Floats,
    next_mode: Ints,
) -> tuple[float, float]:
    """Advance every element by one step at constant velocity.

    The observer's loop is ``estimators.interval.advance_at_level``. This one is separate on purpose, so that an error
    in the observer's loop is not in the truth too.

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


class EffectArrays(NamedTuple):
    """The stage's effects as flat arrays (see ``sgms_observer.effects.kernels.effects_step``)."""

    kinds: Ints
    p_at: Ints
    s_at: Ints
    parameters: Floats


class Motion(NamedTuple):
    """Position and motion of the mass.

    Attributes:
        position: [m].
        velocity: [m/s].
        acceleration: mean over the last step [m/s^2].
        damped: force of the elements' micro-viscous damping over the last step [N].
        effect_force: force of the effects over the last step [N].
    """

    position: float
    velocity: float
    acceleration: float
    damped: float
    effect_force: float


@njit
def substep(
    friction: TrueFriction,
    effects: EffectArrays,
    user: Any,
    mass: float,
    period: float,
    time: float,
    effort: float,
    expected_acceleration: float,
    other_velocity: float,
    other_acceleration: float,
    motion: Motion,
    force: Floats,
    mode: Ints,
    effect_state: Floats,
    next_force: Floats,
    next_mode: Ints,
    next_effect_state: Floats,
    scratch: Floats,
) -> Motion:
    """Advance the mass by one step.

    Args:
        friction: the true friction.
        effects: the true effects.
        user: compiled effects of the user's own.
        mass: moving mass with the effects' added mass [kg].
        period: length h of the step [s].
        time: time since the first sample at the start of the step [s].
        effort: force of the actuator and of disturbances, constant over the step [N].
        expected_acceleration: start value of the search [m/s^2].
        other_velocity: velocity of the other axis [m/s].
        other_acceleration: acceleration of the other axis [m/s^2].
        motion: at the start of the step.
        force: element forces [N], shape (n_z,); advanced in place.
        mode: GMS modes, shape (n_z,); advanced in place.
        effect_state: states of the effects; advanced in place.
        next_force, next_mode, next_effect_state, scratch: room to work in; ``scratch`` as for ``effects_step``.

    Returns:
        Motion at the end of the step.
    """
    inertia = 2.0 * mass / period
    steepest = inertia + friction.viscous
    for i in range(force.shape[0]):
        steepest += 0.5 * friction.stiffness[i] * period + friction.damping[i]
    low, high = -math.inf, math.inf
    before, before_residual = math.nan, 0.0
    middle = motion.velocity + 0.5 * period * expected_acceleration
    total, damped, effect_force = 0.0, 0.0, 0.0
    for _ in range(_MAX_ITERATIONS):
        level = level_of(friction, middle)
        factor = 1.0
        if effects.kinds.shape[0] > 0:
            next_effect_state[:] = effect_state
            effects_step(
                effects.kinds, effects.p_at, effects.s_at, effects.parameters, next_effect_state, user,
                motion.position + 0.5 * middle * period, middle, 2.0 * (middle - motion.velocity) / period,
                time + 0.5 * period, effort, period, level, other_velocity, other_acceleration, scratch,
            )  # fmt: skip
            effect_force = scratch[0]
            factor = scratch[1]
        elements, damped = advance_elements(
            friction, factor * level, middle, period, force, mode, next_force, next_mode
        )
        total = elements + damped + friction.viscous * middle + effect_force
        residual = inertia * (middle - motion.velocity) - effort + total
        tolerance = _RELATIVE_TOLERANCE * abs(middle) + _ABSOLUTE_TOLERANCE
        if abs(residual) <= tolerance * inertia or high - low <= tolerance:
            break
        if residual > 0.0:
            high = middle
        else:
            low = middle
        slope = steepest
        if middle != before and not math.isnan(before):
            secant = (residual - before_residual) / (middle - before)
            if secant > 0.1 * inertia:
                slope = secant
        before, before_residual = middle, residual
        middle -= residual / slope
        if not low < middle < high:
            if math.isinf(high - low):
                break
            middle = 0.5 * (low + high)
    force[:] = next_force
    mode[:] = next_mode
    if effects.kinds.shape[0] > 0:
        effect_state[:] = next_effect_state
    acceleration = (effort - total) / mass
    return Motion(
        motion.position + period * middle, motion.velocity + period * acceleration, acceleration, damped, effect_force
    )
