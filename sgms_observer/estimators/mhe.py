"""Moving horizon estimator: real-time Gauss-Newton iterations on eq. 14.

One iteration linearises every interval, solves the resulting quadratic programme with a Kalman filter forward and a
Bryson-Frazier smoother backward (bounds by a primal-dual active set), and takes the step with a search along it.
"""

from __future__ import annotations

from sgms_observer.arrays import Floats
from sgms_observer.estimators import memory as at
from sgms_observer.estimators.descent import CONVERGED, IMPROVED, NO_DESCENT, iterate
from sgms_observer.estimators.ekf import linearise_measurement
from sgms_observer.estimators.kalman import correct_scalar, propagate_covariance, propagate_deviation
from sgms_observer.estimators.layout import copy_matrix, copy_vector
from sgms_observer.estimators.memory import layer, matrix, vector
from sgms_observer.estimators.subproblem import prior_deviation
from sgms_observer.jit import njit_bare


@njit_bare
def _shift(rows: Floats, last: int) -> None:
    """Move rows 1 to ``last`` one place down."""
    for k in range(last):
        for i in range(rows.shape[1]):
            rows[k, i] = rows[k + 1, i]


@njit_bare
def slide_window(flat: Floats) -> None:
    """Drop the oldest interval of the linearised window: one EKF recursion of the arrival cost through it (III-D2)."""
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
    if flat[at.HOLDS_MODES] > 0.0:
        for k in range(count - 1):
            copy_matrix(layer(flat, at.BRANCHES, k + 1), layer(flat, at.BRANCHES, k))
    _shift(ends, count - 1)
    _shift(matrix(flat, at.END_SLIPS), count - 1)
    _shift(a, count - 1)
    for k in range(count - 1):
        copy_matrix(layer(flat, at.B, k + 1), layer(flat, at.B, k))
    flat[at.COUNT] = count - 1


@njit_bare
def append_interval(flat: Floats) -> None:
    """Add the running interval, which ends now, and the measurement ``RECORD`` at its end; the window has room."""
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
    if flat[at.HOLDS_MODES] > 0.0:
        copy_matrix(matrix(flat, at.NOW_BRANCHES), layer(flat, at.BRANCHES, count))
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
def store_newest(flat: Floats) -> None:
    """Copy the newest node's estimate and its filtered covariance to x_hat, covariance and slip."""
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
