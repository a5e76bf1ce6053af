"""The estimator of one axis: settings in, blocks of motion in, estimates out."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from sgms_observer.arrays import Bytes, Floats
from sgms_observer.estimators.block import (
    FRICTION,
    FRICTION_STD,
    INNOVATION,
    INNOVATION_STD,
    RESULT_SIZE,
    STATUS,
    estimate_block,
)
from sgms_observer.estimators.layout import COULOMB, NU, P_OFFSET, model_arrays, parameter_arrays
from sgms_observer.estimators.memory import EKF_NEXT, Memory, Sizes, Tuning, allocate, forget
from sgms_observer.filters.motion import Motion
from sgms_observer.settings.axis import EstimatorSettings, FrictionSettings

_MAX_ITERATIONS = 60
_CONVERGED = 1e-9
_REAL_TIME_TOLERANCE = 1e-12
_SMALLEST_PROCESS_STD = 1e-6  # N; zero process noise makes the weights of the window infinite


class Results(NamedTuple):
    """Estimates of a block of n samples; row i belongs to the stamp of sample i.

    Args:
        table: columns as in ``block`` [SI units], shape (n, RESULT_SIZE + 3 n_z + 2 n_p).
        n_z: number of elements.
        n_p: number of estimated parameters.
    """

    table: Floats
    n_z: int
    n_p: int

    @property
    def friction(self) -> Floats:
        """Estimated friction [N]."""
        return self.table[:, FRICTION]

    @property
    def friction_std(self) -> Floats:
        """Its standard deviation, eq. 13 [N]."""
        return self.table[:, FRICTION_STD]

    @property
    def innovation(self) -> Floats:
        """Measured minus predicted effort [N]; NaN between corrections."""
        return self.table[:, INNOVATION]

    @property
    def innovation_std(self) -> Floats:
        """Its predicted standard deviation [N]; NaN between corrections."""
        return self.table[:, INNOVATION_STD]

    @property
    def status(self) -> Bytes:
        """``Status`` codes."""
        return self.table[:, STATUS].astype(np.uint8)

    @property
    def element_force(self) -> Floats:
        """Element forces [N], shape (n, n_z)."""
        return self.table[:, RESULT_SIZE : RESULT_SIZE + self.n_z]

    @property
    def element_deflection(self) -> Floats:
        """Element deflections [m], shape (n, n_z)."""
        return self.table[:, RESULT_SIZE + self.n_z : RESULT_SIZE + 2 * self.n_z]

    @property
    def parameters(self) -> Floats:
        """Estimated parameters in SI units, kappa as a share of its nominal value, shape (n, n_p)."""
        start = RESULT_SIZE + 3 * self.n_z
        return self.table[:, start : start + self.n_p]

    @property
    def parameter_std(self) -> Floats:
        """Their standard deviations, shape (n, n_p)."""
        return self.table[:, RESULT_SIZE + 3 * self.n_z + self.n_p :]


class Estimator:
    """EKF(z), EKF(z,p), MHE(z) or MHE(z,p) on the GMS or S-GMS model, eqs 11-14.

    Args:
        settings: checked estimator settings.
        friction: checked friction settings.
        mass: moving mass [kg].

    Attributes:
        fill: does ``step`` with ``Motion.table`` as its first argument, into the table of ``make_room``, its last.
    """

    def __init__(self, settings: EstimatorSettings, friction: FrictionSettings, mass: float) -> None:
        self.settings = settings
        self.model = model_arrays(friction, mass)
        self.parameters = parameter_arrays(settings, self.model)
        is_mhe = settings.kind == "mhe"
        self.sizes = Sizes(
            n_z=len(friction.element_stiffness),
            n_p=len(self.parameters.kinds),
            horizon=settings.horizon if is_mhe else 1,
            samples=settings.correction_every,
        )
        share = self.model.elements[NU] * self.model.scalars[COULOMB]
        relative = np.full(self.sizes.n_p, settings.parameter_initial_std)
        relative[self.parameters.kinds == P_OFFSET] = 1.0
        self.tuning = Tuning(
            is_mhe=is_mhe,
            iterations=_MAX_ITERATIONS if settings.converge else settings.iterations,
            tolerance=_CONVERGED if settings.converge else _REAL_TIME_TOLERANCE,
            variance=settings.measurement_std**2,
            walk=settings.parameter_walk**2,
            beta=settings.state_bound,
            outlier_nis=settings.outlier_nis,
            holds_modes=settings.gms_modes == "predicted" and friction.model == "gms",
        )
        process = np.maximum(settings.process_std * share, _SMALLEST_PROCESS_STD) ** 2
        initial = np.concatenate([(settings.initial_std * share) ** 2, relative**2])
        self.flat = allocate(self.sizes, self.tuning, (*self.model, *self.parameters, process, initial))
        self._width = RESULT_SIZE + 3 * self.sizes.n_z + 2 * self.sizes.n_p
        self.fill: Callable[..., None] = partial(estimate_block, self.flat)

    @property
    def process(self) -> Floats:
        """Variances of Q per interval [N^2], shape (n_z,); a view that may be written to."""
        return self.memory.process

    @property
    def initial(self) -> Floats:
        """Initial variances of (element forces, p), shape (n_z + n_p,); a view that may be written to."""
        return self.memory.initial

    @property
    def memory(self) -> Memory:
        """Return views into the memory of the estimator."""
        return Memory(self.flat)

    def reset(self) -> None:
        """Forget everything, including the estimated parameters."""
        forget(self.flat)

    def miss_deadline(self) -> None:
        """Let the EKF do the next correction."""
        self.flat[EKF_NEXT] = 1.0

    def step(self, motion: Motion, effort: Floats, factor: Floats) -> Results:
        """Process a block of motion.

        Args:
            motion: n rows of block V.
            effort: effort at each row's instant less the effects' forces [N], NaN where there is none, shape (n,).
            factor: the effects' factor on the Stribeck level [-], shape (n,).

        Returns:
            Estimates, one row per sample.
        """
        results = self.make_room(len(motion.table))
        self.fill(motion.table, effort, factor, results.table)
        return results

    def make_room(self, count: int) -> Results:
        """Return results for ``fill``.

        Args:
            count: number of samples.
        """
        return Results(np.empty((count, self._width)), self.sizes.n_z, self.sizes.n_p)
