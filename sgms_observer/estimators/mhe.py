"""Moving horizon estimator: real-time Gauss-Newton iterations on eq. 14.

One iteration linearises every interval, solves the resulting quadratic programme with a Kalman filter forward and a
Bryson-Frazier smoother backward (bounds by a primal-dual active set), and takes the step with backtracking.
"""

from __future__ import annotations

from sgms_observer.estimators.ekf import linearise_measurement
from sgms_observer.estimators.interval import level_at, simulate_interval
from sgms_observer.estimators.kalman import (
    correct_scalar,
    factor_covariance,
    propagate_covariance,
    propagate_deviation,
    squared_distance,
)
from sgms_observer.estimators.layout import Floats, ParameterArrays, apply_parameters, copy_matrix, copy_vector
from sgms_observer.estimators.memory import COUNT, FACTOR, IS_USED, LEVEL, VELOCITY, Memory
from sgms_observer.estimators.subproblem import bound_of, solve_subproblem
from sgms_observer.jit import njit_bare

_MAX_HALVINGS = 6

# results of mhe_correct
IMPROVED, CONVERGED, NO_DESCENT, NOT_FINITE = range(4)


@njit_bare
def slide_window(memory: Memory, process: Floats, walk: float, variance: float) -> None:
    """Drop the oldest interval: one EKF recursion of the arrival cost through it (III-D2).

    Args:
        memory: the estimator's memory; its window is linearised at the latest estimate.
        process: variances of Q, shape (n_z,).
        walk: variance of each parameter's drift per correction.
        variance: R [N^2].
    """
    n_z = memory.now.shape[0]
    d = memory.x_hat.shape[0]
    deviation = memory.deviations[0]
    for i in range(d):
        deviation[i] = memory.prior[i] - (memory.forces[0, i] if i < n_z else memory.p[i - n_z])
    propagate_deviation(deviation, memory.a[0], memory.b[0])
    propagate_covariance(memory.prior_covariance, memory.a[0], memory.b[0], process)
    for i in range(n_z):
        deviation[i] += memory.ends[0, i] - memory.forces[1, i]
    if memory.measurements[1, IS_USED] > 0.0:
        correct_scalar(
            deviation, memory.prior_covariance, memory.rows[1], memory.residuals[1], variance, memory.adjoint
        )
    for i in range(d):
        memory.prior[i] = deviation[i] + (memory.forces[1, i] if i < n_z else memory.p[i - n_z])
        if i >= n_z:
            memory.prior_covariance[i, i] += walk
    count = int(memory.flags[COUNT])
    for k in range(count):
        copy_vector(memory.forces[k + 1], memory.forces[k])
        copy_vector(memory.slips[k + 1], memory.slips[k])
        copy_vector(memory.measurements[k + 1], memory.measurements[k])
        copy_vector(memory.rows[k + 1], memory.rows[k])
        memory.residuals[k] = memory.residuals[k + 1]
        if k > 0:
            copy_vector(memory.velocity[k], memory.velocity[k - 1])
            copy_vector(memory.period[k], memory.period[k - 1])
            copy_vector(memory.factor[k], memory.factor[k - 1])
            copy_vector(memory.ends[k], memory.ends[k - 1])
            copy_vector(memory.end_slips[k], memory.end_slips[k - 1])
            copy_vector(memory.a[k], memory.a[k - 1])
            copy_matrix(memory.b[k], memory.b[k - 1])
    memory.flags[COUNT] = count - 1


@njit_bare
def append_interval(memory: Memory, parameters: ParameterArrays, record: Floats) -> None:
    """Add the running interval, which ends now, and the measurement at its end.

    Args:
        memory: the estimator's memory; there is room in its window.
        parameters: which parameters are estimated.
        record: the measurement (memory.py).
    """
    count = int(memory.flags[COUNT])
    if count == 0:
        n_z = memory.now.shape[0]
        copy_vector(memory.x_hat, memory.prior)
        copy_matrix(memory.covariance, memory.prior_covariance)
        copy_vector(memory.x_hat[:n_z], memory.forces[0])
        copy_vector(memory.x_hat[n_z:], memory.p)
        copy_vector(memory.slip, memory.slips[0])
        copy_vector(record, memory.measurements[0])
        memory.measurements[0, VELOCITY] = memory.now_velocity[0]
    copy_vector(memory.now_velocity, memory.velocity[count])
    copy_vector(memory.now_period, memory.period[count])
    copy_vector(memory.now_factor, memory.factor[count])
    copy_vector(memory.now, memory.ends[count])
    copy_vector(memory.now_slip, memory.end_slips[count])
    copy_vector(memory.now_a, memory.a[count])
    copy_matrix(memory.now_b, memory.b[count])
    copy_vector(memory.now, memory.forces[count + 1])
    copy_vector(memory.now_slip, memory.slips[count + 1])
    copy_vector(record, memory.measurements[count + 1])
    memory.residuals[count + 1] = linearise_measurement(
        memory, parameters.kinds, parameters.scale, memory.p, memory.now, memory.now_slip, record,
        memory.rows[count + 1],
    )  # fmt: skip
    memory.flags[COUNT] = count + 1


