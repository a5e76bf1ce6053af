"""One Gauss-Newton iteration on the window of eq. 14: the step of the quadratic programme, a line search along it, and
a second step if the quadratic model was poor.
"""

from __future__ import annotations

from sgms_observer.arrays import Floats
from sgms_observer.estimators import memory as at
from sgms_observer.estimators.ekf import linearise_measurement
from sgms_observer.estimators.interval import level_at, simulate_interval
from sgms_observer.estimators.kalman import factor_covariance, squared_distance
from sgms_observer.estimators.layout import GMS, MODEL, NU, apply_parameters, copy_matrix, copy_vector
from sgms_observer.estimators.memory import layer, matrix, vector
from sgms_observer.estimators.subproblem import solve_subproblem
from sgms_observer.jit import njit_bare

_MAX_HALVINGS = 6
_MIN_STEP_SHARE, _MAX_STEP_SHARE = -0.5, 8.0  # limits of the line search, as shares of the step
_MIN_COST_DECREASE = 1e-6  # smallest expected decrease of the cost (twice a log-likelihood) for a line search

# results of iterate
IMPROVED, CONVERGED, NO_DESCENT, NOT_FINITE = range(4)


@njit_bare
def apply_estimate(flat: Floats, p: Floats) -> None:
    """Put p, as shares of the nominal values, into the memory's model."""
    apply_parameters(
        vector(flat, at.NOMINAL_SCALARS), matrix(flat, at.NOMINAL_ELEMENTS), vector(flat, at.KINDS),
        vector(flat, at.SCALE), p, vector(flat, at.SCALARS), matrix(flat, at.ELEMENTS),
    )  # fmt: skip


@njit_bare
def _cost(flat: Floats, forces: Floats, p: Floats, ends: Floats, residuals: Floats) -> float:
    """Return the cost of eq. 14 (twice the negative log-likelihood) at a simulated point."""
    prior, process, deviation = vector(flat, at.PRIOR), vector(flat, at.PROCESS), vector(flat, at.ADJOINT)
    n_z = forces.shape[1]
    for i in range(deviation.shape[0]):
        deviation[i] = (forces[0, i] if i < n_z else p[i - n_z]) - prior[i]
    total = squared_distance(matrix(flat, at.PRIOR_FACTOR), deviation, vector(flat, at.WORK))
    for k in range(int(flat[at.COUNT])):
        for i in range(n_z):
            defect = forces[k + 1, i] - ends[k, i]
            if process[i] > 0.0:
                total += defect * defect / process[i]
        total += residuals[k + 1] * residuals[k + 1] / flat[at.VARIANCE]
    return total


@njit_bare
def _evaluate_trial(flat: Floats) -> None:
    """Simulate and linearise every interval at the trial point."""
    kinds, p = vector(flat, at.KINDS), vector(flat, at.TRIAL_P)
    scalars, elements = vector(flat, at.SCALARS), matrix(flat, at.ELEMENTS)
    velocity, period, factor = matrix(flat, at.VELOCITIES), matrix(flat, at.PERIODS), matrix(flat, at.FACTORS)
    forces, slips = matrix(flat, at.TRIAL_FORCES), matrix(flat, at.SLIPS)
    ends, end_slips, a = matrix(flat, at.TRIAL_ENDS), matrix(flat, at.TRIAL_END_SLIPS), matrix(flat, at.TRIAL_A)
    measurements, rows = matrix(flat, at.MEASUREMENTS), matrix(flat, at.TRIAL_ROWS)
    residuals = vector(flat, at.TRIAL_RESIDUALS)
    apply_estimate(flat, p)
    for k in range(int(flat[at.COUNT])):
        simulate_interval(
            scalars, elements, kinds, p, velocity[k], period[k], factor[k],
            layer(flat, at.BRANCHES, k), flat[at.HOLDS_MODES] > 0.0,
            forces[k], slips[k], ends[k], end_slips[k], a[k], layer(flat, at.TRIAL_B, k),
        )  # fmt: skip
        residuals[k + 1] = linearise_measurement(flat, p, forces[k + 1], end_slips[k], measurements[k + 1], rows[k + 1])


