"""Baseline: pysindy's sequentially thresholded least squares over the same library (optional dependency)."""

from __future__ import annotations

from typing import Any

import numpy as np
from least_squares_bic import result, stack
from library import Candidate, Signals, nominal_columns

THRESHOLD = 0.02
"""Smallest share of the effort's rms a term has to carry; chosen on tuning seeds."""
LARGEST_NUMBER = 3


def best_of_each_name(s: Signals, listed: list[Candidate]) -> list[Candidate]:
    """Return one candidate per name: the grid point that fits the nominal residual best on its own."""
    goal = s.fine(s.nominal_residual)
    basis = np.linalg.qr(stack(s, []))[0]
    left = goal - basis @ (basis.T @ goal)
    best: dict[str, tuple[float, Candidate]] = {}
    for one in listed:
        new = np.linalg.qr(one.block - basis @ (basis.T @ one.block))[0]
        gain = float(np.sum((new.T @ left) ** 2))
        if one.name not in best or gain > best[one.name][0]:
            best[one.name] = (gain, one)
    return [one for _, one in best.values()]


def diagnose(main: Signals, holdouts: list[Signals], listed: list[Candidate]) -> dict[str, Any]:
    """Return a result in the schema of ``sgms diagnose``."""
    import pysindy

    chosen = best_of_each_name(main, listed)
    matrix = stack(main, [one.make for one in chosen])
    owner = ["nominal"] * len(nominal_columns(main)) + [one.name for one in chosen for _ in range(one.block.shape[1])]
    scale = np.sqrt(np.mean(matrix**2, axis=0)) + 1e-30
    unit = float(np.std(main.fine(main.u)))
    goal = main.fine(main.nominal_residual) / unit
    model = pysindy.SINDy(
        optimizer=pysindy.STLSQ(threshold=THRESHOLD, alpha=1.0e-3), feature_library=pysindy.IdentityLibrary()
    )
    model.fit(matrix / scale, t=main.period, x_dot=goal[:, None])
    weights = np.abs(model.coefficients()[0])
    strength: dict[str, float] = {}
    for name, weight in zip(owner, weights, strict=True):
        if name != "nominal" and weight > 0.0:
            strength[name] = strength.get(name, 0.0) + float(weight) ** 2
    names = sorted(strength, key=lambda name: -strength[name])[:LARGEST_NUMBER]
    return result(main, holdouts, [one for name in names for one in chosen if one.name == name])