@njit_bare
def _cost(memory: Memory, process: Floats, variance: float, forces: Floats, p: Floats, ends: Floats,
          residuals: Floats) -> float:  # fmt: skip
    """Cost of eq. 14 at a point whose intervals and residuals are at hand (twice the negative log-likelihood)."""
    n_z = memory.now.shape[0]
    count = int(memory.flags[COUNT])
    deviation = memory.adjoint
    for i in range(deviation.shape[0]):
        deviation[i] = (forces[0, i] if i < n_z else p[i - n_z]) - memory.prior[i]
    total = squared_distance(memory.lower, deviation, memory.work)
    for k in range(count):
        for i in range(n_z):
            defect = forces[k + 1, i] - ends[k, i]
            if process[i] > 0.0:
                total += defect * defect / process[i]
        total += residuals[k + 1] * residuals[k + 1] / variance
    return total


@njit_bare
def _evaluate_trial(memory: Memory, nominal_scalars: Floats, nominal_elements: Floats,
                    parameters: ParameterArrays) -> None:  # fmt: skip
    """Simulate and linearise every interval at the trial point."""
    kinds, scale = parameters.kinds, parameters.scale
    count = int(memory.flags[COUNT])
    apply_parameters(
        nominal_scalars, nominal_elements, kinds, scale, memory.trial_p, memory.scalars, memory.elements
    )
    for k in range(count):
        simulate_interval(
            memory.scalars, memory.elements, kinds, memory.trial_p,
            memory.velocity[k], memory.period[k], memory.factor[k], memory.velocity.shape[1],
            memory.trial_forces[k], memory.slips[k],
            memory.trial_ends[k], memory.trial_end_slips[k], memory.trial_a[k], memory.trial_b[k],
        )  # fmt: skip
        memory.trial_residuals[k + 1] = linearise_measurement(
            memory, kinds, scale, memory.trial_p, memory.trial_forces[k + 1], memory.trial_end_slips[k],
            memory.measurements[k + 1], memory.trial_rows[k + 1],
        )  # fmt: skip


@njit_bare
def _accept_trial(memory: Memory) -> None:
    """Make the trial point, with its linearisation, the window's estimate."""
    count = int(memory.flags[COUNT])
    copy_vector(memory.trial_p, memory.p)
    copy_vector(memory.trial_forces[0], memory.forces[0])
    for k in range(count):
        copy_vector(memory.trial_forces[k + 1], memory.forces[k + 1])
        copy_vector(memory.trial_end_slips[k], memory.slips[k + 1])
        copy_vector(memory.trial_ends[k], memory.ends[k])
        copy_vector(memory.trial_end_slips[k], memory.end_slips[k])
        copy_vector(memory.trial_a[k], memory.a[k])
        copy_matrix(memory.trial_b[k], memory.b[k])
        copy_vector(memory.trial_rows[k + 1], memory.rows[k + 1])
        memory.residuals[k + 1] = memory.trial_residuals[k + 1]


@njit_bare
def _set_trial(memory: Memory, share: float, beta: float, parameters: ParameterArrays) -> float:
    """Go a share of the step, inside the bounds; return the largest move in units of the prior's deviations."""
    n_z = memory.now.shape[0]
    count = int(memory.flags[COUNT])
    largest = 0.0
    for j in range(memory.p.shape[0]):
        value = memory.p[j] + share * memory.steps[0, n_z + j]
        memory.trial_p[j] = min(max(value, parameters.lower[j]), parameters.upper[j])
        largest = max(largest, abs(memory.trial_p[j] - memory.p[j]))
    for k in range(count + 1):
        for i in range(n_z):
            high = bound_of(memory, k, i, beta, parameters, 1.0)
            value = memory.forces[k, i] + share * memory.steps[k, i]
            memory.trial_forces[k, i] = min(max(value, -high), high)
            largest = max(largest, abs(memory.trial_forces[k, i] - memory.forces[k, i]) / high)
    return largest