@njit_bare
def _accept_trial(flat: Floats) -> None:
    """Make the trial point, with its linearisation, the window's estimate."""
    slips, end_slips = matrix(flat, at.SLIPS), matrix(flat, at.TRIAL_END_SLIPS)
    copy_vector(vector(flat, at.TRIAL_P), vector(flat, at.P))
    copy_matrix(matrix(flat, at.TRIAL_FORCES), matrix(flat, at.FORCES))
    copy_matrix(matrix(flat, at.TRIAL_ENDS), matrix(flat, at.ENDS))
    copy_matrix(end_slips, matrix(flat, at.END_SLIPS))
    copy_matrix(matrix(flat, at.TRIAL_A), matrix(flat, at.A))
    copy_matrix(matrix(flat, at.TRIAL_ROWS), matrix(flat, at.ROWS))
    copy_vector(vector(flat, at.TRIAL_RESIDUALS), vector(flat, at.RESIDUALS))
    for k in range(int(flat[at.COUNT])):
        copy_vector(end_slips[k], slips[k + 1])
        copy_matrix(layer(flat, at.TRIAL_B, k), layer(flat, at.B, k))


@njit_bare
def _set_trial(flat: Floats, share: float) -> float:
    """Set the trial point to a share of the step inside the bounds; return the largest move relative to the bounds."""
    forces, p, steps = matrix(flat, at.FORCES), vector(flat, at.P), matrix(flat, at.STEPS)
    trial_forces, trial_p = matrix(flat, at.TRIAL_FORCES), vector(flat, at.TRIAL_P)
    lower, upper, elements = vector(flat, at.LOWER), vector(flat, at.UPPER), matrix(flat, at.ELEMENTS)
    measurements = matrix(flat, at.MEASUREMENTS)
    n_z = forces.shape[1]
    largest = 0.0
    for j in range(p.shape[0]):
        value = p[j] + share * steps[0, n_z + j]
        trial_p[j] = min(max(value, lower[j]), upper[j])
        largest = max(largest, abs(trial_p[j] - p[j]))
    for k in range(int(flat[at.COUNT]) + 1):
        level = flat[at.BETA] * measurements[k, at.LEVEL]
        for i in range(n_z):
            high = elements[NU, i] * level
            value = forces[k, i] + share * steps[k, i]
            trial_forces[k, i] = min(max(value, -high), high)
            largest = max(largest, abs(trial_forces[k, i] - forces[k, i]) / high)
    return largest


@njit_bare
def _slope(flat: Floats) -> float:
    """Return the derivative of the cost of eq. 14 along ``STEPS`` at the present estimate of the window."""
    forces, p, ends = matrix(flat, at.FORCES), vector(flat, at.P), matrix(flat, at.ENDS)
    a, rows, residuals = matrix(flat, at.A), matrix(flat, at.ROWS), vector(flat, at.RESIDUALS)
    prior, lower, process = vector(flat, at.PRIOR), matrix(flat, at.PRIOR_FACTOR), vector(flat, at.PROCESS)
    steps, solved, moved = matrix(flat, at.STEPS), vector(flat, at.WORK), vector(flat, at.ADJOINT)
    n_z, d = forces.shape[1], prior.shape[0]
    total = 0.0
    for i in range(d):
        deviation = (forces[0, i] if i < n_z else p[i - n_z]) - prior[i]
        move = steps[0, i]
        for k in range(i):
            deviation -= lower[i, k] * solved[k]
            move -= lower[i, k] * moved[k]
        solved[i] = deviation / lower[i, i]
        moved[i] = move / lower[i, i]
        total += solved[i] * moved[i]
    for k in range(int(flat[at.COUNT])):
        b = layer(flat, at.B, k)
        for i in range(n_z):
            if process[i] > 0.0:
                change = steps[k + 1, i] - a[k, i] * steps[k, i]
                for j in range(d - n_z):
                    change -= b[i, j] * steps[k, n_z + j]
                total += (forces[k + 1, i] - ends[k, i]) * change / process[i]
        change = 0.0
        for i in range(d):
            change += rows[k + 1, i] * steps[k + 1, i]
        total -= residuals[k + 1] * change / flat[at.VARIANCE]
    return 2.0 * total


