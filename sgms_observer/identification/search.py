"""Bounded Levenberg-Marquardt on the normal equations, in logarithms of what is positive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sgms_observer.identification.problem import (
    DELAY,
    ELEMENTS,
    MASS,
    OFFSET,
    RATE,
    RELAXATION,
    RHO,
    V_S,
    VISCOUS,
    Parameters,
    Prepared,
    residual_and_jacobian,
)
from sgms_observer.identification.simulation import ElementShape

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

_LOWEST = {MASS: 1e-3, VISCOUS: 1e-4, RHO: 1.0, V_S: 1e-6, RATE: 1e-2}
_HIGHEST = {MASS: 1e5, VISCOUS: 1e6, RHO: 5.0, V_S: 1.0, RATE: 1e5}
_LARGEST_DELAY = 0.02
_SMALLEST_DEFLECTION = 3e-9  # of all of the friction [m]: below, no encoder tells an element from a step
_LARGEST_DEFLECTION = 1e-2
_OFFSET_SCALE = 1.0
_DELAY_SCALE = 1e-3
_LONGEST_RELAXATION = 0.01  # s
_MAX_DAMPING = 1e8


@dataclass(frozen=True)
class Fit:
    """Result of one search.

    Attributes:
        parameters: where it ended.
        cost: mean squared residual over the rows that taught [N^2].
        iterations: steps taken.
        is_converged: whether the last step was small enough.
    """

    parameters: Parameters
    cost: float
    iterations: int
    is_converged: bool


def to_search(parameters: Parameters) -> Floats:
    """Return the search variables: logarithms of all but offset, delay and relaxation."""
    values = parameters.vector()
    out = np.log(np.maximum(values, 1e-300))
    out[OFFSET] = values[OFFSET] / _OFFSET_SCALE
    out[[DELAY, RELAXATION]] = values[[DELAY, RELAXATION]] / _DELAY_SCALE
    return np.asarray(out)


def from_search(variables: Floats, like: Parameters) -> Parameters:
    """Return the parameters of search variables."""
    values = np.exp(np.clip(variables, -700.0, 700.0))
    values[OFFSET] = variables[OFFSET] * _OFFSET_SCALE
    values[[DELAY, RELAXATION]] = variables[[DELAY, RELAXATION]] * _DELAY_SCALE
    return like.with_vector(values)


def search_scale(parameters: Parameters) -> Floats:
    """Return d parameter / d search variable, by which a Jacobian's columns are multiplied."""
    scale = parameters.vector().copy()
    scale[OFFSET], scale[[DELAY, RELAXATION]] = _OFFSET_SCALE, _DELAY_SCALE
    return scale


def search_bounds(parameters: Parameters) -> tuple[Floats, Floats]:
    """Return lower and upper bounds of the search variables."""
    size = len(parameters.vector())
    low, high = np.full(size, -np.inf), np.full(size, np.inf)
    for index, value in _LOWEST.items():
        low[index] = np.log(value)
    for index, value in _HIGHEST.items():
        high[index] = np.log(value)
    low[DELAY], high[DELAY] = -_LARGEST_DELAY / _DELAY_SCALE, _LARGEST_DELAY / _DELAY_SCALE
    low[RELAXATION], high[RELAXATION] = 0.0, _LONGEST_RELAXATION / _DELAY_SCALE
    total = float(parameters.level.sum())
    n_z = parameters.count
    low[ELEMENTS + n_z :] = np.log(1e-5 * total)
    high[ELEMENTS + n_z :] = np.log(20.0 * total)
    low[ELEMENTS : ELEMENTS + n_z] = np.log(1e-3 * total / _LARGEST_DEFLECTION)
    high[ELEMENTS : ELEMENTS + n_z] = np.log(total / _SMALLEST_DEFLECTION)
    return low, high


def _normal_equations(
    data: Sequence[Prepared], masks: Sequence[Booleans], parameters: Parameters, shape: ElementShape
) -> tuple[float, Floats, Floats]:
    """Return mean squared residual, gradient and Gauss-Newton matrix in search variables."""
    scale = search_scale(parameters)
    size = len(scale)
    cost, gradient, matrix, rows = 0.0, np.zeros(size), np.zeros((size, size)), 0
    for piece, mask in zip(data, masks, strict=True):
        residual, jacobian = residual_and_jacobian(piece, parameters, shape)
        picked, slopes = residual[mask], jacobian[mask] * scale
        cost += float(picked @ picked)
        gradient += slopes.T @ picked
        matrix += slopes.T @ slopes
        rows += len(picked)
    return cost / rows, gradient / rows, matrix / rows


def search(
    data: Sequence[Prepared],
    masks: Sequence[Booleans],
    start: Parameters,
    shape: ElementShape,
    frozen: Sequence[int] = (RELAXATION,),
    iterations: int = 25,
    tolerance: float = 1e-4,
) -> Fit:
    """Minimise the mean squared force residual.

    Args:
        data: prepared recordings.
        masks: rows that teach, per recording.
        start: start values.
        shape: kind of model and its smoothing.
        frozen: indices of ``Parameters.vector`` that stay as they are.
        iterations: most steps.
        tolerance: stop when a step lowers the cost by less than this share, or moves no variable by more than it.

    Returns:
        The best point found.
    """
    low, high = search_bounds(start)
    free = np.array([j for j in range(len(low)) if j not in set(frozen) | ({RATE} if not shape.is_gms else set())])
    variables = to_search(start)
    variables[free] = np.clip(variables[free], low[free], high[free])
    parameters = from_search(variables, start)
    cost, gradient, matrix = _normal_equations(data, masks, parameters, shape)
    damping = 1e-3
    steps = 0
    while steps < iterations:
        steps += 1
        at_bound = ((variables <= low) & (gradient > 0.0)) | ((variables >= high) & (gradient < 0.0))
        moving = free[~at_bound[free]]
        block = matrix[np.ix_(moving, moving)]
        diagonal = np.maximum(np.diag(block), 1e-9 * float(np.max(np.diag(block))))
        step = np.zeros(len(variables))
        step[moving] = -np.linalg.solve(block + damping * np.diag(diagonal), gradient[moving])
        step = np.clip(step, -1.5, 1.5)
        trial = variables.copy()
        trial[moving] = np.clip(variables[moving] + step[moving], low[moving], high[moving])
        candidate = from_search(trial, start)
        new_cost, new_gradient, new_matrix = _normal_equations(data, masks, candidate, shape)
        if not new_cost < cost:
            damping *= 8.0
            if damping > _MAX_DAMPING:
                return Fit(parameters, cost, steps, True)
            continue
        gained = (cost - new_cost) / cost
        moved = float(np.max(np.abs(trial - variables)))
        variables, parameters, cost, gradient, matrix = trial, candidate, new_cost, new_gradient, new_matrix
        damping = max(0.2 * damping, 1e-9)
        if gained < tolerance * 0.1 or moved < tolerance:
            return Fit(parameters, cost, steps, True)
    return Fit(parameters, cost, steps, False)
