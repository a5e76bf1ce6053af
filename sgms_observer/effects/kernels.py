"""The catalogue as one compiled switch: what stage, observer, replay and compensation call sample by sample.

Effects are numbered by ``KIND``; each has a slice of one flat parameter array and of one flat state array. ``user`` is
the compiled function of the user's own effects (see ``user_kernels``), called for numbers from ``FIRST_USER_KIND`` on.
"""

from __future__ import annotations

from typing import Any

from sgms_observer.effects.catalogue import BUILT_IN
from sgms_observer.effects.map_kernel import learnt_map, learnt_map_next
from sgms_observer.formulas import effects_force, effects_level, effects_path
from sgms_observer.jit import njit

KIND = {entry.name: number for number, entry in enumerate(BUILT_IN)}
FIRST_USER_KIND = 100
MINIMUM_LEVEL_FACTOR = 0.01

COGGING, SPRING, OFFSET, GRAVITY = KIND["cogging"], KIND["spring"], KIND["offset"], KIND["gravity"]
ASYMMETRIC_VISCOUS, NONLINEAR_VISCOUS = KIND["asymmetric_viscous"], KIND["nonlinear_viscous"]
QUADRATIC_DRAG, EDDY_CURRENT = KIND["quadratic_drag"], KIND["eddy_current"]
PERIODIC_DISTURBANCE, CROSS_AXIS_COUPLING = KIND["periodic_disturbance"], KIND["cross_axis_coupling"]
PRESLIDING, FLEXIBLE_MODE = KIND["presliding"], KIND["flexible_mode"]
POSITION_PERIODIC_FRICTION = KIND["position_periodic_friction"]
POSITION_DEPENDENT_FRICTION = KIND["position_dependent_friction"]
ASYMMETRIC_COULOMB, STRIBECK = KIND["asymmetric_coulomb"], KIND["stribeck"]
LOAD_DEPENDENT_FRICTION, THERMAL_DRIFT = KIND["load_dependent_friction"], KIND["thermal_drift"]
WEAR_STEP, DWELL_BREAKAWAY = KIND["wear_step"], KIND["dwell_breakaway"]
FRICTIONAL_LAG, BACKLASH = KIND["frictional_lag"], KIND["backlash"]
ACTUATOR_GAIN, ACTUATOR_SATURATION = KIND["actuator_gain"], KIND["actuator_saturation"]
ACTUATOR_DEAD_ZONE, ACTUATOR_DELAY = KIND["actuator_dead_zone"], KIND["actuator_delay"]
LEARNT_MAP, LEARNT_MAP_3 = KIND["learnt_map"], KIND["learnt_map_3"]
ENCODER_INTERPOLATION_ERROR, QUANTISATION = KIND["encoder_interpolation_error"], KIND["quantisation"]


def _formula(function: Any) -> Any:
    """Compile a formula, which carries no types of its own."""
    return njit(function)


