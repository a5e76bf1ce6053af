"""One sample through the whole observer, written so that it can be translated: what ``AxisObserver.step`` does.

A test holds the two together to the last bit.
"""

from __future__ import annotations

from typing import Any

from sgms_observer.compensation.feedforward_kernel import LOOK_AHEAD, SET_POINT_STANDSTILL, STANDSTILL, compensate
from sgms_observer.compensation.motion_ahead import (
    AHEAD_ACCELERATION,
    AHEAD_POSITION,
    AHEAD_VELOCITY,
    look_ahead_block,
)
from sgms_observer.effects.kernels import corrected_position, effects_step, effort_step
from sgms_observer.estimators.block import STATUS, take_sample, write_present
from sgms_observer.estimators.interval import level_at
from sgms_observer.filters import motion as row_of
from sgms_observer.filters.kernel import filter_sample

HAS_ORIGIN, ORIGIN = range(2)


def observe_sample(
    filter_config: Any,
    filter_state: Any,
    motion: Any,
    kinds: Any,
    p_at: Any,
    s_at: Any,
    effect_parameters: Any,
    effect_state: Any,
    effect_state_ahead: Any,
    user: Any,
    scratch: Any,
    estimator: Any,
    results: Any,
    scalars: Any,
    elements: Any,
    estimated: Any,
    path: Any,
    feedforward: Any,
    carried: Any,
    carried_modes: Any,
    set_points: Any,
    ahead: Any,
    force: Any,
    factor: Any,
    compensation: Any,
    clock: Any,
    has_effects: bool,
    delay: float,
    stamp_ns: int,
    position: float,
    effort: float,
    reference_position: Any,
    reference_velocity: Any,
    other_velocity: float,
    other_acceleration: float,
    other_velocity_ahead: float,
    other_acceleration_ahead: float,
) -> None:
    """Take one sample: filter, effects, estimator, look-ahead and compensation, in this order.

    Args:
        filter_config, filter_state: of the filter (``filters.motion``).
        motion: the filter's row, shape (1, width).
        kinds, p_at, s_at, effect_parameters, user: the effects (``effects.kernels``).
        effect_state, effect_state_ahead: states of the effects now and where the compensation acts.
        scratch: room for the effects.
        estimator: the estimator's memory.
        results: the estimator's row, shape (1, width).
        scalars, elements, estimated: the nominal model, and which parameters are estimated.
        path: what lies between command and force (``compensation.feedforward_kernel.ActuatorPath``).
        feedforward, carried, carried_modes, set_points: of the compensation.
        ahead: the look-ahead's row, shape (1, AHEAD_WIDTH).
        force, factor: of the effects, shape (1,).
        compensation: written [N], shape (1,).
        clock: whether there was a sample, and the first one's stamp [ns].
        has_effects: whether any effect adds a force or scales the Stribeck level.
        delay: time from a row's instant to its sample [s].
        stamp_ns: sample time [ns].
        position: measured position [m].
        effort: effort of the actuator [N], NaN where it is missing.
        reference_position, reference_velocity: set-point [m], [m/s], NaN where there is none, shape (1,).
        other_velocity, other_acceleration: of the axis that ``cross_axis_coupling`` follows, at the row's instant.
        other_velocity_ahead, other_acceleration_ahead: the same where that axis is meant to be.
    """
    if clock[HAS_ORIGIN] == 0:
        clock[HAS_ORIGIN] = 1
        clock[ORIGIN] = stamp_ns
    since = 1e-9 * float(stamp_ns - clock[ORIGIN])
    true_position = corrected_position(kinds, p_at, effect_parameters, position)
    arrived = effort_step(kinds, p_at, s_at, effect_parameters, effect_state, effort)
    row = motion[0]
    result = results[0]
    filter_sample(filter_config, filter_state, stamp_ns, true_position, arrived, row)
    force[0] = 0.0
    factor[0] = 1.0
    if has_effects:
        level = level_at(scalars, row[row_of.VELOCITY], 1.0)
        effects_step(
            kinds, p_at, s_at, effect_parameters, effect_state, user,
            row[row_of.POSITION], row[row_of.VELOCITY], row[row_of.ACCELERATION], since - delay, row[row_of.EFFORT],
            row[row_of.PERIOD], level, other_velocity, other_acceleration, scratch,
        )  # fmt: skip
        force[0] = scratch[0]
        factor[0] = scratch[1]
    result[STATUS] = take_sample(estimator, row, row[row_of.EFFORT] - force[0], factor[0], result)
    write_present(estimator, row, factor[0], result)
    look_ahead_block(
        set_points, feedforward[LOOK_AHEAD], feedforward[STANDSTILL], feedforward[SET_POINT_STANDSTILL], motion,
        reference_position, reference_velocity, ahead,
    )  # fmt: skip
    if has_effects:
        level = level_at(scalars, ahead[0, AHEAD_VELOCITY], 1.0)
        effects_step(
            kinds, p_at, s_at, effect_parameters, effect_state_ahead, user,
            ahead[0, AHEAD_POSITION], ahead[0, AHEAD_VELOCITY], ahead[0, AHEAD_ACCELERATION],
            since + feedforward[LOOK_AHEAD], row[row_of.EFFORT], row[row_of.PERIOD], level,
            other_velocity_ahead, other_acceleration_ahead, scratch,
        )  # fmt: skip
        force[0] = scratch[0]
        factor[0] = scratch[1]
    compensate(
        feedforward, carried, carried_modes, scalars, elements, estimated, path, motion, results, ahead, force, factor,
        compensation,
    )  # fmt: skip
