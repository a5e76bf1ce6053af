"""The interval's linearisation is exact: against finite differences, for every parameter and model."""

from __future__ import annotations

import numpy as np
import pytest

from sgms_observer.estimators.interval import effort_slopes, predict_effort, simulate_interval
from sgms_observer.estimators.layout import apply_parameters, model_arrays, parameter_arrays
from sgms_observer.settings.axis import ESTIMABLE, EstimatorSettings, FrictionSettings

N_Z = 4
MODELS = [
    FrictionSettings(model="gms", element_damping=(3.0, 2.0, 1.0, 5.0)),
    FrictionSettings(reset="paper", smoothing_lambda=30.0, smoothing_zeta=0.9, smoothing_gamma=20.0,
                     element_damping=(3.0, 2.0, 1.0, 5.0)),
    FrictionSettings(reset="rate_independent", smoothing_lambda=30.0, smoothing_zeta=0.9, smoothing_gamma=20.0),
]  # fmt: skip


def end_of_interval(friction: FrictionSettings, x: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return (forces, effort) at the end for x = (forces, p), and the derivatives of both."""
    model = model_arrays(friction, 10.0, 0.3)
    parameters = parameter_arrays(EstimatorSettings(parameters=ESTIMABLE), model)
    p = x[N_Z:].copy()
    scalars, elements = np.zeros_like(model.scalars), np.zeros_like(model.elements)
    apply_parameters(model.scalars, model.elements, parameters.kinds, parameters.scale, p, scalars, elements)
    after, modes, a = np.zeros(N_Z), np.zeros(N_Z), np.zeros(N_Z)
    b, row = np.zeros((N_Z, len(p))), np.zeros(N_Z + len(p))
    count = len(velocity)
    simulate_interval(
        scalars, elements, parameters.kinds, p, velocity, np.full(count, 1e-4), np.full(count, 1.1),
        np.zeros((count, N_Z)), False, x[:N_Z].copy(), np.zeros(N_Z), after, modes, a, b,
    )  # fmt: skip
    effort_slopes(scalars, elements, parameters.kinds, parameters.scale, p, after, modes, velocity[-1], 0.7, 1.1, row)
    effort = predict_effort(scalars, elements, after, modes, velocity[-1], 0.7, 1.1)
    return after, np.array([effort]), a, b, row


@pytest.mark.parametrize("friction", MODELS, ids=["gms", "sgms-paper", "sgms-rate-independent"])
@pytest.mark.parametrize("speed", [2e-5, 4e-4, 3e-3])
def test_derivatives(friction: FrictionSettings, speed: float) -> None:
    velocity = speed * np.linspace(0.2, 1.0, 20)
    x = np.concatenate([[-0.2, 0.1, -0.1, 1.0], [1.1, 0.9, 1.05, 0.95, 1.2, 1.0, 0.3]])
    forces, _effort, a, b, row = end_of_interval(friction, x, velocity)
    for j in range(len(x)):
        small = 1e-6 * max(abs(x[j]), 0.1)
        low, high = x.copy(), x.copy()
        low[j] -= small
        high[j] += small
        f_low, u_low, *_rest = end_of_interval(friction, low, velocity)
        f_high, u_high, *_rest = end_of_interval(friction, high, velocity)
        slope = (f_high - f_low) / (2 * small)
        exact = np.where(np.arange(N_Z) == j, a, 0.0) if j < N_Z else b[:, j - N_Z]
        np.testing.assert_allclose(exact, slope, rtol=2e-4, atol=1e-5)
        # the effort's own dependence plus what goes through the forces at the end
        through = row[:N_Z] @ exact + (row[j] if j >= N_Z else 0.0)
        np.testing.assert_allclose(through, (u_high - u_low)[0] / (2 * small), rtol=2e-4, atol=1e-5)
    assert np.all(np.isfinite(forces))