_cogging = _formula(effects_force.cogging)
_spring = _formula(effects_force.spring)
_offset = _formula(effects_force.offset)
_gravity = _formula(effects_force.gravity)
_asymmetric_viscous = _formula(effects_force.asymmetric_viscous)
_nonlinear_viscous = _formula(effects_force.nonlinear_viscous)
_quadratic_drag = _formula(effects_force.quadratic_drag)
_eddy_current = _formula(effects_force.eddy_current)
_periodic_disturbance = _formula(effects_force.periodic_disturbance)
_cross_axis_coupling = _formula(effects_force.cross_axis_coupling)
_presliding = _formula(effects_force.presliding)
_presliding_next = _formula(effects_force.presliding_next)
_backlash = _formula(effects_force.backlash)
_backlash_next = _formula(effects_force.backlash_next)
_flexible_mode = _formula(effects_force.flexible_mode)
_flexible_mode_next = _formula(effects_force.flexible_mode_next)
_position_periodic_friction = _formula(effects_level.position_periodic_friction)
_position_dependent_friction = _formula(effects_level.position_dependent_friction)
_asymmetric_coulomb = _formula(effects_level.asymmetric_coulomb)
_stribeck = _formula(effects_level.stribeck)
_load_dependent_friction = _formula(effects_level.load_dependent_friction)
_thermal_drift = _formula(effects_level.thermal_drift)
_thermal_drift_next = _formula(effects_level.thermal_drift_next)
_wear_step = _formula(effects_level.wear_step)
_wear_step_next = _formula(effects_level.wear_step_next)
_dwell_breakaway = _formula(effects_level.dwell_breakaway)
_dwell_breakaway_next = _formula(effects_level.dwell_breakaway_next)
_frictional_lag = _formula(effects_level.frictional_lag)
_frictional_lag_next = _formula(effects_level.frictional_lag_next)
_actuator_gain_command = _formula(effects_path.actuator_gain_command)
_actuator_saturation_command = _formula(effects_path.actuator_saturation_command)
_actuator_dead_zone_command = _formula(effects_path.actuator_dead_zone_command)
_actuator_gain = _formula(effects_path.actuator_gain)
_actuator_saturation = _formula(effects_path.actuator_saturation)
_actuator_dead_zone = _formula(effects_path.actuator_dead_zone)
_actuator_delay = _formula(effects_path.actuator_delay)
_encoder_interpolation_error = _formula(effects_path.encoder_interpolation_error)
_encoder_interpolation_correction = _formula(effects_path.encoder_interpolation_correction)
_quantisation = _formula(effects_path.quantisation)


