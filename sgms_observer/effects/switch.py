"""The effects of the package as compiled switches, one branch per record of the catalogue.

Written by ``python -m sgms_observer.effects.switch_source``; do not edit. Arguments as in ``kernels``.
"""

from __future__ import annotations

from typing import Any

from sgms_observer.effects import map_kernel
from sgms_observer.formulas import effects
from sgms_observer.jit import njit

_cogging: Any = njit(effects.cogging)
_spring: Any = njit(effects.spring)
_offset: Any = njit(effects.offset)
_gravity: Any = njit(effects.gravity)
_asymmetric_viscous: Any = njit(effects.asymmetric_viscous)
_nonlinear_viscous: Any = njit(effects.nonlinear_viscous)
_quadratic_drag: Any = njit(effects.quadratic_drag)
_eddy_current: Any = njit(effects.eddy_current)
_periodic_disturbance: Any = njit(effects.periodic_disturbance)
_cross_axis_coupling: Any = njit(effects.cross_axis_coupling)
_presliding_next: Any = njit(effects.presliding_next)
_presliding: Any = njit(effects.presliding)
_backlash_next: Any = njit(effects.backlash_next)
_backlash: Any = njit(effects.backlash)
_flexible_mode_next: Any = njit(effects.flexible_mode_next)
_flexible_mode: Any = njit(effects.flexible_mode)
_position_periodic_friction: Any = njit(effects.position_periodic_friction)
_position_dependent_friction: Any = njit(effects.position_dependent_friction)
_asymmetric_coulomb: Any = njit(effects.asymmetric_coulomb)
_stribeck: Any = njit(effects.stribeck)
_load_dependent_friction: Any = njit(effects.load_dependent_friction)
_thermal_drift_next: Any = njit(effects.thermal_drift_next)
_thermal_drift: Any = njit(effects.thermal_drift)
_wear_step_next: Any = njit(effects.wear_step_next)
_wear_step: Any = njit(effects.wear_step)
_dwell_breakaway_next: Any = njit(effects.dwell_breakaway_next)
_dwell_breakaway: Any = njit(effects.dwell_breakaway)
_frictional_lag_next: Any = njit(effects.frictional_lag_next)
_frictional_lag: Any = njit(effects.frictional_lag)
_learnt_map_next: Any = map_kernel.learnt_map_next
_learnt_map: Any = map_kernel.learnt_map
_actuator_gain: Any = njit(effects.actuator_gain)
_actuator_saturation: Any = njit(effects.actuator_saturation)
_actuator_dead_zone: Any = njit(effects.actuator_dead_zone)
_actuator_gain_command: Any = njit(effects.actuator_gain_command)
_actuator_saturation_command: Any = njit(effects.actuator_saturation_command)
_actuator_dead_zone_command: Any = njit(effects.actuator_dead_zone_command)
_encoder_interpolation_error: Any = njit(effects.encoder_interpolation_error)
_quantisation: Any = njit(effects.quantisation)
_encoder_interpolation_correction: Any = njit(effects.encoder_interpolation_correction)


