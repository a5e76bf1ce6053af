"""One tick of the simulated stage, written so that it can be translated: what ``sgms simulate`` runs."""

from __future__ import annotations

from typing import Any

from sgms_observer.effects.kernels import measured_position
from sim_plant.kernel import quantised, run_samples

MEASURED, FRICTION, EFFECT = range(3)
ENDS = 3


def stage_tick(
    constants: Any,
    friction: Any,
    effects: Any,
    user: Any,
    gains: Any,
    memory: Any,
    tick: int,
    tick_plan: Any,
    sample_plan: Any,
    effort: Any,
    other: Any,
    recorded: Any,
    element_force: Any,
    ends: Any,
) -> None:
    """Move the stage by one tick of its controller.

    Args:
        constants, friction, effects, user, gains, memory: as for ``run_samples``, with one tick per sample.
        tick: number of ticks since the start.
        tick_plan: reference and encoder noise of the tick, shape (4, 1).
        sample_plan: noise of the recorded effort and disturbance [N], shape (2, 1).
        effort: added to the controller's effort [N], shape (1,).
        other: velocity [m/s] and acceleration [m/s^2] of the other axis.
        recorded, element_force: written: what was at the tick's start.
        ends: written: measured position [m], friction [N] and force of the effects [N] at its end, shape (ENDS,).
    """
    run_samples(
        constants, friction, effects, user, gains, memory, tick, 0, tick_plan, sample_plan, effort, other, recorded,
        element_force,
    )  # fmt: skip
    position = memory.motion[0]
    if effects.kinds.shape[0] > 0:
        position = measured_position(effects.kinds, effects.p_at, effects.parameters, position)
    ends[MEASURED] = quantised(position, constants.resolution)
    total = friction.viscous * memory.motion[1] + memory.motion[3]
    for i in range(memory.force.shape[0]):
        total += memory.force[i]
    ends[FRICTION] = total
    ends[EFFECT] = memory.motion[4]
