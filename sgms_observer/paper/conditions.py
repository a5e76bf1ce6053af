"""What the paper states of its simulation, and the choices for what it leaves open; one set for every cell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from sgms_observer.observer.samples import Floats
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
PROCESS_STD = 0.1  # Q: share of nu f_C per correction; the paper gives a number, 1e-2 nu, without a unit


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