@njit
def effects_step(
    kinds: Any,
    p_at: Any,
    s_at: Any,
    parameters: Any,
    state: Any,
    user: Any,
    q: float,
    v: float,
    a: float,
    t: float,
    u: float,
    h: float,
    level: float,
    v2: float,
    a2: float,
    out: Any,
) -> None:
    """Advance every effect by one step and write added force [N] and level factor [-] into ``out[0:2]``.

    Args:
        kinds: number of each effect, int64.
        p_at: first parameter of each effect in ``parameters``, and the end, int64.
        s_at: first state of each effect in ``state``, and the end, int64.
        parameters: flat parameter values.
        state: flat states; changed in place.
        user: compiled user effects, or None.
        q, v, a: position [m], velocity [m/s] and acceleration [m/s^2] at the end of the step.
        t: time since the first sample [s].
        u: effort [N].
        h: length of the step [s].
        level: the model's Stribeck level at ``v`` [N].
        v2, a2: velocity and acceleration of the other axis.
        out: at least 4 floats. The rest is scratch.

    The mass of PLANT effects is not in the force: see ``CompiledEffects.added_mass``.
    """
    force = 0.0
    factor = 1.0
    for i in range(kinds.shape[0]):
        kind = kinds[i]
        p = parameters[p_at[i] : p_at[i + 1]]
        s = state[s_at[i] : s_at[i + 1]]
        if kind >= FIRST_USER_KIND:
            if user is not None:
                out[2] = 0.0
                out[3] = 1.0
                inputs = out[4:13]
                inputs[0] = q
                inputs[1] = v
                inputs[2] = a
                inputs[3] = t
                inputs[4] = u
                inputs[5] = h
                inputs[6] = level
                inputs[7] = v2
                inputs[8] = a2
                user(kind - FIRST_USER_KIND, inputs, s, p, out[2:4])
                force += out[2]
                factor *= out[3]
        elif kind == COGGING:
            force += _cogging(q, p)
        elif kind == SPRING:
            force += _spring(q, p)
        elif kind == OFFSET:
            force += _offset(p)
        elif kind == GRAVITY:
            force += _gravity(q, p)
        elif kind == ASYMMETRIC_VISCOUS:
            force += _asymmetric_viscous(v, p)
        elif kind == NONLINEAR_VISCOUS:
            force += _nonlinear_viscous(v, p)
        elif kind == QUADRATIC_DRAG:
            force += _quadratic_drag(v, p)
        elif kind == EDDY_CURRENT:
            force += _eddy_current(v, p)
        elif kind == PERIODIC_DISTURBANCE:
            force += _periodic_disturbance(t, p)
        elif kind == CROSS_AXIS_COUPLING:
            force += _cross_axis_coupling(v2, a2, p)
        elif kind == PRESLIDING:
            early, late = _presliding_next(v, h, s, p)
            s[0] = early
            s[1] = late
            force += _presliding(s, p)
        elif kind == BACKLASH:
            s[0] = _backlash_next(v, h, s, p)[0]
            force += _backlash(level, s, p)
        elif kind == FLEXIBLE_MODE:
            deflection, rate = _flexible_mode_next(a, h, s, p)
            s[0] = deflection
            s[1] = rate
            force += _flexible_mode(s, p)
        elif kind == POSITION_PERIODIC_FRICTION:
            factor *= _position_periodic_friction(q, p)
        elif kind == POSITION_DEPENDENT_FRICTION:
            factor *= _position_dependent_friction(q, p)
        elif kind == ASYMMETRIC_COULOMB:
            factor *= _asymmetric_coulomb(v, p)
        elif kind == STRIBECK:
            factor *= _stribeck(v, p)
        elif kind == LOAD_DEPENDENT_FRICTION:
            factor *= _load_dependent_friction(a, p)
        elif kind == THERMAL_DRIFT:
            s[0] = _thermal_drift_next(v, h, s, p)[0]
            factor *= _thermal_drift(s, p)
        elif kind == WEAR_STEP:
            s[0] = _wear_step_next(v, h, s, p)[0]
            factor *= _wear_step(s, p)
        elif kind == DWELL_BREAKAWAY:
            s[0] = _dwell_breakaway_next(v, h, s, p)[0]
            factor *= _dwell_breakaway(s, p)
        elif kind == FRICTIONAL_LAG:
            lagged, ratio, started = _frictional_lag_next(v, h, level, s, p)
            s[0] = lagged
            s[1] = ratio
            s[2] = started
            factor *= _frictional_lag(level, s, p)
        elif LEARNT_MAP <= kind <= LEARNT_MAP_3:  # three of one formula, numbered in a row
            direction, travel, clock, dwell = learnt_map_next(v, h, s, p)
            s[0] = direction
            s[1] = travel
            s[2] = clock
            s[3] = dwell
            force += learnt_map(q, v, a, t, s, p)
    out[0] = force
    out[1] = max(factor, MINIMUM_LEVEL_FACTOR)


@njit
def effort_step(kinds: Any, p_at: Any, s_at: Any, parameters: Any, state: Any, u: float) -> float:
    """Advance the effort's path by one sample and return the effort that arrives [N].

    Args:
        kinds, p_at, s_at, parameters, state: as in ``effects_step``.
        u: published effort [N].

    A delay keeps a ring of past efforts in its state: whole and broken part of the delay in samples, number of efforts
    seen, place of the latest, then the ring.
    """
    for i in range(kinds.shape[0]):
        kind = kinds[i]
        p = parameters[p_at[i] : p_at[i + 1]]
        if kind == ACTUATOR_GAIN:
            u = _actuator_gain(u, p)
        elif kind == ACTUATOR_SATURATION:
            u = _actuator_saturation(u, p)
        elif kind == ACTUATOR_DEAD_ZONE:
            u = _actuator_dead_zone(u, p)
        elif kind == ACTUATOR_DELAY:
            s = state[s_at[i] : s_at[i + 1]]
            ring = s[4:]
            size = ring.shape[0]
            if s[2] == 0.0:
                for j in range(size):
                    ring[j] = u
            s[2] = 1.0
            latest = (int(s[3]) + 1) % size
            s[3] = float(latest)
            ring[latest] = u
            whole = int(s[0])
            u = _actuator_delay(ring[(latest - whole) % size], ring[(latest - whole - 1) % size], s[1])
    return u


