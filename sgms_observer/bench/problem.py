"""The estimation problem that is timed, window after window, and the stages of one correction as calls of their own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.estimators import memory as at
from sgms_observer.estimators.block import advance, restart, start_interval
from sgms_observer.estimators.descent import iterate
from sgms_observer.estimators.estimator import Estimator
from sgms_observer.estimators.memory import vector
from sgms_observer.estimators.mhe import append_interval, slide_window, store_newest
from sgms_observer.filters.motion import known_motion
from sgms_observer.jit import njit_bare
from sgms_observer.settings.axis import EstimatorSettings, FrictionSettings

PERIOD = 1e-4  # s
PER_INTERVAL = 20  # samples from one correction to the next
MASS = 10.0  # kg
AMPLITUDE, FREQUENCY = 2e-4, 5.0  # m, Hz
NOISE = 0.1  # N, standard deviation of the measured effort; R of the paper
SEED = 1
WINDOWS = 397  # windows that are timed
_RUN_IN = 20  # corrections before them, at least
_STIFFNESS_ERROR = 0.8  # the estimator starts with this share of the true stiffness

_TABLE_I = FrictionSettings()


def elements(n_z: int) -> FrictionSettings:
    """Return friction with so many elements: Table I for four, else stiffness spread over the same range."""
    if n_z == len(_TABLE_I.element_stiffness):
        return FrictionSettings(reset="paper")
    stiffness = np.geomspace(1.2e7, 7e5, n_z) * 4.0 / n_z
    share = np.arange(1.0, n_z + 1.0)
    return FrictionSettings(
        reset="paper",
        element_stiffness=tuple(stiffness.tolist()),
        element_fraction=tuple((share / share.sum()).tolist()),
        element_damping=(0.0,) * n_z,
    )


@dataclass(frozen=True)
class Problem:
    """A recording and the estimator that runs over it.

    Attributes:
        velocity: of each sample [m/s], shape (n,).
        acceleration: of each sample [m/s^2], shape (n,).
        effort: measured, with noise [N], shape (n,).
        friction: the estimator's friction, its stiffness off.
        horizon: intervals N.
    """

    velocity: Floats
    acceleration: Floats
    effort: Floats
    friction: FrictionSettings
    horizon: int

    def estimator(self) -> Estimator:
        """Return a moving horizon estimator of the element forces and the stiffness, started."""
        settings = EstimatorSettings(
            kind="mhe", parameters=("kappa",), horizon=self.horizon, correction_every=PER_INTERVAL,
            measurement_std=NOISE,
        )  # fmt: skip
        estimator = Estimator(settings, self.friction, MASS)
        restart(estimator.flat, False)
        return estimator

    @property
    def run_in(self) -> int:
        """Return the number of corrections before the window is full and has settled."""
        return max(_RUN_IN, self.horizon)

    @property
    def intervals(self) -> int:
        """Return the number of whole intervals in the recording."""
        return len(self.effort) // PER_INTERVAL

    def windows(self, estimator: Estimator) -> Iterator[tuple[int, bool]]:
        """Lead an estimator to one window after another, each with its newest measurement taken in.

        The caller improves the estimate; the estimator then continues from it.

        Args:
            estimator: from ``estimator``.

        Yields:
            Number of the window's newest sample, and whether the window is full and past the run-in.
        """
        flat = estimator.flat
        for k in range(self.intervals):
            for i in range(k * PER_INTERVAL, (k + 1) * PER_INTERVAL):
                predict(flat, self.velocity[i], PERIOD)
            take_in(flat, self.effort[i], self.velocity[i], self.acceleration[i])
            yield i, k >= self.run_in
            finish(flat)


def make_problem(n_z: int = 4, horizon: int = 4, windows: int = WINDOWS, seed: int = SEED) -> Problem:
    """Return the problem: GMS friction as the truth, S-GMS with 20 % too soft elements in the estimator.

    Args:
        n_z: number of elements.
        horizon: intervals N.
        windows: how many full windows are timed.
        seed: of the noise.
    """
    count = PER_INTERVAL * (windows + max(_RUN_IN, horizon))
    omega = 2.0 * np.pi * FREQUENCY
    time = PERIOD * np.arange(count)
    velocity = AMPLITUDE * omega * np.cos(omega * time)
    acceleration = -AMPLITUDE * omega**2 * np.sin(omega * time)
    truth = elements(n_z)
    one = np.ones(count)
    # an EKF without measurements is the friction model alone
    model = Estimator(
        EstimatorSettings(kind="ekf", correction_every=PER_INTERVAL),
        FrictionSettings(
            model="gms",
            element_stiffness=truth.element_stiffness,
            element_fraction=truth.element_fraction,
            element_damping=truth.element_damping,
        ),
        MASS,
    )
    true_friction = model.step(known_motion(PERIOD * one, velocity, acceleration), np.full(count, np.nan), one).friction
    effort = true_friction + MASS * acceleration + np.random.default_rng(seed).normal(0.0, NOISE, count)
    softer = FrictionSettings(
        reset=truth.reset,
        element_stiffness=tuple(_STIFFNESS_ERROR * kappa for kappa in truth.element_stiffness),
        element_fraction=truth.element_fraction,
        element_damping=truth.element_damping,
    )
    return Problem(velocity, acceleration, effort, softer, horizon)


@njit_bare
def predict(flat: Floats, velocity: float, period: float) -> None:
    """Predict one sample ahead (eq. 11a), with its derivatives.

    Args:
        flat: the estimator's memory; overwritten.
        velocity: velocity over the step [m/s].
        period: the step [s].
    """
    advance(flat, velocity, period, 1.0)


@njit_bare
def take_in(flat: Floats, effort: float, velocity: float, acceleration: float) -> None:
    """Slide a full window (arrival cost) and append the running interval with its measurement.

    Args:
        flat: the estimator's memory; overwritten.
        effort: measured effort [N].
        velocity: velocity there [m/s].
        acceleration: acceleration there [m/s^2].
    """
    record = vector(flat, at.RECORD)
    record[at.EFFORT], record[at.VELOCITY], record[at.ACCELERATION] = effort, velocity, acceleration
    record[at.FACTOR], record[at.IS_USED] = 1.0, 1.0
    if flat[at.COUNT] >= flat[at.HORIZON]:
        slide_window(flat)
    append_interval(flat)


@njit_bare
def improve(flat: Floats) -> int:
    """One real-time iteration on the window as it stands: solve, step with a search along it, relinearise.

    Args:
        flat: the estimator's memory; overwritten.

    Returns:
        As ``descent.iterate``.
    """
    return iterate(flat)


@njit_bare
def finish(flat: Floats) -> None:
    """Take the window's newest node as the estimate and begin the next interval there."""
    store_newest(flat)
    start_interval(flat)
