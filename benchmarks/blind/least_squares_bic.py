"""Baseline: forward selection by least squares and the Bayesian information criterion, up to three effects."""

from __future__ import annotations

from typing import Any

import numpy as np
from library import Candidate, Columns, Signals, nominal_columns

from sgms_observer.arrays import Floats

LARGEST_NUMBER = 3


def stack(s: Signals, columns: list[Columns]) -> Floats:
    """Return the nominal columns and those of ``columns``, filtered and thinned."""
    rows = nominal_columns(s) + [one for make in columns for one in make(s)]
    return np.stack([s.fine(row) for row in rows], axis=1)


def rest(residual: Floats, matrix: Floats) -> tuple[Floats, Floats]:
    """Return the least-squares coefficients and what is left."""
    scale = np.sqrt(np.mean(matrix**2, axis=0)) + 1e-30
    coefficients = np.linalg.lstsq(matrix / scale, residual, rcond=1e-10)[0] / scale
    return coefficients, residual - matrix @ coefficients


def select(s: Signals, listed: list[Candidate]) -> list[Candidate]:
    """Return the candidates that the criterion takes, in its order."""
    goal = s.fine(s.nominal_residual)
    taken: list[Candidate] = []
    basis = np.linalg.qr(stack(s, []))[0]
    left = goal - basis @ (basis.T @ goal)
    while len(taken) < LARGEST_NUMBER:
        gains = []
        for one in listed:
            new = np.linalg.qr(one.block - basis @ (basis.T @ one.block))[0]
            drop = np.log(np.sum(left**2) / np.sum((left - new @ (new.T @ left)) ** 2))
            gains.append(goal.size * drop - one.cost * np.log(goal.size))
        best = listed[int(np.argmax(gains))]
        if max(gains) <= 0.0:
            break
        taken.append(best)
        listed = [one for one in listed if one.name != best.name]
        basis = np.linalg.qr(np.concatenate((basis, best.block), axis=1))[0]
        left = goal - basis @ (basis.T @ goal)
    return taken


def diagnose(main: Signals, holdouts: list[Signals], listed: list[Candidate]) -> dict[str, Any]:
    """Return a result in the schema of ``sgms diagnose``."""
    return result(main, holdouts, select(main, listed))


def result(main: Signals, holdouts: list[Signals], taken: list[Candidate]) -> dict[str, Any]:
    """Fit on the main recording, judge on the held-out ones, and write both in the schema of ``sgms diagnose``."""
    gaps = []
    names = [one.name for one in taken]
    for columns in ([], [one.make for one in taken]):
        coefficients, _ = rest(main.fine(main.nominal_residual), stack(main, columns))
        left = [s.fine(s.nominal_residual) - stack(s, columns) @ coefficients for s in holdouts]
        effort = np.concatenate([s.fine(s.u) for s in holdouts])
        gaps.append(100.0 * float(np.sqrt(np.mean(np.concatenate(left) ** 2) / np.mean(effort**2))))
    return {
        "schema": 1,
        "verdict": "effect_found" if names else "no_effect",
        "gap": {"before": gaps[0], "after": gaps[1], "unit": "% of rms effort", "on": "held-out"},
        "effects": [{"name": name, "parameters": {}, "std_error": {}, "alternatives": []} for name in names],
    }
