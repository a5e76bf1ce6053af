"""What the paper states of its simulation, choices for what it leaves open, and one estimator over one such record."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.estimators.estimator import Estimator, Results
from sgms_observer.estimators.interval import advance_forces, friction_force, level_at
from sgms_observer.estimators.layout import ATTRACTION, KAPPA, NU
from sgms_observer.estimators.memory import COUNT, HOLDS_MODES
from sgms_observer.filters.differentiator import Differentiator
from sgms_observer.filters.motion import Motion
from sgms_observer.friction.gms import gms_step_in_branch
from sgms_observer.jit import njit
from sgms_observer.settings.axis import (
    AxisSettings,
    ControllerSettings,
    EstimatorSettings,
    FilterSettings,
    FrictionSettings,
    ReferenceSettings,
    StageSettings,
)
from sim_plant.record import StageRecord
from sim_plant.stage import SimulatedStage

SAMPLE_PERIOD = 1.0e-4  # s, "system update rate of 0.1 ms"
SINE_PERIOD = 0.2  # s, 5 Hz
ROWS = {"minus20": 0.8, "plus20": 1.2}  # kappa in the estimator over kappa of the stage
MODELS = ("gms", "sgms")
ESTIMATORS = {"ekf_z": ("ekf", ()), "mhe_z": ("mhe", ()), "mhe_zp": ("mhe", ("kappa",))}
PAPER = {
    "minus20": {
        "gms": {"ekf_z": 1.71, "mhe_z": 2.59, "mhe_zp": 2.52},
        "sgms": {"ekf_z": 1.65, "mhe_z": 1.51, "mhe_zp": 1.49},
    },
    "plus20": {
        "gms": {"ekf_z": 1.52, "mhe_z": 1.09, "mhe_zp": 1.23},
        "sgms": {"ekf_z": 1.56, "mhe_z": 0.96, "mhe_zp": 0.93},
    },
}

Step = Callable[[], None]
"""Called after every run of an estimator, by those who count them."""

LOWPASS = FilterSettings(kind="lowpass", cutoff=500.0, align_effort=True)
LOWPASS_RAW_EFFORT = FilterSettings(kind="lowpass", cutoff=500.0, align_effort=False)

PROCESS_STD = 0.1  # Q: share of nu f_C per correction; the paper gives a number, 1e-2 nu, without a unit


@dataclass(frozen=True)
class Stage:
    """What the paper does not state of its stage, and the noise.

    Args:
        mass: moving mass [kg].
        bandwidth: of the position controller [Hz].
        damping_ratio: of the closed loop.
        noise: standard deviation of the white noise on every published effort [N].
    """

    mass: float = 10.0
    bandwidth: float = 100.0
    damping_ratio: float = 0.7
    noise: float = 0.1


CHOSEN = Stage()


def fewer(seeds: int) -> int:
    """Return how many noise seeds serve for what is only compared."""
    return max(2, seeds // 4)


def simulate(stage: Stage, periods: int, seed: int) -> StageRecord:
    """Run the GMS stage of Table I on the sine."""
    axis = AxisSettings(
        mass=stage.mass,
        friction=FrictionSettings(model="gms"),
        stage=StageSettings(
            controller=ControllerSettings(bandwidth=stage.bandwidth, damping_ratio=stage.damping_ratio),
            reference=ReferenceSettings(kind="sine", amplitude=2.0e-4, frequency=1.0 / SINE_PERIOD),
            force_noise=stage.noise,
            seed=seed,
        ),
    )
    return SimulatedStage(axis, SAMPLE_PERIOD).step(round(periods * SINE_PERIOD / SAMPLE_PERIOD) + 1)


def estimator_friction(model: str, stiffness_factor: float) -> FrictionSettings:
    """Return Table I with every kappa times a factor, for the estimator; the reset is eq. 7 as printed."""
    table = FrictionSettings(model=model, reset="paper")
    return replace(table, element_stiffness=tuple(stiffness_factor * kappa for kappa in table.element_stiffness))


def estimator_settings(
    estimator: str, process_std: float = PROCESS_STD, gms_modes: str = "predicted"
) -> EstimatorSettings:
    """Return the settings of one column of Table II.

    Args:
        estimator: ``ekf_z``, ``mhe_z`` or ``mhe_zp``.
        process_std: Q, as a share of nu f_C.
        gms_modes: ``predicted``, the paper's a-priori rules for a GMS model inside the MHE, or ``simulated``.
    """
    kind, parameters = ESTIMATORS[estimator]
    return EstimatorSettings(
        kind=kind, parameters=parameters, correction_every=20, horizon=4, iterations=2, measurement_std=0.1,
        process_std=process_std, gms_modes=gms_modes,
    )  # fmt: skip


def nrmse(record: StageRecord, friction: Floats, period: int) -> float:
    """Return the error over one period of the sine, over the range of the true friction in it [%].

    Args:
        record: the stage's record.
        friction: estimate at every sample of it [N].
        period: which period, 1 for the first.
    """
    samples = round(SINE_PERIOD / SAMPLE_PERIOD)
    span = slice((period - 1) * samples, period * samples)
    truth = record.friction[span]
    error = friction[span] - truth
    return float(100.0 * np.sqrt(np.mean(error * error)) / np.ptp(truth))


@dataclass(frozen=True)
class Estimate:
    """Friction over a record, row per sample.

    Args:
        live: the friction as known at each sample's own instant [N].
        trajectory: eq. 14's own estimate: the friction over each interval as optimised at the interval's end [N];
            known up to one interval (2 ms) and the filter's delay later. An EKF has none: then it is ``live``.
        stiffness: estimated kappa over the stage's.
        results: everything the estimator said.
    """

    live: Floats
    trajectory: Floats
    stiffness: Floats
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
                memory.velocities[newest], memory.periods[newest], motion.velocity[block].copy(),
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