@njit_bare
def iterate(memory: Memory, nominal_scalars: Floats, nominal_elements: Floats, parameters: ParameterArrays,
            process: Floats, variance: float, beta: float, tolerance: float) -> int:  # fmt: skip
    """One Gauss-Newton iteration on the window as it stands.

    Args:
        memory: the estimator's memory, its window linearised at its present estimate.
        nominal_scalars: model without p (layout.py).
        nominal_elements: its element rows.
        parameters: which parameters are estimated.
        process: variances of Q, shape (n_z,).
        variance: R [N^2].
        beta: state bound of 14d.
        tolerance: a step below it, relative to the bounds, counts as converged.

    Returns:
        IMPROVED, CONVERGED, NO_DESCENT or NOT_FINITE.
    """
    for k in range(int(memory.flags[COUNT]) + 1):
        record = memory.measurements[k]
        record[LEVEL] = level_at(memory.scalars, record[VELOCITY], record[FACTOR])
    factor_covariance(memory.prior_covariance, memory.lower)
    before = _cost(memory, process, variance, memory.forces, memory.p, memory.ends, memory.residuals)
    solve_subproblem(memory, process, variance, beta, parameters)
    share = 1.0
    for _ in range(_MAX_HALVINGS + 1):
        apply_parameters(
            nominal_scalars, nominal_elements, parameters.kinds, parameters.scale, memory.p,
            memory.scalars, memory.elements,
        )  # fmt: skip
        largest = _set_trial(memory, share, beta, parameters)
        _evaluate_trial(memory, nominal_scalars, nominal_elements, parameters)
        after = _cost(
            memory, process, variance, memory.trial_forces, memory.trial_p, memory.trial_ends, memory.trial_residuals
        )
        if not after < 1e300:
            share *= 0.5
            continue
        if after <= before + 1e-9 * (1.0 + before):
            _accept_trial(memory)
            return CONVERGED if largest <= tolerance else IMPROVED
        if largest <= tolerance:
            break
        share *= 0.5
    apply_parameters(
        nominal_scalars, nominal_elements, parameters.kinds, parameters.scale, memory.p, memory.scalars, memory.elements
    )
    if not before < 1e300:
        return NOT_FINITE
    return CONVERGED if largest <= tolerance else NO_DESCENT


@njit_bare
def store_newest(memory: Memory) -> None:
    """Copy the newest node's estimate and its filtered covariance to x_hat, covariance and slip."""
    n_z = memory.now.shape[0]
    count = int(memory.flags[COUNT])
    for i in range(n_z):
        memory.x_hat[i] = memory.forces[count, i]
        memory.slip[i] = memory.slips[count, i]
    for j in range(memory.p.shape[0]):
        memory.x_hat[n_z + j] = memory.p[j]
    copy_matrix(memory.covariances[count], memory.covariance)


@njit_bare
def mhe_correct(memory: Memory, nominal_scalars: Floats, nominal_elements: Floats, parameters: ParameterArrays,
                process: Floats, walk: float, variance: float, beta: float, record: Floats, horizon: int,
                iterations: int, tolerance: float) -> int:  # fmt: skip
    """Take in the running interval and its measurement, and iterate.

    Args:
        memory: the estimator's memory.
        nominal_scalars: model without p (layout.py).
        nominal_elements: its element rows.
        parameters: which parameters are estimated.
        process: variances of Q, shape (n_z,).
        walk: variance of each parameter's drift per correction.
        variance: R [N^2].
        beta: state bound of 14d.
        record: the measurement at the end of the running interval (memory.py).
        horizon: N.
        iterations: most Gauss-Newton iterations.
        tolerance: a step below it, relative to the bounds, ends them.

    Returns:
        IMPROVED, CONVERGED, NO_DESCENT or NOT_FINITE.
    """
    if memory.flags[COUNT] >= horizon:
        slide_window(memory, process, walk, variance)
    append_interval(memory, parameters, record)
    result = IMPROVED
    for i in range(iterations):
        result = iterate(
            memory, nominal_scalars, nominal_elements, parameters, process, variance, beta, tolerance
        )
        if result != IMPROVED:
            if result == NO_DESCENT and i > 0:
                result = IMPROVED
            break
    if result in (IMPROVED, CONVERGED):
        store_newest(memory)
    return result