@njit
def needed_command(kinds: Any, p_at: Any, parameters: Any, force: float) -> float:
    """Return the command [N] that lets ``force`` [N] arrive; a delay changes only its time.

    Args:
        kinds, p_at, parameters: as in ``effects_step``.
        force: wanted at the mass [N].
    """
    for i in range(kinds.shape[0] - 1, -1, -1):
        p = parameters[p_at[i] : p_at[i + 1]]
        if kinds[i] == ACTUATOR_GAIN:
            force = _actuator_gain_command(force, p)
        elif kinds[i] == ACTUATOR_SATURATION:
            force = _actuator_saturation_command(force, p)
        elif kinds[i] == ACTUATOR_DEAD_ZONE:
            force = _actuator_dead_zone_command(force, p)
    return force


@njit
def measured_position(kinds: Any, p_at: Any, parameters: Any, q: float) -> float:
    """Return the position an encoder with the effects shows for the true position ``q`` [m]."""
    for i in range(kinds.shape[0]):
        if kinds[i] == ENCODER_INTERPOLATION_ERROR:
            q = _encoder_interpolation_error(q, parameters[p_at[i] : p_at[i + 1]])
        elif kinds[i] == QUANTISATION:
            q = _quantisation(q, parameters[p_at[i] : p_at[i + 1]])
    return q


@njit
def corrected_position(kinds: Any, p_at: Any, parameters: Any, q: float) -> float:
    """Return the true position for the measured position ``q`` [m]; what a grid has lost stays lost."""
    for i in range(kinds.shape[0] - 1, -1, -1):
        if kinds[i] == ENCODER_INTERPOLATION_ERROR:
            q = _encoder_interpolation_correction(q, parameters[p_at[i] : p_at[i + 1]])
    return q


@njit
def effects_block(
    kinds: Any,
    p_at: Any,
    s_at: Any,
    parameters: Any,
    state: Any,
    user: Any,
    q: Any,
    v: Any,
    a: Any,
    t: Any,
    u: Any,
    h: Any,
    level: Any,
    v2: Any,
    a2: Any,
    scratch: Any,
    force: Any,
    factor: Any,
) -> None:
    """``effects_step`` over a block; writes ``force`` and ``factor``. Arrays of one length, as in ``effects_step``."""
    for k in range(q.shape[0]):
        effects_step(
            kinds,
            p_at,
            s_at,
            parameters,
            state,
            user,
            q[k],
            v[k],
            a[k],
            t[k],
            u[k],
            h[k],
            level[k],
            v2[k],
            a2[k],
            scratch,
        )
        force[k] = scratch[0]
        factor[k] = scratch[1]


@njit
def effort_block(kinds: Any, p_at: Any, s_at: Any, parameters: Any, state: Any, u: Any, arrived: Any) -> None:
    """``effort_step`` over a block; writes ``arrived``."""
    for k in range(u.shape[0]):
        arrived[k] = effort_step(kinds, p_at, s_at, parameters, state, u[k])


@njit
def command_block(kinds: Any, p_at: Any, parameters: Any, force: Any, command: Any) -> None:
    """``needed_command`` over a block; writes ``command``."""
    for k in range(force.shape[0]):
        command[k] = needed_command(kinds, p_at, parameters, force[k])


@njit
def position_block(kinds: Any, p_at: Any, parameters: Any, q: Any, is_correction: bool, result: Any) -> None:
    """``measured_position`` or, for a correction, ``corrected_position`` over a block; writes ``result``."""
    for k in range(q.shape[0]):
        if is_correction:
            result[k] = corrected_position(kinds, p_at, parameters, q[k])
        else:
            result[k] = measured_position(kinds, p_at, parameters, q[k])
