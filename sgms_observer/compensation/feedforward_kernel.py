"""Kernel of the feedforward: state, settings and tables in, force out, sample by sample; less where trust is lost."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sgms_observer.arrays import Floats, Ints
from sgms_observer.compensation.motion_ahead import (
    ACCELERATION,
    AHEAD_ACCELERATION,
    HAS_REFERENCE,
    JERK,
    SET_VELOCITY,
    TRAVEL,
    advance_elements,
    preview_elements,
)
from sgms_observer.compensation.safety import safe_output
from sgms_observer.effects.kernels import needed_command
from sgms_observer.estimators.block import FRICTION_STD, RESULT_SIZE, STATUS
from sgms_observer.estimators.layout import (
    MODEL_SIZE,
    OFFSET,
    VISCOUS,
    apply_parameters,
)
from sgms_observer.filters.differentiator import velocity_noise_gain
from sgms_observer.filters.motion import ELAPSED
from sgms_observer.jit import njit
from sgms_observer.settings.axis import FilterSettings

MIN_Z_SCORE = 3.0
"""Smallest z-score at which the sign of an estimate counts as known."""
_FADE_START = 0.5  # share of fade_std up to which nothing is faded

# one array: the state that evolves, the settings, then what each status means (0 good, 1 bad, 2 start again)
OUTPUT, TRUST, RAW, IS_ALIGNED, STEADY, HELD, STATE_SIZE = range(7)
(
    ENABLED, GAIN, LIMIT, SLEW, LOOK_AHEAD, STANDSTILL, SET_POINT_STANDSTILL, FADE_STD, TIMEOUT, VERDICT,
) = range(STATE_SIZE, STATE_SIZE + 10)  # fmt: skip

# Without a reference a motion counts once the estimated velocity has kept its sign for so long, or is this many times
# the standstill velocity: the noise of a velocity at rest does neither.
_STEADY_TIME = 5.0e-3
_CLEARLY_MOVING = 10.0


@njit
def next_trust(trust: float, verdict: float, period: float, timeout: float) -> float:
    """Return the trust in the data: 1 after ``timeout`` of good samples, 0 after ``timeout`` without."""
    if verdict == 2 or not period > 0.0:
        return 0.0
    change = period / timeout
    return min(1.0, trust + change) if verdict == 0 else max(0.0, trust - change)


@njit
def next_steady(steady: float, velocity: float, period: float, standstill: float) -> float:
    """Return the time since the last change of the sign of the velocity [s], with that sign."""
    if not (abs(velocity) > standstill and period > 0.0):
        return 0.0
    direction = math.copysign(1.0, velocity)
    return steady + direction * period if steady * direction > 0.0 else direction * period


@njit
def contradicts(friction: float, friction_std: float, held: float) -> bool:
    """Return whether the estimated friction [N] significantly has the other sign than the held force [N]."""
    return friction * held < 0.0 and abs(friction) > MIN_Z_SCORE * friction_std


@njit
def fade(friction_std: float, fade_std: float) -> float:
    """Return the factor for this uncertainty: 1 up to half of ``fade_std``, 0 from ``fade_std`` on."""
    if not friction_std < fade_std:
        return 0.0
    return min(1.0, (1.0 - friction_std / fade_std) / (1.0 - _FADE_START))


def standstill_velocity(settings: FilterSettings, sample_period: float) -> float:
    """Return the speed up to which an estimated velocity may be that of an axis at rest [m/s].

    It is ``3 sigma_q sqrt(sum w_i^2)``: ``sigma_q`` the noise of a measured position, the encoder's steps included,
    ``w_i`` the filter's weights from positions to the present velocity. Noise exceeds it at 3 samples in 1000.

    Args:
        settings: filter with the position's noise.
        sample_period: nominal time between two samples [s].
    """
    return MIN_Z_SCORE * settings.position_noise * velocity_noise_gain(settings, sample_period)


class ActuatorPath(NamedTuple):
    """Path from the command to the force, and the masses for the inertial force along a reference.

    Attributes:
        kinds, p_at, parameters: effects as ``needed_command`` takes them; no kinds where the path changes no force.
        delay: from the command to the force [s].
        mass: mass whose inertial force the controller commands, for the present set-point [kg].
        added_mass: mass of effects, whose inertial force only the compensation commands [kg].
    """

    kinds: Ints
    p_at: Ints
    parameters: Floats
    delay: float
    mass: float
    added_mass: float


@njit
def _is_finite(values: Floats) -> bool:
    """Return whether every value is a finite number."""
    total = 0.0
    for value in values:
        total += value
    return math.isfinite(total)


@njit
def compensate(
    state: Floats,
    carried: Floats,
    carried_modes: Ints,
    scalars: Floats,
    elements: Floats,
    kinds: Floats,
    path: ActuatorPath,
    motion: Floats,
    results: Floats,
    ahead: Floats,
    effects_force: Floats,
    effects_factor: Floats,
    out: Floats,
) -> None:
    """Compute the compensation sample by sample; ``state``, ``carried`` and ``carried_modes`` evolve in place."""
    n_z, n_p = elements.shape[1], kinds.shape[0]
    first_parameter = RESULT_SIZE + 3 * n_z
    row = np.empty(MODEL_SIZE)
    bars = np.empty((3, n_z))
    unit = np.ones(n_p)
    forces = np.empty(n_z)
    modes = np.zeros(n_z, dtype=np.int64)
    apply_parameters(scalars, elements, kinds[:0], unit[:0], unit[:0], row, bars)
    for k in range(motion.shape[0]):
        h = motion[k, ELAPSED]
        verdict = state[VERDICT + int(results[k, STATUS])]
        element_force = results[k, RESULT_SIZE : RESULT_SIZE + n_z]
        is_enabled = state[ENABLED] > 0.5
        trust = next_trust(state[TRUST], verdict, h, state[TIMEOUT]) if is_enabled else 0.0
        state[TRUST] = trust
        if n_p > 0:
            apply_parameters(scalars, elements, kinds, unit, results[k, first_parameter:], row, bars)
        factor = effects_factor[k] if effects_factor[k] > 0.0 else 1.0
        if verdict == 2 or not is_enabled:
            state[RAW] = 0.0
        set_velocity = ahead[k, SET_VELOCITY]
        if ahead[k, HAS_REFERENCE] > 0.5:
            if state[IS_ALIGNED] < 0.5 or verdict == 2 or not _is_finite(carried):
                for i in range(n_z):
                    carried[i] = element_force[i] if math.isfinite(element_force[i]) else 0.0
                    carried_modes[i] = 0
                state[IS_ALIGNED] = 1.0
            elif h > 0.0:
                travel = ahead[k, TRAVEL]
                advance_elements(carried, carried_modes, travel, abs(travel) / h, factor, row, bars)
            limit = state[SET_POINT_STANDSTILL]
            is_moving = limit == 0.0 or abs(set_velocity) > limit or ahead[k, TRAVEL] != 0.0
            acceleration, jerk = ahead[k, ACCELERATION], ahead[k, JERK]
            state[HELD] = 0.0 if is_moving else state[HELD] + h
            if state[HELD] > state[LOOK_AHEAD]:  # what was predicted has come or not: where the set-point is counts
                is_moving = True
                set_velocity = acceleration = jerk = 0.0
            for i in range(n_z):
                forces[i] = carried[i]
                modes[i] = carried_modes[i]
        else:
            state[IS_ALIGNED] = 0.0
            acceleration = jerk = 0.0
            state[STEADY] = next_steady(state[STEADY], set_velocity, h, state[STANDSTILL])
            is_moving = abs(state[STEADY]) >= _STEADY_TIME or abs(set_velocity) > _CLEARLY_MOVING * state[STANDSTILL]
            estimated = 0.0
            for i in range(n_z):
                forces[i] = element_force[i]
                modes[i] = 0
                estimated += element_force[i]
            if not is_moving and contradicts(estimated, results[k, FRICTION_STD], state[RAW]):
                state[RAW] = 0.0
        if is_enabled and is_moving and math.isfinite(set_velocity):
            velocity = preview_elements(
                forces, modes, set_velocity, acceleration, jerk, state[LOOK_AHEAD], factor, row, bars
            )
            total = row[VISCOUS] * velocity
            for i in range(n_z):
                total += forces[i]
            state[RAW] = total
        wanted = 0.0
        if trust > 0.0:
            share = state[GAIN] * trust * fade(results[k, FRICTION_STD], state[FADE_STD])
            needed = state[RAW] + row[OFFSET] + effects_force[k]
            inertia = commanded = 0.0
            if ahead[k, HAS_REFERENCE] > 0.5:
                needed += path.added_mass * ahead[k, AHEAD_ACCELERATION]
                inertia = path.mass * ahead[k, AHEAD_ACCELERATION]
                commanded = inertia - path.mass * ahead[k, JERK] * path.delay
            if path.kinds.shape[0] > 0:
                needed = needed_command(path.kinds, path.p_at, path.parameters, needed + inertia) - commanded
            wanted = share * needed
        state[OUTPUT] = safe_output(state[OUTPUT], wanted, h, state[LIMIT], state[SLEW])
        out[k] = state[OUTPUT]


@njit
def compensate_block(
    state: Floats,
    carried: Floats,
    carried_modes: Ints,
    scalars: Floats,
    elements: Floats,
    kinds: Floats,
    path_kinds: Ints,
    path_p_at: Ints,
    path_parameters: Floats,
    path_numbers: Floats,
    motion: Floats,
    results: Floats,
    ahead: Floats,
    effects_force: Floats,
    effects_factor: Floats,
    out: Floats,
) -> None:
    """Call ``compensate`` with arrays only: numba needs 2 us per call for the type of a named tuple."""
    path = ActuatorPath(path_kinds, path_p_at, path_parameters, path_numbers[0], path_numbers[1], path_numbers[2])
    compensate(
        state, carried, carried_modes, scalars, elements, kinds, path, motion, results, ahead,
        effects_force, effects_factor, out,
    )  # fmt: skip
