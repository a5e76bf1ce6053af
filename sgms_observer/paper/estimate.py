"""One estimator over one record: the friction as known at each instant, and the MHE's trajectory behind it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sgms_observer.estimators.estimator import Estimator, Results
from sgms_observer.estimators.interval import advance_forces, friction_force, level_at
from sgms_observer.estimators.layout import ATTRACTION, KAPPA, NU
from sgms_observer.estimators.memory import COUNT, HOLDS_MODES
from sgms_observer.filters.differentiator import Differentiator
from sgms_observer.filters.motion import Motion
from sgms_observer.friction.gms import gms_step_in_branch
from sgms_observer.jit import njit
from sgms_observer.observer.samples import Floats
from sgms_observer.paper.conditions import SAMPLE_PERIOD
from sgms_observer.settings.axis import EstimatorSettings, FilterSettings, FrictionSettings
from sim_plant.record import StageRecord


@dataclass(frozen=True)
class Estimate:
    """Friction over a record, row per sample.

    Args:
        live: the friction as known at each sample's own instant [N].
        trajectory: eq. 14's own estimate: the friction over each interval as optimised at the interval's end [N];
            known up to one interval (2 ms) and the filter's delay later. An EKF has none: then it is ``live``.
        stiffness: estimated kappa over the stage's.
        stiffness_std: its standard deviation.
        results: everything the estimator said.
    """

    live: Floats
    trajectory: Floats
    stiffness: Floats
    stiffness_std: Floats
    results: Results


def estimate(
    record: StageRecord,
    filter_settings: FilterSettings,
    settings: EstimatorSettings,
    friction: FrictionSettings,
    mass: float,
    stiffness_factor: float,
    with_trajectory: bool = True,
    process: Floats | None = None,
) -> Estimate:
    """Run filter and estimator over a record's measured position and effort.

    Args:
        record: the stage's record.
        filter_settings: block V.
        settings: block Z.
        friction: the estimator's model.
        mass: moving mass [kg].
        stiffness_factor: kappa of ``friction`` over the stage's.
        with_trajectory: also compute ``Estimate.trajectory``, which goes through the record interval by interval.
        process: variances of Q [N^2] instead of the settings' own, shape (n_z,).
    """
    differentiator = Differentiator(filter_settings, SAMPLE_PERIOD)
    motion = differentiator.step(record.stamp_ns, record.measured_position, record.control_effort)
    estimator = Estimator(settings, friction, mass)
    if process is not None:
        estimator.process[:] = process
    effort, factor = motion.effort.copy(), np.ones(len(record.time))
    if with_trajectory and settings.kind == "mhe":
        results, delayed = _interval_by_interval(estimator, motion, effort, factor)
        trajectory = np.interp(record.time, record.time - differentiator.delay, delayed)
    else:
        results = estimator.step(motion, effort, factor)
        trajectory = results.friction
    has_stiffness = "kappa" in settings.parameters
    column = settings.parameters.index("kappa") if has_stiffness else 0
    ones = np.ones(len(record.time))
    return Estimate(
        live=results.friction,
        trajectory=trajectory,
        stiffness=stiffness_factor * (results.parameters[:, column] if has_stiffness else ones),
        stiffness_std=stiffness_factor * (results.parameter_std[:, column] if has_stiffness else 0.0 * ones),
        results=results,
    )


def _interval_by_interval(
    estimator: Estimator, motion: Motion, effort: Floats, factor: Floats
) -> tuple[Results, Floats]:
    """Step through whole intervals and read the newest one's trajectory out of the window after each correction."""
    every = estimator.settings.correction_every
    start = int(np.argmax(motion.is_ready))
    edges = [0, start, *range(start + every, len(effort), every), len(effort)]
    tables, delayed = [], np.full(len(effort), np.nan)
    memory = estimator.memory  # views: they show what the estimator holds after each step
    for first, last in pairwise(edges):
        if first == last:
            continue
        block = slice(first, last)
        results = estimator.step(Motion(motion.table[block], motion.delay_samples), effort[block], factor[block])
        tables.append(results.table)
        newest = int(memory.flags[COUNT]) - 1
        if first >= start and last - first == every and newest >= 0:
            _friction_of_interval(
                memory.scalars, memory.elements, memory.forces[newest], memory.slips[newest],
                memory.velocity[newest], memory.period[newest], motion.velocity[block].copy(),
                memory.branches[newest], memory.flags[HOLDS_MODES] > 0.0, delayed[block],
            )  # fmt: skip
    known = np.flatnonzero(np.isfinite(delayed))
    delayed = np.interp(np.arange(len(effort)), known, delayed[known])
    return Results(np.concatenate(tables), results.n_z, results.n_p), delayed


@njit
def _friction_of_interval(
    scalars: Floats,
    elements: Floats,
    start: Floats,
    start_slip: Floats,
    step_velocity: Floats,
    period: Floats,
    velocity: Floats,
    branches: Floats,
    is_held: bool,
    friction: Floats,
) -> None:
    """Simulate one interval from its first node and write the friction at each of its samples."""
    force, slip = start.copy(), start_slip.copy()
    for k in range(velocity.shape[0]):
        if is_held:
            level = level_at(scalars, step_velocity[k], 1.0)
            for i in range(force.shape[0]):
                force[i] = gms_step_in_branch(
                    force[i], int(branches[k, i]), step_velocity[k], period[k], elements[KAPPA, i], elements[NU, i],
                    level, scalars[ATTRACTION],
                )[0]  # fmt: skip
        else:
            advance_forces(scalars, elements, force, slip, step_velocity[k], period[k], 1.0)
        friction[k] = friction_force(scalars, elements, force, slip, velocity[k], 1.0)