@njit
def built_in_step(
    kind: int, p: Any, s: Any, q: float, v: float, a: float, t: float, u: float, h: float, level: float,
    v2: float, a2: float,
) -> tuple[float, float]:  # fmt: skip
    """Advance one effect by one step; return its force [N] and its factor on the Stribeck level [-]."""
    force = 0.0
    factor = 1.0
    if kind == 0:  # cogging
        force = _cogging(q, p)
    elif kind == 1:  # spring
        force = _spring(q, p)
    elif kind == 2:  # offset
        force = _offset(p)
    elif kind == 3:  # gravity
        force = _gravity(q, p)
    elif kind == 4:  # asymmetric_viscous
        force = _asymmetric_viscous(v, p)
    elif kind == 5:  # nonlinear_viscous
        force = _nonlinear_viscous(v, p)
    elif kind == 6:  # quadratic_drag
        force = _quadratic_drag(v, p)
    elif kind == 7:  # eddy_current
        force = _eddy_current(v, p)
    elif kind == 8:  # periodic_disturbance
        force = _periodic_disturbance(t, p)
    elif kind == 9:  # cross_axis_coupling
        force = _cross_axis_coupling(v2, a2, p)
    elif kind == 10:  # presliding
        presliding_state = _presliding_next(v, h, s, p)
        s[0] = presliding_state[0]
        s[1] = presliding_state[1]
        force = _presliding(s, p)
    elif kind == 11:  # backlash
        backlash_state = _backlash_next(v, h, s, p)
        s[0] = backlash_state[0]
        force = _backlash(level, s, p)
    elif kind == 13:  # flexible_mode
        flexible_mode_state = _flexible_mode_next(a, h, s, p)
        s[0] = flexible_mode_state[0]
        s[1] = flexible_mode_state[1]
        force = _flexible_mode(s, p)
    elif kind == 14:  # position_periodic_friction
        factor = _position_periodic_friction(q, p)
    elif kind == 15:  # position_dependent_friction
        factor = _position_dependent_friction(q, p)
    elif kind == 16:  # asymmetric_coulomb
        factor = _asymmetric_coulomb(v, p)
    elif kind == 17:  # stribeck
        factor = _stribeck(v, p)
    elif kind == 18:  # load_dependent_friction
        factor = _load_dependent_friction(a, p)
    elif kind == 19:  # thermal_drift
        thermal_drift_state = _thermal_drift_next(v, h, s, p)
        s[0] = thermal_drift_state[0]
        factor = _thermal_drift(s, p)
    elif kind == 20:  # wear_step
        wear_step_state = _wear_step_next(v, h, s, p)
        s[0] = wear_step_state[0]
        factor = _wear_step(s, p)
    elif kind == 21:  # dwell_breakaway
        dwell_breakaway_state = _dwell_breakaway_next(v, h, s, p)
        s[0] = dwell_breakaway_state[0]
        factor = _dwell_breakaway(s, p)
    elif kind == 22:  # frictional_lag
        frictional_lag_state = _frictional_lag_next(v, h, level, s, p)
        s[0] = frictional_lag_state[0]
        s[1] = frictional_lag_state[1]
        s[2] = frictional_lag_state[2]
        factor = _frictional_lag(level, s, p)
    elif 29 <= kind <= 31:  # learnt_map, learnt_map_2, learnt_map_3
        learnt_map_state = _learnt_map_next(v, h, s, p)
        s[0] = learnt_map_state[0]
        s[1] = learnt_map_state[1]
        s[2] = learnt_map_state[2]
        s[3] = learnt_map_state[3]
        s[4] = learnt_map_state[4]
        force = _learnt_map(q, v, a, t, s, p)
    return force, factor


@njit
def effort_effect(kind: int, p: Any, u: float) -> float:
    """Return the effort that one effect without memory lets arrive [N]."""
    if kind == 23:  # actuator_gain
        u = _actuator_gain(u, p)
    elif kind == 24:  # actuator_saturation
        u = _actuator_saturation(u, p)
    elif kind == 25:  # actuator_dead_zone
        u = _actuator_dead_zone(u, p)
    return u


@njit
def needed_effect(kind: int, p: Any, force: float) -> float:
    """Return the command that lets ``force`` arrive through one effect [N]."""
    if kind == 23:  # actuator_gain
        force = _actuator_gain_command(force, p)
    elif kind == 24:  # actuator_saturation
        force = _actuator_saturation_command(force, p)
    elif kind == 25:  # actuator_dead_zone
        force = _actuator_dead_zone_command(force, p)
    return force


@njit
def position_effect(kind: int, p: Any, q: float) -> float:
    """Return the position that one effect makes the encoder show [m]."""
    if kind == 27:  # encoder_interpolation_error
        q = _encoder_interpolation_error(q, p)
    elif kind == 28:  # quantisation
        q = _quantisation(q, p)
    return q


@njit
def position_correction(kind: int, p: Any, q: float) -> float:
    """Return the true position for what the encoder shows [m]; what an effect has lost stays lost."""
    if kind == 27:  # encoder_interpolation_error
        q = _encoder_interpolation_correction(q, p)
    return q
