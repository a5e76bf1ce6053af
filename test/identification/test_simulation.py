"""Sensitivities of a simulated recording against finite differences."""

from __future__ import annotations

import numpy as np
import pytest

from sgms_observer.identification.problem import ElementShape, friction_and_slopes
from sgms_observer.settings.axis import FrictionSettings

KAPPA = np.array([12.0e6, 2.5e6, 0.71e6, 0.79e6])
LEVEL = 4.0 * np.array([0.067, 0.056, 0.047, 0.83])
SHARED = np.array([1.125, 1.0e-3, 12.5])


@pytest.mark.parametrize("model", ["sgms", "gms"])
@pytest.mark.parametrize("reset", ["paper", "rate_independent"])
def test_slopes_are_the_derivatives(model: str, reset: str) -> None:
    period = 2e-4
    time = period * np.arange(1500)
    position = 5e-6 * np.sin(2.0 * np.pi * 8.0 * time) + 2e-6 * np.sin(2.0 * np.pi * 31.0 * time)
    shape = ElementShape.of(FrictionSettings(smoothing_lambda=100.0, reset=reset), model)
    start = np.concatenate([KAPPA, LEVEL, SHARED])

    def force(theta: np.ndarray) -> np.ndarray:
        return friction_and_slopes(position, period, theta[:4], theta[4:8], theta[8:], shape)[0]

    _out, slopes = friction_and_slopes(position, period, KAPPA, LEVEL, SHARED, shape)
    for j in range(len(start)):
        step = 1e-7 * start[j]
        up, down = start.copy(), start.copy()
        up[j] += step
        down[j] -= step
        numeric = (force(up) - force(down)) / (2.0 * step)
        scale = np.max(np.abs(numeric)) + np.max(np.abs(slopes[:, j]))
        # a GMS element that enters slip in another sample has a kink there: judge the bulk of the samples
        agree = np.abs(numeric - slopes[:, j]) <= 1e-3 * scale + 1e-12
        assert np.mean(agree) > (0.98 if model == "gms" else 0.999), j
