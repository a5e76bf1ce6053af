"""Bounded Levenberg-Marquardt on the normal equations, in logarithms of positive parameters and scaled units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sgms_observer.arrays import Booleans, Floats, Ints
from sgms_observer.errors import DataError
from sgms_observer.identification.prepared import BUILD_UP_SHARE, Prepared
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
    ElementShape,
    Parameters,
    residual_and_jacobian,
)

MIN_STEPS_OF_TRAVEL = 20.0
"""Travel over the smallest slip deflection that can be seen, below which nothing can be identified."""
_NOISES = 1.5
"""Smallest slip deflection over the position noise: an element that slips earlier looks like a step."""
_FINEST = 1.0e-7
"""The same over the travel, for recordings without noise; it bounds the size of the problem."""
_SHARES = (1.0e-6, 1.0e2)
"""Smallest and largest mass and viscous coefficient, over the values that would need the whole effort."""
_LOWEST = {RHO: 1.0, RATE: 1e-2}
_HIGHEST = {RHO: 5.0, RATE: 1e5}
_V_S_SHARES = (2.0e-5, 1.0)
"""Smallest and largest Stribeck velocity over the largest velocity: a larger one is not identifiable."""
_SMALLEST_SHARE = 0.3
"""Smallest slip deflection of the whole friction, over the smallest one that the encoder resolves."""
_LARGEST_SHARE = 0.1
"""Largest slip deflection of the whole friction, over the travel."""
_LARGEST_DELAY = 0.02
_DELAY_SCALE = 1e-3
_LONGEST_RELAXATION = 0.01  # s
_MAX_DAMPING = 1e8


@dataclass(frozen=True)
class Scales:
    """Typical sizes.

    Attributes:
        effort: rms effort [N].
        velocity: rms velocity [m/s].
        top_velocity: largest velocity [m/s].
        acceleration: rms acceleration [m/s^2].
        travel: largest range of the position within one piece, before it was cut into parts [m].
        smallest: smallest slip deflection above the position noise [m].
        period: longest sample period of the simulation [s].
    """

    effort: float
    velocity: float
    top_velocity: float
    acceleration: float
    travel: float
    smallest: float
    period: float

    def largest(self, stated: float = 0.0) -> float:
        """Return the largest slip deflection of an element [m].

        Args:
            stated: largest one that the start settings state [m]; 0 for that of the start grid.
        """
        return max(BUILD_UP_SHARE * self.travel, 10.0 * self.smallest, min(stated, self.travel))

    @property
    def mass(self) -> float:
        """Mass that would need all of the effort [kg]."""
        return self.effort / self.acceleration

    @property
    def viscous(self) -> float:
        """Viscous coefficient that would need all of the effort [N s/m]."""
        return self.effort / self.velocity


def scales_of(data: Sequence[Prepared]) -> Scales:
    """Return the typical sizes of prepared recordings.

    Raises:
        DataError: if the axis hardly moves, or the effort is zero.
    """
    travel = max(piece.travel for piece in data)
    noise = min(piece.noise for piece in data)
    smallest = max(_NOISES * noise, _FINEST * travel)
    if not travel >= MIN_STEPS_OF_TRAVEL * smallest or travel <= 0.0:
        raise DataError(
            f"the axis moves by {travel:.2g} {data[0].unit} only, {travel / max(noise, 1e-300):.3g} times the noise and"
            f" resolution of its position ({noise:.2g} {data[0].unit}); identification needs sliding and reversals:"
            " record longer strokes, or use a finer encoder"
        )
    effort = _rms([piece.effort(piece.time)[piece.usable] for piece in data])
    if not effort > 0.0:
        raise DataError("control_effort is zero throughout; record the effort that drives the axis")
    velocities = [piece.velocity[piece.usable] for piece in data]
    return Scales(
        effort,
        _rms(velocities),
        max(float(np.max(np.abs(values), initial=0.0)) for values in velocities),
        _rms([piece.acceleration[piece.usable] for piece in data]),
        travel,
        smallest,
        max(piece.period for piece in data),
    )


def _rms(parts: Sequence[np.ndarray]) -> float:
    """Return the root of the mean square over all parts."""
    return float(np.sqrt(np.mean(np.concatenate(list(parts)) ** 2)))


@dataclass(frozen=True)
class Fit:
    """Result of one search.

    Attributes:
        parameters: the solution.
        cost: mean squared residual over the fitted rows [N^2].
        iterations: number of steps.
        is_converged: whether the last step met the tolerance.
    """

    parameters: Parameters
    cost: float
    iterations: int
    is_converged: bool


def to_search(parameters: Parameters, scales: Scales) -> Floats:
    """Return the search variables: logarithms of all but offset, delay, relaxation and the effects' parameters."""
    values = parameters.vector()
    out = np.log(np.maximum(values, 1e-300))
    out[OFFSET] = values[OFFSET] / scales.effort
    out[[DELAY, RELAXATION]] = values[[DELAY, RELAXATION]] / _DELAY_SCALE
    out[parameters.first_effect :] = parameters.effects.values / parameters.effects.scale
    return np.asarray(out)


def from_search(variables: Floats, template: Parameters, scales: Scales) -> Parameters:
    """Return the parameters of search variables."""
    values = np.exp(np.clip(variables, -700.0, 700.0))
    values[OFFSET] = variables[OFFSET] * scales.effort
    values[[DELAY, RELAXATION]] = variables[[DELAY, RELAXATION]] * _DELAY_SCALE
    values[template.first_effect :] = variables[template.first_effect :] * template.effects.scale
    return template.with_vector(values)


