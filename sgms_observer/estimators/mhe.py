"""Moving horizon estimator: real-time Gauss-Newton iterations on eq. 14.

One iteration linearises every interval, solves the resulting quadratic programme with a Kalman filter forward and a
Bryson-Frazier smoother backward (bounds by a primal-dual active set), and takes the step with backtracking.
"""

from __future__ import annotations

from sgms_observer.estimators import memory as at
from sgms_observer.estimators.ekf import linearise_measurement
from sgms_observer.estimators.fields import layer, matrix, vector
from sgms_observer.estimators.interval import level_at, simulate_interval
from sgms_observer.estimators.kalman import (
    correct_scalar,
    factor_covariance,
    propagate_covariance,
    propagate_deviation,
    squared_distance,
)
from sgms_observer.estimators.layout import NU, Floats, apply_parameters, copy_matrix, copy_vector
from sgms_observer.estimators.subproblem import prior_deviation, solve_subproblem
from sgms_observer.jit import njit_bare

_MAX_HALVINGS = 6

# results of mhe_correct
IMPROVED, CONVERGED, NO_DESCENT, NOT_FINITE = range(4)


@njit_bare
def apply_estimate(flat: Floats, p: Floats) -> None:
    """Put p into the memory's model.

    Args:
        flat: the estimator's memory.
        p: parameters as shares of their nominal value.
    """
    apply_parameters(
        vector(flat, at.NOMINAL_SCALARS), matrix(flat, at.NOMINAL_ELEMENTS), vector(flat, at.KINDS),
        vector(flat, at.SCALE), p, vector(flat, at.SCALARS), matrix(flat, at.ELEMENTS),
    )  # fmt: skip


@njit_bare
def _shift(rows: Floats, last: int) -> None:
    """Move rows 1 to ``last`` one place down."""
    for k in range(last):
        for i in range(rows.shape[1]):
            rows[k, i] = rows[k + 1, i]


@njit_bare
def slide_window(flat: Floats) -> None:
    """Drop the oldest interval: one EKF recursion of the arrival cost through it (III-D2).

    Args:
        flat: the estimator's memory; its window is linearised at the latest estimate.
    """
    prior, covariance = vector(flat, at.PRIOR), matrix(flat, at.PRIOR_COVARIANCE)
    forces, p, ends = matrix(flat, at.FORCES), vector(flat, at.P), matrix(flat, at.ENDS)
    a, b = matrix(flat, at.A), layer(flat, at.B, 0)
    measurements, rows = matrix(flat, at.MEASUREMENTS), matrix(flat, at.ROWS)
    residuals, deviation = vector(flat, at.RESIDUALS), vector(flat, at.WORK)
    n_z = forces.shape[1]
    prior_deviation(flat, deviation)
    propagate_deviation(deviation, a[0], b)
    propagate_covariance(covariance, a[0], b, vector(flat, at.PROCESS))
    for i in range(n_z):
        deviation[i] += ends[0, i] - forces[1, i]
    if measurements[1, at.IS_USED] > 0.0:
        correct_scalar(deviation, covariance, rows[1], residuals[1], flat[at.VARIANCE], vector(flat, at.ADJOINT))
    for i in range(n_z):
        prior[i] = deviation[i] + forces[1, i]
    for i in range(n_z, prior.shape[0]):
        prior[i] = deviation[i] + p[i - n_z]
        covariance[i, i] += flat[at.WALK]
    count = int(flat[at.COUNT])
    _shift(forces, count)
    _shift(matrix(flat, at.SLIPS), count)
    _shift(measurements, count)
    _shift(rows, count)
    for k in range(count):
        residuals[k] = residuals[k + 1]
    _shift(matrix(flat, at.VELOCITIES), count - 1)
    _shift(matrix(flat, at.PERIODS), count - 1)
    _shift(matrix(flat, at.FACTORS), count - 1)
    _shift(ends, count - 1)
    _shift(matrix(flat, at.END_SLIPS), count - 1)
    _shift(a, count - 1)
    for k in range(count - 1):
        copy_matrix(layer(flat, at.B, k + 1), layer(flat, at.B, k))
    flat[at.COUNT] = count - 1


