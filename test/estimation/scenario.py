"""A known motion with GMS friction, and estimators to run over it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sgms_observer.estimators.estimator import Estimator, Results
from sgms_observer.filters.motion import Motion, known_motion
from sgms_observer.settings.axis import EstimatorSettings, FrictionSettings

PERIOD = 1e-4
MASS = 10.0
TABLE_STIFFNESS = np.array([12.0e6, 2.5e6, 0.71e6, 0.79e6])


@dataclass(frozen=True)
class Scenario:
    """n samples: the motion, the true friction [N] and the effort [N] without noise."""

    motion: Motion
    friction: np.ndarray
    effort: np.ndarray

    def run(self, estimator: Estimator, effort: np.ndarray, block: int | None = None) -> Results:
        """Run an estimator over it, in blocks of ``block`` samples or all at once."""
        n = len(effort)
        block = block or n
        tables = []
        for at in range(0, n, block):
            part = slice(at, min(at + block, n))
            motion = Motion(self.motion.table[part], 0)
            results = estimator.step(motion, effort[part], np.ones(part.stop - part.start))
            tables.append(results.table)
        return Results(np.concatenate(tables), results.n_z, results.n_p)


def sine(amplitude: float = 2e-4, seconds: float = 0.6, truth: FrictionSettings | None = None) -> Scenario:
    """The paper's motion (5 Hz), known exactly, with GMS friction unless told otherwise."""
    time = np.arange(round(seconds / PERIOD)) * PERIOD
    omega = 2 * np.pi * 5
    velocity = amplitude * omega * np.cos(omega * time)
    acceleration = -amplitude * omega**2 * np.sin(omega * time)
    motion = known_motion(np.full(len(time), PERIOD), velocity, acceleration)
    plant = Estimator(EstimatorSettings(kind="ekf"), truth or FrictionSettings(model="gms"), MASS)
    friction = plant.step(motion, np.full(len(time), np.nan), np.ones(len(time))).friction
    return Scenario(motion, friction.copy(), friction + MASS * acceleration)


def estimator(kind: str = "mhe", kappa: float = 1.0, friction: dict | None = None, **settings: object) -> Estimator:
    """An estimator whose stiffness is off by a factor."""
    model = FrictionSettings(element_stiffness=tuple(kappa * TABLE_STIFFNESS), **(friction or {}))
    return Estimator(EstimatorSettings(kind=kind, **settings), model, MASS)
