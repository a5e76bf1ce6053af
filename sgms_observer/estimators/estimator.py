"""The estimator of one axis: settings in, blocks of motion in, estimates out."""

from __future__ import annotations

import numpy as np

from sgms_observer.estimators.block import Results, Steps, Tuning, estimate_block
from sgms_observer.estimators.layout import (
    COULOMB,
    KAPPA,
    NU,
    P_OFFSET,
    Floats,
    model_arrays,
    parameter_arrays,
)
from sgms_observer.estimators.memory import EKF_NEXT, FLAGS_SIZE, STARTED, Memory, Sizes, allocate, views
from sgms_observer.settings.friction import FrictionSettings
from sgms_observer.settings.observer import EstimatorSettings

_MOST_ITERATIONS = 60
_CONVERGED = 1e-9
_REAL_TIME_TOLERANCE = 1e-12
_SMALLEST_PROCESS_STD = 1e-6  # N; a model without any doubt makes the window's weights infinite


class Estimator:
    """EKF(z), EKF(z,p), MHE(z) or MHE(z,p) on the GMS or S-GMS model, eqs 11-14.

    Args:
        settings: checked estimator settings.
        friction: checked friction settings.
        mass: moving mass [kg].
        offset: known constant force [N].
        sample_period: nominal sample period [s].
    """

    def __init__(
        self,
        settings: EstimatorSettings,
        friction: FrictionSettings,
        mass: float,
        offset: float,
        sample_period: float,
    ) -> None:
        self.settings = settings
        self.sample_period = sample_period
        self.model = model_arrays(friction, mass, offset)
        self.parameters = parameter_arrays(settings, self.model)
        is_mhe = settings.kind == "mhe"
        self.sizes = Sizes(
            n_z=len(friction.element_stiffness),
            n_p=len(self.parameters.kinds),
            horizon=settings.horizon if is_mhe else 1,
            samples=settings.correction_every,
        )
        share = self.model.elements[NU] * self.model.scalars[COULOMB]
        self.process = np.maximum(settings.process_std * share, _SMALLEST_PROCESS_STD) ** 2
        relative = np.full(self.sizes.n_p, settings.parameter_initial_std)
        relative[self.parameters.kinds == P_OFFSET] = 1.0
        self.initial = np.concatenate([(settings.initial_std * share) ** 2, relative**2])
        self.tuning = Tuning(
            is_mhe=is_mhe,
            correction_every=settings.correction_every,
            horizon=self.sizes.horizon,
            iterations=_MOST_ITERATIONS if settings.converge else settings.iterations,
            tolerance=_CONVERGED if settings.converge else _REAL_TIME_TOLERANCE,
            variance=settings.measurement_std**2,
            walk=settings.parameter_walk**2,
            beta=settings.state_bound,
            outlier_nis=settings.outlier_nis,
        )
        self._flat = allocate(self.sizes)

    @property
    def memory(self) -> Memory:
        """Return views into everything the estimator remembers."""
        return views(self._flat, *self.sizes)[0]

    def reset(self) -> None:
        """Forget everything, the parameters learnt included."""
        self._flat[:] = 0.0

    def miss_deadline(self) -> None:
        """Leave the next correction to the EKF."""
        self._flat[EKF_NEXT] = 1.0

    @property
    def is_started(self) -> bool:
        """Return whether any sample has been taken in since the last reset."""
        return bool(self._flat[:FLAGS_SIZE][STARTED])

    def element_stiffness(self, parameters: Floats) -> Floats:
        """Element stiffness that belongs to estimated parameters.

        Args:
            parameters: estimated p in SI units, rows as in ``Results.parameters``; shape (n, n_p).

        Returns:
            kappa [N/m], shape (n, n_z).
        """
        factor = np.ones(len(parameters))
        for j, kind in enumerate(self.settings.parameters):
            if kind == "kappa":
                factor = parameters[:, j]
        stiffness: Floats = factor[:, None] * self.model.elements[KAPPA][None, :]
        return stiffness

    def step(self, steps: Steps) -> Results:
        """Take in a block of motion.

        Args:
            steps: the block; n rows.

        Returns:
            Estimates, one row per sample.
        """
        count = len(steps.period)
        n_z, n_p = self.sizes.n_z, self.sizes.n_p
        results = Results(
            friction=np.empty(count),
            friction_std=np.empty(count),
            element_force=np.empty((count, n_z)),
            slip=np.empty((count, n_z)),
            parameters=np.empty((count, n_p)),
            parameter_std=np.empty((count, n_p)),
            innovation=np.empty(count),
            innovation_std=np.empty(count),
            status=np.empty(count, dtype=np.int64),
        )
        estimate_block(
            self._flat,
            self.model,
            self.parameters,
            self.process,
            self.initial,
            self.tuning,
            self.sample_period,
            steps,
            results,
        )
        return results
