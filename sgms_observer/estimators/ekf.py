"""Extended Kalman filter on correction intervals (eqs 11-13)."""

from __future__ import annotations

from sgms_observer.arrays import Floats
from sgms_observer.estimators import memory as at
from sgms_observer.estimators.interval import effort_slopes, predict_effort
from sgms_observer.estimators.kalman import correct_scalar, propagate_covariance
from sgms_observer.estimators.layout import copy_matrix
from sgms_observer.estimators.memory import matrix, vector
from sgms_observer.jit import njit_bare


@njit_bare
def linearise_measurement(flat: Floats, p: Floats, force: Floats, slip: Floats, record: Floats, row: Floats) -> float:
    """Evaluate a measurement and its derivatives at a node.

    Args:
        flat: the estimator's memory, with p applied to its model.
        p: estimated parameters.
        force: element forces [N].
        slip: GMS modes.
        record: the measurement (memory.py).
        row: H, written.

    Returns:
        Measured minus modelled effort [N]; zero where there is no usable measurement.
    """
    scalars, elements = vector(flat, at.SCALARS), matrix(flat, at.ELEMENTS)
    velocity, acceleration, factor = record[at.VELOCITY], record[at.ACCELERATION], record[at.FACTOR]
    effort_slopes(
        scalars, elements, vector(flat, at.KINDS), vector(flat, at.SCALE), p, force, slip,
        velocity, acceleration, factor, row,
    )  # fmt: skip
    if record[at.IS_USED] == 0.0:
        return 0.0
    modelled = predict_effort(scalars, elements, force, slip, velocity, acceleration, factor)
    return float(record[at.EFFORT] - modelled)


@njit_bare
def predict_measurement(flat: Floats) -> tuple[float, float]:
    """Predict to the end of the running interval (eq. 11) and compare with the measurement there.

    Writes ``PREDICTED``, P at the end of the interval before the measurement, and ``PREDICTED_ROW``, H there.

    Args:
        flat: the estimator's memory; ``NOW`` is at the end of the interval, ``RECORD`` is the measurement.

    Returns:
        innovation [N] and its variance S [N^2].
    """
    covariance, row = matrix(flat, at.PREDICTED), vector(flat, at.PREDICTED_ROW)
    copy_matrix(matrix(flat, at.COVARIANCE), covariance)
    propagate_covariance(covariance, vector(flat, at.NOW_A), matrix(flat, at.NOW_B), vector(flat, at.PROCESS))
    now = vector(flat, at.NOW)
    innovation = linearise_measurement(
        flat, vector(flat, at.X_HAT)[now.shape[0] :], now, vector(flat, at.NOW_SLIP), vector(flat, at.RECORD), row
    )
    innovation_covariance = flat[at.VARIANCE]
    for i in range(row.shape[0]):
        for j in range(row.shape[0]):
            innovation_covariance += row[i] * covariance[i, j] * row[j]
    return innovation, innovation_covariance


@njit_bare
def ekf_correct(flat: Floats, innovation: float) -> None:
    """Correct at the end of the running interval (eq. 12) and store the new estimate.

    Args:
        flat: the estimator's memory after ``predict_measurement``; x_hat, covariance and slip are overwritten.
        innovation: from ``predict_measurement``.
    """
    now, now_slip, slip = vector(flat, at.NOW), vector(flat, at.NOW_SLIP), vector(flat, at.SLIP)
    x_hat, covariance, change = vector(flat, at.X_HAT), matrix(flat, at.COVARIANCE), vector(flat, at.WORK)
    n_z = now.shape[0]
    copy_matrix(matrix(flat, at.PREDICTED), covariance)
    change[:] = 0.0
    if vector(flat, at.RECORD)[at.IS_USED] > 0.0:
        row = vector(flat, at.PREDICTED_ROW)
        correct_scalar(change, covariance, row, innovation, flat[at.VARIANCE], vector(flat, at.ADJOINT))
    for i in range(n_z):
        x_hat[i] = now[i] + change[i]
        slip[i] = now_slip[i]
    for j in range(n_z, x_hat.shape[0]):
        x_hat[j] += change[j]
        covariance[j, j] += flat[at.WALK]