@njit_bare
def _trial_cost(flat: Floats, share: float) -> tuple[float, float]:
    """Linearise at a share of the step; return the cost there and the largest move relative to the bounds."""
    apply_estimate(flat, vector(flat, at.P))
    largest = _set_trial(flat, share)
    _evaluate_trial(flat)
    cost = _cost(
        flat, matrix(flat, at.TRIAL_FORCES), vector(flat, at.TRIAL_P), matrix(flat, at.TRIAL_ENDS),
        vector(flat, at.TRIAL_RESIDUALS),
    )  # fmt: skip
    return cost, largest


@njit_bare
def _line_search(flat: Floats, cost: float, slope: float) -> bool:
    """Move along the direction of a full step to the point where the slope of the cost would vanish, if it pays off.

    The slope at the end of the step is known without a simulation. It is far from zero only if an element is in its
    transition from sticking to sliding, where the quadratic model is poor.

    Args:
        flat: the estimator's memory, the full step accepted.
        cost: cost at the end of the step.
        slope: derivative of the cost along the step at its start.

    Returns:
        Whether the quadratic model was poor.
    """
    here = _slope(flat)
    curvature = here - slope
    move = min(max(-here / curvature, _MIN_STEP_SHARE), _MAX_STEP_SHARE) if curvature > 0.0 else _MAX_STEP_SHARE
    if not abs(here * move) > _MIN_COST_DECREASE:
        return False
    after, _ = _trial_cost(flat, move)
    if after < cost:
        _accept_trial(flat)
    else:
        apply_estimate(flat, vector(flat, at.P))
    return True


@njit_bare
def _iterate_once(flat: Floats) -> tuple[int, bool]:
    """Do one Gauss-Newton step; return the result of ``iterate`` and whether the quadratic model was poor."""
    measurements, scalars, p = matrix(flat, at.MEASUREMENTS), vector(flat, at.SCALARS), vector(flat, at.P)
    tolerance = flat[at.TOLERANCE]
    for k in range(int(flat[at.COUNT]) + 1):
        measurements[k, at.LEVEL] = level_at(scalars, measurements[k, at.VELOCITY], measurements[k, at.FACTOR])
    factor_covariance(matrix(flat, at.PRIOR_COVARIANCE), matrix(flat, at.PRIOR_FACTOR))
    before = _cost(flat, matrix(flat, at.FORCES), p, matrix(flat, at.ENDS), vector(flat, at.RESIDUALS))
    solve_subproblem(flat)
    slope = _slope(flat)
    share = 1.0
    largest = 0.0
    for _ in range(_MAX_HALVINGS + 1):
        after, largest = _trial_cost(flat, share)
        if after < 1e300:
            if after <= before + 1e-9 * (1.0 + before):
                _accept_trial(flat)
                if largest <= tolerance:
                    return CONVERGED, False
                if scalars[MODEL] == GMS:  # its cost is not smooth: a slope has no meaning beyond a corner
                    return IMPROVED, False
                return IMPROVED, share < 1.0 or _line_search(flat, after, slope)
            if largest <= tolerance:
                break
        share *= 0.5
    apply_estimate(flat, p)
    if not before < 1e300:
        return NOT_FINITE, False
    return CONVERGED if largest <= tolerance else NO_DESCENT, False


@njit_bare
def iterate(flat: Floats) -> int:
    """Do one Gauss-Newton iteration on the window, and a second step if the quadratic model was poor.

    Args:
        flat: the estimator's memory, its window linearised at its present estimate.

    Returns:
        IMPROVED, CONVERGED, NO_DESCENT or NOT_FINITE.
    """
    result, is_poor = _iterate_once(flat)
    if is_poor:
        second, _ = _iterate_once(flat)
        if second == CONVERGED:
            result = second
    return result
