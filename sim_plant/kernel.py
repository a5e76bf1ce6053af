"""The inner loop of the simulated stage: encoder, controller, delay and motion, tick by tick."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from sgms_observer.arrays import Floats, Ints
from sgms_observer.effects.kernels import effort_step, measured_position
from sgms_observer.jit import njit
from sgms_observer.settings.axis import ControllerSettings
from sim_plant.integration import EffectArrays, Motion, TrueFriction, substep

VELOCITY_FILTER_RATIO = 5.0
"""Cut-off of the velocity filter over the closed-loop bandwidth [-]: far enough to cost little phase."""


# Columns of the output of the kernel, one row per sample.
POSITION, VELOCITY, ACCELERATION, MEASURED, CONTROL, APPLIED, FRICTION, EFFECT = range(8)
REFERENCE_POSITION, REFERENCE_VELOCITY = range(8, 10)
RECORDED = 10

# Rows of a plan, one column per tick.
PLAN_POSITION, PLAN_VELOCITY, PLAN_ACCELERATION, PLAN_ENCODER_NOISE = range(4)
PLAN_FORCE_NOISE, PLAN_DISTURBANCE = range(2)


class ControllerGains(NamedTuple):
    """Gains of the controller for one tick of ``period``.

    Attributes:
        position_gain: mass omega^2 [N/m].
        velocity_gain: 2 damping_ratio omega mass [N s/m].
        integral_gain: position_gain times the integral corner [N/(m s)].
        acceleration_gain: fed-forward mass [kg].
        velocity_keep: share of the filtered velocity after one tick [-].
        limit: largest effort [N].
        period: one tick [s].
    """

    position_gain: float
    velocity_gain: float
    integral_gain: float
    acceleration_gain: float
    velocity_keep: float
    limit: float
    period: float


class ControllerMemory(NamedTuple):
    """State of the controller.

    Attributes:
        position: last measured position [m]; NaN before the first.
        velocity: filtered velocity [m/s].
        integral: effort of the integral action [N].
    """

    position: float
    velocity: float
    integral: float


def controller_gains(settings: ControllerSettings, mass: float, period: float) -> ControllerGains:
    """Design the controller by pole placement for a free mass.

    Args:
        settings: the axis's ``stage.controller``.
        mass: mass the controller is designed for [kg].
        period: time between two runs of the controller [s].
    """
    omega = 2.0 * math.pi * settings.bandwidth
    position_gain = mass * omega * omega
    return ControllerGains(
        position_gain=position_gain,
        velocity_gain=2.0 * settings.damping_ratio * omega * mass,
        integral_gain=position_gain * 2.0 * math.pi * settings.integral_rate,
        acceleration_gain=settings.feedforward_mass * mass,
        velocity_keep=math.exp(-VELOCITY_FILTER_RATIO * omega * period),
        limit=settings.effort_limit,
        period=period,
    )


@njit
def control(
    gains: ControllerGains,
    memory: ControllerMemory,
    measured: float,
    position: float,
    velocity: float,
    acceleration: float,
    feedforward: float,
) -> tuple[float, ControllerMemory]:
    """Run the controller once.

    The integral holds while the effort is at its limit and would be driven further into it.

    Args:
        gains: from ``controller_gains``.
        memory: from the tick before.
        measured: measured position [m].
        position: reference position [m].
        velocity: reference velocity [m/s].
        acceleration: reference acceleration [m/s^2].
        feedforward: effort to add, for instance a friction compensation [N].

    Returns:
        Effort within the limit [N], memory for the next tick.
    """
    estimate = memory.velocity
    if not math.isnan(memory.position):
        difference = (measured - memory.position) / gains.period
        estimate = gains.velocity_keep * estimate + (1.0 - gains.velocity_keep) * difference
    error = position - measured
    growth = gains.integral_gain * gains.period * error
    direct = (
        gains.position_gain * error
        + gains.velocity_gain * (velocity - estimate)
        + gains.acceleration_gain * acceleration
        + feedforward
    )
    integral = memory.integral + growth
    wanted = direct + integral
    effort = min(max(wanted, -gains.limit), gains.limit)
    if (wanted - effort) * growth > 0.0:
        integral = memory.integral
        effort = min(max(direct + integral, -gains.limit), gains.limit)
    return effort, ControllerMemory(measured, estimate, integral)


class StageConstants(NamedTuple):
    """Constants of a run.

    Attributes:
        mass: moving mass with the effects' added mass [kg].
        tick: time between two runs of the controller [s].
        substeps: integration steps in a tick.
        ticks_per_sample: ticks from one published sample to the next.
        delay_substeps: delay from the controller's output to the force, in integration steps.
        resolution: step of the encoder [m]; 0 for none.
    """

    mass: float
    tick: float
    substeps: int
    ticks_per_sample: int
    delay_substeps: int
    resolution: float


class StageMemory(NamedTuple):
    """Arrays that the kernel advances in place.

    Attributes:
        motion: the fields of ``Motion`` and, last, the effort of the last step [N], shape (6,).
        controller: the fields of ``ControllerMemory``, shape (3,).
        force: element forces [N], shape (n_z,).
        mode: GMS modes, int64, shape (n_z,).
        effect_state: states of the effects.
        next_force, next_mode, next_effect_state, scratch: room to work in.
        efforts: ring of the latest efforts of the controller [N].
    """

    motion: Floats
    controller: Floats
    force: Floats
    mode: Ints
    effect_state: Floats
    next_force: Floats
    next_mode: Ints
    next_effect_state: Floats
    scratch: Floats
    efforts: Floats


@njit
def quantised(position: float, resolution: float) -> float:
    """Return the nearest multiple of ``resolution`` [m]; the position itself where that is 0."""
    if resolution <= 0.0:
        return position
    return resolution * math.floor(position / resolution + 0.5)


@njit
def run_samples(
    constants: StageConstants,
    friction: TrueFriction,
    effects: EffectArrays,
    user: Any,
    gains: ControllerGains,
    memory: StageMemory,
    first_tick: int,
    plan_start: int,
    tick_plan: Floats,
    sample_plan: Floats,
    compensation: Floats,
    other: Floats,
    recorded: Floats,
    element_force: Floats,
) -> None:
    """Run the stage over a block of samples.

    At each tick the encoder is read, the controller runs, and the mass moves under the (delayed) effort. The first tick
    of a sample is published.

    Args:
        constants: of the run.
        friction: the true friction.
        effects: the true effects.
        user: compiled effects of the user's own.
        gains: of the controller.
        memory: advanced in place.
        first_tick: number of ticks since the run began.
        plan_start: first sample of the block inside the plan.
        tick_plan: reference and encoder noise of every tick of the plan, rows PLAN_*.
        sample_plan: force noise and disturbance of every sample of the plan [N], rows PLAN_*.
        compensation: feedforward at each sample [N], shape (n,).
        other: velocity [m/s] and acceleration [m/s^2] of the other axis.
        recorded: written, shape (n, RECORDED).
        element_force: written [N], shape (n, n_z).
    """
    substeps = constants.substeps
    period = constants.tick / substeps
    ring = memory.efforts.shape[0]
    has_effects = effects.kinds.shape[0] > 0
    motion = Motion(memory.motion[0], memory.motion[1], memory.motion[2], memory.motion[3], memory.motion[4])
    last_effort = memory.motion[5]
    controller = ControllerMemory(memory.controller[0], memory.controller[1], memory.controller[2])
    tick = first_tick
    for k in range(compensation.shape[0]):
        planned = plan_start + k
        disturbance = sample_plan[PLAN_DISTURBANCE, planned]
        for part in range(constants.ticks_per_sample):
            column = planned * constants.ticks_per_sample + part
            measured = motion.position + tick_plan[PLAN_ENCODER_NOISE, column]
            if has_effects:
                measured = measured_position(effects.kinds, effects.p_at, effects.parameters, measured)
            measured = quantised(measured, constants.resolution)
            command, controller = control(
                gains, controller, measured, tick_plan[PLAN_POSITION, column], tick_plan[PLAN_VELOCITY, column],
                tick_plan[PLAN_ACCELERATION, column], compensation[k],
            )  # fmt: skip
            effort = command
            if has_effects:
                effort = effort_step(
                    effects.kinds, effects.p_at, effects.s_at, effects.parameters, memory.effect_state, command
                )
            memory.efforts[tick % ring] = effort
            if part == 0:
                total = friction.viscous * motion.velocity + motion.damped
                for i in range(memory.force.shape[0]):
                    total += memory.force[i]
                    element_force[k, i] = memory.force[i]
                recorded[k, POSITION] = motion.position
                recorded[k, VELOCITY] = motion.velocity
                recorded[k, MEASURED] = measured
                recorded[k, CONTROL] = command + sample_plan[PLAN_FORCE_NOISE, planned]
                recorded[k, FRICTION] = total
                recorded[k, REFERENCE_POSITION] = tick_plan[PLAN_POSITION, column]
                recorded[k, REFERENCE_VELOCITY] = tick_plan[PLAN_VELOCITY, column]
            for j in range(substeps):
                sent = (tick * substeps + j - constants.delay_substeps) // substeps
                arrived = memory.efforts[sent % ring] if sent >= 0 else 0.0
                expected = motion.acceleration + (arrived + disturbance - last_effort) / constants.mass
                last_effort = arrived + disturbance
                motion = substep(
                    friction, effects, user, constants.mass, period, tick * constants.tick + j * period, last_effort,
                    expected, other[0], other[1], motion, memory.force, memory.mode, memory.effect_state,
                    memory.next_force, memory.next_mode, memory.next_effect_state, memory.scratch,
                )  # fmt: skip
                if part == 0 and j == 0:
                    recorded[k, ACCELERATION] = motion.acceleration
                    recorded[k, APPLIED] = arrived
                    recorded[k, EFFECT] = motion.effect_force
            tick += 1
    memory.motion[0] = motion.position
    memory.motion[1] = motion.velocity
    memory.motion[2] = motion.acceleration
    memory.motion[3] = motion.damped
    memory.motion[4] = motion.effect_force
    memory.motion[5] = last_effort
    memory.controller[0] = controller.position
    memory.controller[1] = controller.velocity
    memory.controller[2] = controller.integral
