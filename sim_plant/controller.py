"""The position controller of the simulated stage: PD on the position error with integral action and a limit."""

from __future__ import annotations

import math
from typing import NamedTuple

from sgms_observer.jit import njit
from sgms_observer.settings.stage import ControllerSettings

VELOCITY_FILTER_RATIO = 5.0
"""Cut-off of the velocity filter over the closed-loop bandwidth [-]: far enough to cost little phase."""


class ControllerGains(NamedTuple):
    """What the controller multiplies with, for one tick of ``period``.

    Attributes:
        position_gain: mass omega^2 [N/m].
        velocity_gain: 2 damping_ratio omega mass [N s/m].
        integral_gain: position_gain times the integral corner [N/(m s)].
        acceleration_gain: fed-forward mass [kg].
        velocity_keep: share of the filtered velocity that survives one tick [-].
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
    """What the controller remembers from tick to tick.

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
