"""Extended Kalman filter on correction intervals (eqs 11-13)."""

from __future__ import annotations

from sgms_observer.estimators.interval import effort_slopes, predict_effort
from sgms_observer.estimators.kalman import correct_scalar, propagate_covariance
from sgms_observer.estimators.layout import Floats, Integers, copy_matrix
from sgms_observer.estimators.memory import ACCELERATION, EFFORT, FACTOR, IS_USED, VELOCITY, Memory
from sgms_observer.jit import njit_bare


@njit_bare
def linearise_measurement(memory: Memory, kinds: Integers, scale: Floats, p: Floats, force: Floats, slip: Floats,
                          record: Floats, row: Floats) -> float:  # fmt: skip
    """Evaluate a measurement and its derivatives at a node.

    Args:
        memory: the estimator's memory, with p applied to its model.
        kinds: P_* code of each entry of p.
        scale: SI value of one unit of each entry of p.
        p: estimated parameters.
        force: element forces [N].
        slip: GMS modes.
        record: the measurement (memory.py).
        row: H, written.

    Returns:
        Measured minus modelled effort [N]; zero where there is no usable measurement.
    """
    effort_slopes(
        memory.scalars, memory.elements, kinds, scale, p, force, slip,
        record[VELOCITY], record[ACCELERATION], record[FACTOR], row,
    )  # fmt: skip
    if record[IS_USED] == 0.0:
        return 0.0
    modelled = predict_effort(
        memory.scalars, memory.elements, force, slip, record[VELOCITY], record[ACCELERATION], record[FACTOR]
    )
    return float(record[EFFORT] - modelled)


@njit_bare
def predict_measurement(memory: Memory, kinds: Integers, scale: Floats, process: Floats, variance: float,
                        record: Floats, row: Floats, covariance: Floats) -> tuple[float, float]:  # fmt: skip
    """Predict to the end of the running interval (eq. 11) and compare with the measurement there.

    Args:
        memory: the estimator's memory; ``now`` is at the end of the interval.
        kinds: P_* code of each entry of p.
        scale: SI value of one unit of each entry of p.
        process: variances of Q, shape (n_z,).
        variance: R [N^2].
        record: the measurement (memory.py).
        row: H, written.
        covariance: P at the end of the interval before the measurement, shape (d, d), written.

    Returns:
        innovation [N] and its variance S [N^2].
    """
    copy_matrix(memory.covariance, covariance)
    propagate_covariance(covariance, memory.now_a, memory.now_b, process)
    n_z = memory.now.shape[0]
    innovation = linearise_measurement(
        memory, kinds, scale, memory.x_hat[n_z:], memory.now, memory.now_slip, record, row
    )
    spread = variance
    for i in range(row.shape[0]):
        for j in range(row.shape[0]):
            spread += row[i] * covariance[i, j] * row[j]
    return innovation, spread


@njit_bare
def ekf_correct(memory: Memory, walk: float, variance: float, is_used: bool, innovation: float,
                row: Floats, covariance: Floats) -> None:  # fmt: skip
    """Correct at the end of the running interval (eq. 12) and store the new estimate.

    Args:
        memory: the estimator's memory; x_hat, covariance and slip are overwritten.
        walk: variance of each parameter's drift per correction.
        variance: R [N^2].
        is_used: whether there is a measurement to correct with.
        innovation: from ``predict_measurement``.
        row: H there.
        covariance: P there.
    """
    n_z = memory.now.shape[0]
    copy_matrix(covariance, memory.covariance)
    memory.work[:] = 0.0
    if is_used:
        correct_scalar(memory.work, memory.covariance, row, innovation, variance, memory.adjoint)
    for i in range(n_z):
        memory.x_hat[i] = memory.now[i] + memory.work[i]
        memory.slip[i] = memory.now_slip[i]
    for j in range(n_z, memory.x_hat.shape[0]):
        memory.x_hat[j] += memory.work[j]
        memory.covariance[j, j] += walk
