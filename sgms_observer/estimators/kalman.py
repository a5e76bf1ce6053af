"""Kalman filter and Bryson-Frazier smoother over x = (element forces, p), one scalar measurement at a time.

The transition of an interval is [[diag(a), b], [0, I]]; both EKF and MHE are built from these few pieces.
"""

from __future__ import annotations

from sgms_observer.arrays import Floats
from sgms_observer.jit import njit_bare


@njit_bare
def propagate_covariance(covariance: Floats, a: Floats, b: Floats, process: Floats) -> None:
    """P <- Phi P Phi^T + Q in place (eq. 11b).

    Args:
        covariance: P, shape (d, d), d = n_z + n_p; overwritten.
        a: diagonal of the state Jacobian, shape (n_z,).
        b: Jacobian with respect to p, shape (n_z, n_p).
        process: variances of Q for the element forces, shape (n_z,).
    """
    n_z, n_p = b.shape
    for i in range(n_z):
        for j in range(n_p):
            cross = a[i] * covariance[i, n_z + j]
            for k in range(n_p):
                cross += b[i, k] * covariance[n_z + k, n_z + j]
            covariance[i, n_z + j] = cross  # new P_fp; the old one stays in the mirrored block until the end
    for i in range(n_z):
        for j in range(i + 1):
            total = a[i] * covariance[i, j] * a[j]
            for k in range(n_p):
                total += a[i] * covariance[n_z + k, i] * b[j, k] + b[i, k] * covariance[j, n_z + k]
            covariance[i, j] = total
            covariance[j, i] = total
    for i in range(n_z):
        covariance[i, i] += process[i]
        for j in range(n_p):
            covariance[n_z + j, i] = covariance[i, n_z + j]


@njit_bare
def propagate_deviation(deviation: Floats, a: Floats, b: Floats) -> None:
    """Advance a deviation of x through an interval in place: f <- a f + b p."""
    n_z, n_p = b.shape
    for i in range(n_z):
        total = a[i] * deviation[i]
        for j in range(n_p):
            total += b[i, j] * deviation[n_z + j]
        deviation[i] = total


@njit_bare
def correct_scalar(deviation: Floats, covariance: Floats, row: Floats, residual: float, variance: float,
                   gain: Floats) -> tuple[float, float]:  # fmt: skip
    """Correct a deviation and its covariance with one scalar measurement in place (eq. 12).

    Args:
        deviation: deviation of x from the linearisation point, shape (d,); overwritten.
        covariance: P, shape (d, d); overwritten.
        row: H, shape (d,).
        residual: measurement minus its value at the linearisation point.
        variance: R; zero for an exact measurement.
        gain: K, shape (d,); written.

    Returns:
        innovation and its variance S; S = 0 if the measurement has no information and was not used.
    """
    d = deviation.shape[0]
    innovation = residual
    for i in range(d):
        total = 0.0
        for j in range(d):
            total += covariance[i, j] * row[j]
        gain[i] = total
        innovation -= row[i] * deviation[i]
    innovation_covariance = variance
    for i in range(d):
        innovation_covariance += row[i] * gain[i]
    if not innovation_covariance > 0.0:
        for i in range(d):
            gain[i] = 0.0
        return 0.0, 0.0
    for i in range(d):
        share = gain[i] / innovation_covariance
        deviation[i] += share * innovation
        for j in range(i + 1):
            change = covariance[i, j] - share * gain[j]
            covariance[i, j] = change
            covariance[j, i] = change
    for i in range(d):
        gain[i] /= innovation_covariance
    return innovation, innovation_covariance


@njit_bare
def smooth_back(adjoint: Floats, row: Floats, gain: Floats, innovation: float, innovation_covariance: float) -> float:
    """Propagate the Bryson-Frazier adjoint backward over one measurement in place.

    Args:
        adjoint: lambda after the measurement on entry, before it on return; shape (d,).
        row: H, shape (d,).
        gain: K, shape (d,).
        innovation: from ``correct_scalar``.
        innovation_covariance: S from ``correct_scalar``; 0 leaves the adjoint unchanged.

    Returns:
        Lagrange multiplier of the measurement: smoothed residual over R.

    Source: G. J. Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, ch. X.
    """
    if innovation_covariance == 0.0:
        return 0.0
    multiplier = innovation / innovation_covariance
    for i in range(adjoint.shape[0]):
        multiplier += gain[i] * adjoint[i]
    for i in range(adjoint.shape[0]):
        adjoint[i] -= row[i] * multiplier
    return multiplier


@njit_bare
def smooth_back_transition(adjoint: Floats, a: Floats, b: Floats) -> None:
    """Propagate the adjoint backward through an interval in place: lambda <- Phi^T lambda."""
    n_z, n_p = b.shape
    for j in range(n_p):
        total = adjoint[n_z + j]
        for i in range(n_z):
            total += b[i, j] * adjoint[i]
        adjoint[n_z + j] = total
    for i in range(n_z):
        adjoint[i] *= a[i]


@njit_bare
def factor_covariance(covariance: Floats, lower: Floats) -> None:
    """Cholesky factor of a covariance; a direction without uncertainty gets a tiny one.

    Args:
        covariance: P, shape (d, d).
        lower: L with L L^T = P, shape (d, d); its lower triangle is written.
    """
    d = covariance.shape[0]
    for i in range(d):
        for j in range(i):
            total = covariance[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            lower[i, j] = total / lower[j, j]
        total = covariance[i, i]
        for k in range(i):
            total -= lower[i, k] * lower[i, k]
        floor = 1e-14 * covariance[i, i] + 1e-300
        lower[i, i] = max(total, floor) ** 0.5


@njit_bare
def squared_distance(lower: Floats, deviation: Floats, work: Floats) -> float:
    """Return deviation^T P^-1 deviation from the Cholesky factor of P.

    Args:
        lower: from ``factor_covariance``.
        deviation: shape (d,).
        work: shape (d,); overwritten.
    """
    total = 0.0
    for i in range(deviation.shape[0]):
        value = deviation[i]
        for k in range(i):
            value -= lower[i, k] * work[k]
        work[i] = value / lower[i, i]
        total += work[i] * work[i]
    return total