@njit_bare
def append_interval(flat: Floats) -> None:
    """Add the running interval, which ends now, and the measurement ``RECORD`` at its end.

    Args:
        flat: the estimator's memory; there is room in its window.
    """
    count = int(flat[at.COUNT])
    record, measurements = vector(flat, at.RECORD), matrix(flat, at.MEASUREMENTS)
    now, now_slip = vector(flat, at.NOW), vector(flat, at.NOW_SLIP)
    forces, slips, p = matrix(flat, at.FORCES), matrix(flat, at.SLIPS), vector(flat, at.P)
    if count == 0:
        x_hat, n_z = vector(flat, at.X_HAT), now.shape[0]
        copy_vector(x_hat, vector(flat, at.PRIOR))
        copy_matrix(matrix(flat, at.COVARIANCE), matrix(flat, at.PRIOR_COVARIANCE))
        copy_vector(x_hat[:n_z], forces[0])
        copy_vector(x_hat[n_z:], p)
        copy_vector(vector(flat, at.SLIP), slips[0])
        copy_vector(record, measurements[0])
        measurements[0, at.VELOCITY] = vector(flat, at.NOW_VELOCITY)[0]
    copy_vector(vector(flat, at.NOW_VELOCITY), matrix(flat, at.VELOCITIES)[count])
    copy_vector(vector(flat, at.NOW_PERIOD), matrix(flat, at.PERIODS)[count])
    copy_vector(vector(flat, at.NOW_FACTOR), matrix(flat, at.FACTORS)[count])
    copy_vector(now, matrix(flat, at.ENDS)[count])
    copy_vector(now_slip, matrix(flat, at.END_SLIPS)[count])
    copy_vector(vector(flat, at.NOW_A), matrix(flat, at.A)[count])
    copy_matrix(matrix(flat, at.NOW_B), layer(flat, at.B, count))
    copy_vector(now, forces[count + 1])
    copy_vector(now_slip, slips[count + 1])
    copy_vector(record, measurements[count + 1])
    vector(flat, at.RESIDUALS)[count + 1] = linearise_measurement(
        flat, p, now, now_slip, record, matrix(flat, at.ROWS)[count + 1]
    )
    flat[at.COUNT] = count + 1


@njit_bare
def _cost(flat: Floats, forces: Floats, p: Floats, ends: Floats, residuals: Floats) -> float:
    """Cost of eq. 14 at a point whose intervals and residuals are at hand (twice the negative log-likelihood)."""
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
            forces[k], slips[k], ends[k], end_slips[k], a[k], layer(flat, at.TRIAL_B, k),
        )  # fmt: skip
        residuals[k + 1] = linearise_measurement(
            flat, p, forces[k + 1], end_slips[k], measurements[k + 1], rows[k + 1]
        )


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
    """Go a share of the step, inside the bounds; return the largest move relative to the bounds."""
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
def iterate(flat: Floats) -> int:
    """One Gauss-Newton iteration on the window as it stands.

    Args:
        flat: the estimator's memory, its window linearised at its present estimate.

    Returns:
        IMPROVED, CONVERGED, NO_DESCENT or NOT_FINITE.
    """
    measurements, scalars, p = matrix(flat, at.MEASUREMENTS), vector(flat, at.SCALARS), vector(flat, at.P)
    tolerance = flat[at.TOLERANCE]
    for k in range(int(flat[at.COUNT]) + 1):
        measurements[k, at.LEVEL] = level_at(scalars, measurements[k, at.VELOCITY], measurements[k, at.FACTOR])
    factor_covariance(matrix(flat, at.PRIOR_COVARIANCE), matrix(flat, at.PRIOR_FACTOR))
    before = _cost(flat, matrix(flat, at.FORCES), p, matrix(flat, at.ENDS), vector(flat, at.RESIDUALS))
    solve_subproblem(flat)
    share = 1.0
    largest = 0.0
    for _ in range(_MAX_HALVINGS + 1):
        apply_estimate(flat, p)
        largest = _set_trial(flat, share)
        _evaluate_trial(flat)
        after = _cost(
            flat, matrix(flat, at.TRIAL_FORCES), vector(flat, at.TRIAL_P), matrix(flat, at.TRIAL_ENDS),
            vector(flat, at.TRIAL_RESIDUALS),
        )  # fmt: skip
        if after < 1e300:
            if after <= before + 1e-9 * (1.0 + before):
                _accept_trial(flat)
                return CONVERGED if largest <= tolerance else IMPROVED
            if largest <= tolerance:
                break
        share *= 0.5
    apply_estimate(flat, p)
    if not before < 1e300:
        return NOT_FINITE
    return CONVERGED if largest <= tolerance else NO_DESCENT


@njit_bare
def store_newest(flat: Floats) -> None:
    """Copy the newest node's estimate and its filtered covariance to x_hat, covariance and slip.

    Args:
        flat: the estimator's memory.
    """
    forces, p, x_hat = matrix(flat, at.FORCES), vector(flat, at.P), vector(flat, at.X_HAT)
    n_z, count = forces.shape[1], int(flat[at.COUNT])
    copy_vector(forces[count], x_hat[:n_z])
    copy_vector(p, x_hat[n_z:])
    copy_vector(matrix(flat, at.SLIPS)[count], vector(flat, at.SLIP))
    copy_matrix(layer(flat, at.COVARIANCES, count), matrix(flat, at.COVARIANCE))


@njit_bare
def mhe_correct(flat: Floats) -> int:
    """Take in the running interval and its measurement, and iterate.

    Args:
        flat: the estimator's memory; ``RECORD`` is the measurement at the end of the running interval.

    Returns:
        IMPROVED, CONVERGED, NO_DESCENT or NOT_FINITE.
    """
    if flat[at.COUNT] >= flat[at.HORIZON]:
        slide_window(flat)
    append_interval(flat)
    result = IMPROVED
    for i in range(int(flat[at.ITERATIONS])):
        result = iterate(flat)
        if result != IMPROVED:
            if result == NO_DESCENT and i > 0:
                result = IMPROVED
            break
    if result in (IMPROVED, CONVERGED):
        store_newest(flat)
    return result