def search_scale(parameters: Parameters, scales: Scales) -> Floats:
    """Return d parameter / d search variable, by which a Jacobian's columns are multiplied."""
    out = parameters.vector().copy()
    out[OFFSET], out[[DELAY, RELAXATION]] = scales.effort, _DELAY_SCALE
    out[parameters.first_effect :] = parameters.effects.scale
    return out


def search_bounds(parameters: Parameters, scales: Scales) -> tuple[Floats, Floats]:
    """Return lower and upper bounds of the search variables."""
    size = len(parameters.vector())
    low, high = np.full(size, -np.inf), np.full(size, np.inf)
    for index, value in _LOWEST.items():
        low[index] = np.log(value)
    for index, value in _HIGHEST.items():
        high[index] = np.log(value)
    for index, most in ((MASS, scales.mass), (VISCOUS, scales.viscous)):
        low[index], high[index] = np.log(_SHARES[0] * most), np.log(_SHARES[1] * most)
    low[V_S], high[V_S] = (np.log(share * scales.top_velocity) for share in _V_S_SHARES)
    low[DELAY], high[DELAY] = 0.0, max(_LARGEST_DELAY, 2.0 * scales.period) / _DELAY_SCALE
    low[RELAXATION], high[RELAXATION] = 0.0, _LONGEST_RELAXATION / _DELAY_SCALE
    total = float(parameters.level.sum())
    n_z, first = parameters.count, parameters.first_effect
    low[ELEMENTS + n_z : first] = np.log(1e-5 * total)
    high[ELEMENTS + n_z : first] = np.log(20.0 * total)
    low[ELEMENTS : ELEMENTS + n_z] = np.log(1e-3 * total / (_LARGEST_SHARE * scales.travel))
    high[ELEMENTS : ELEMENTS + n_z] = np.log(total / (_SMALLEST_SHARE * scales.smallest))
    effects = parameters.effects
    low[first:], high[first:] = effects.low / effects.scale, effects.high / effects.scale
    return low, high


def _with_limited_deflections(variables: Floats, n_z: int, largest: float) -> Floats:
    """Return search variables in which no element slips later: its stiffness is higher where it would.

    Args:
        variables: search variables.
        n_z: number of elements.
        largest: largest slip deflection at rest [m].
    """
    out = variables.copy()
    stiffness = out[ELEMENTS : ELEMENTS + n_z]
    stiffness[:] = np.maximum(stiffness, _softest(variables, n_z, largest))
    return out


def _softest(variables: Floats, n_z: int, largest: float) -> Floats:
    """Return the logarithm of the stiffness with which each element slips at the largest deflection."""
    return np.asarray(variables[ELEMENTS + n_z : ELEMENTS + 2 * n_z] + max(variables[RHO], 0.0) - np.log(largest))


def _directions(moving: Ints, limited: Ints, n_z: int, size: int) -> Floats:
    """Return the directions in which the search variables move, one in each column.

    An element that slips at the largest deflection keeps it: its stiffness follows its force and the Stribeck ratio.

    Args:
        moving: variables that are free to move.
        limited: numbers of these elements.
        n_z: number of elements.
        size: number of search variables.
    """
    follows = np.eye(size)
    for number in limited:
        follows[ELEMENTS + number, [RHO, ELEMENTS + n_z + number]] = 1.0
    return follows[:, np.setdiff1d(moving, ELEMENTS + limited)]


def _normal_equations(
    data: Sequence[Prepared], masks: Sequence[Booleans], parameters: Parameters, shape: ElementShape, scales: Scales
) -> tuple[float, Floats, Floats]:
    """Return mean squared residual, gradient and Gauss-Newton matrix in search variables."""
    scale = search_scale(parameters, scales)
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


def _damped_step(matrix: Floats, gradient: Floats, damping: float) -> Floats:
    """Return the Levenberg-Marquardt step, limited in each variable."""
    diagonal = np.maximum(np.diag(matrix), 1e-9 * float(np.max(np.diag(matrix))))
    return np.clip(-np.linalg.solve(matrix + damping * np.diag(diagonal), gradient), -1.5, 1.5)


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
        masks: fitted rows of each recording.
        start: start values.
        shape: kind of model and its smoothing.
        frozen: indices of ``Parameters.vector`` that are fixed.
        iterations: largest number of steps.
        tolerance: stop when a step lowers the cost by less than this share, or moves no variable by more than it.

    Returns:
        The solution with the smallest cost.
    """
    scales = scales_of(data)
    low, high = search_bounds(start, scales)
    n_z, largest = start.count, scales.largest(shape.stated_deflection)
    free = np.array(start.free(frozen, shape.is_gms))
    variables = to_search(start, scales)
    variables[free] = np.clip(variables[free], low[free], high[free])
    variables = _with_limited_deflections(variables, n_z, largest)
    parameters = from_search(variables, start, scales)
    cost, gradient, matrix = _normal_equations(data, masks, parameters, shape, scales)
    damping = 1e-3
    steps = 0
    while steps < iterations:
        steps += 1
        at_bound = ((variables <= low) & (gradient > 0.0)) | ((variables >= high) & (gradient < 0.0))
        stiffness = slice(ELEMENTS, ELEMENTS + n_z)
        is_limited = (variables[stiffness] <= _softest(variables, n_z, largest)) & (gradient[stiffness] > 0.0)
        ways = _directions(free[~at_bound[free]], np.flatnonzero(is_limited), n_z, len(variables))
        step = ways @ _damped_step(ways.T @ matrix @ ways, ways.T @ gradient, damping)
        trial = variables.copy()
        trial[free] = np.clip(variables[free] + step[free], low[free], high[free])
        trial = _with_limited_deflections(trial, n_z, largest)
        candidate = from_search(trial, start, scales)
        new_cost, new_gradient, new_matrix = _normal_equations(data, masks, candidate, shape, scales)
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
