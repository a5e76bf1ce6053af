"""Covariances of least-squares estimates for autocorrelated residuals.

A model error leaves residuals that are correlated over many samples. The textbook covariance assumes independent
residuals, so it is many times too small.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_LARGEST_SHARE = 0.25  # of a piece's length: the longest lag that still has enough pairs


def correlation_bandwidth(scores: Floats) -> int:
    """Return the lag up to which scores are correlated, by Andrews' AR(1) plug-in for the Bartlett kernel.

    Args:
        scores: score of each row (regressor times residual), shape (n, k).

    Returns:
        Lag [rows], at least 1.

    Source: Andrews, Econometrica 59 (1991), eqs 6.2 and 6.4 with equal weights.
    """
    n = len(scores)
    numerator = 0.0
    denominator = 0.0
    for column in scores.T:
        power = float(column[:-1] @ column[:-1])
        if power <= 0.0:
            continue
        rho = min(max(float(column[:-1] @ column[1:]) / power, -0.97), 0.97)
        variance = float(np.var(column[1:] - rho * column[:-1]))
        numerator += 4.0 * rho**2 * variance**2 / ((1.0 - rho) ** 6 * (1.0 + rho) ** 2)
        denominator += variance**2 / (1.0 - rho) ** 4
    if denominator <= 0.0:
        return 1
    alpha = numerator / denominator
    return int(min(max(np.ceil(1.1447 * (alpha * n) ** (1.0 / 3.0)), 1), max(1, int(_LARGEST_SHARE * n))))


def long_run_covariance(pieces: Sequence[Floats]) -> Floats:
    """Sum over pieces of the scores' long-run covariance times their count (the middle of the sandwich).

    Args:
        pieces: scores of each piece of recording, shape (n_i, k); pieces are taken as independent.

    Returns:
        Shape (k, k), positive semi-definite (Bartlett weights).
    """
    width = pieces[0].shape[1]
    score_covariance = np.zeros((width, width))
    for scores in pieces:
        centred = scores - scores.mean(axis=0)
        score_covariance += centred.T @ centred
        lags = correlation_bandwidth(_unit_columns(centred))
        for lag in range(1, min(lags, len(centred) - 1) + 1):
            weight = 1.0 - lag / (lags + 1.0)
            product = centred[lag:].T @ centred[:-lag]
            score_covariance += weight * (product + product.T)
    return score_covariance


def _unit_columns(scores: Floats) -> Floats:
    """Return columns scaled to unit variance, so that each counts alike in the choice of the lag."""
    scale = scores.std(axis=0)
    return np.asarray(scores / np.where(scale > 0.0, scale, 1.0))


def least_squares_covariance(jacobians: Sequence[Floats], residuals: Sequence[Floats]) -> Floats:
    """Sandwich covariance (J'J)^-1 S (J'J)^-1 of a least-squares estimate.

    Args:
        jacobians: derivative of the residual by the parameters, per piece, shape (n_i, k).
        residuals: residual of each piece, shape (n_i,).

    Returns:
        Covariance, shape (k, k). Directions that are not identifiable have infinite variance.
    """
    stacked = np.concatenate(list(jacobians))
    scale = _column_norms(stacked)
    scaled = [jacobian / scale for jacobian in jacobians]
    hessian = sum((jacobian.T @ jacobian for jacobian in scaled), np.zeros((stacked.shape[1],) * 2))
    scores = [jacobian * residual[:, None] for jacobian, residual in zip(scaled, residuals, strict=True)]
    freedom = len(stacked) / max(len(stacked) - stacked.shape[1], 1)
    return _sandwich(hessian, long_run_covariance(scores), freedom, scale)


def clustered_covariance(jacobian: Floats, residual: Floats, cluster: NDArray[np.int64]) -> Floats:
    """Sandwich covariance for residuals with any correlation within a cluster.

    Args:
        jacobian: derivative of the residual by the parameters, shape (n, k).
        residual: shape (n,).
        cluster: number of the stretch of time each row belongs to, shape (n,).

    Returns:
        Covariance, shape (k, k). Directions that are not identifiable have infinite variance.

    Source: Liang and Zeger, Biometrika 73 (1986), with the small-sample factor C / (C - 1).
    """
    scale = _column_norms(jacobian)
    scaled = jacobian / scale
    names = np.unique(cluster)
    sums = np.array([(scaled[cluster == name] * residual[cluster == name, None]).sum(axis=0) for name in names])
    return _sandwich(scaled.T @ scaled, sums.T @ sums, len(names) / max(len(names) - 1, 1), scale)


def _column_norms(jacobian: Floats) -> Floats:
    """Return the norm of each column, 1 for a column of zeros."""
    scale = np.linalg.norm(jacobian, axis=0)
    return np.where(scale > 0.0, scale, 1.0)


def _sandwich(hessian: Floats, score_covariance: Floats, factor: float, scale: Floats) -> Floats:
    """Return hessian^-1 S hessian^-1 in the units before scaling, infinite where the hessian is singular."""
    values, vectors = np.linalg.eigh(hessian)
    is_observable = values > 1e-12 * values[-1]
    inverse = (vectors[:, is_observable] / values[is_observable]) @ vectors[:, is_observable].T
    covariance = factor * inverse @ score_covariance @ inverse
    is_unobservable = (vectors[:, ~is_observable] ** 2).sum(axis=1) > 1e-6
    covariance[is_unobservable, is_unobservable] = np.inf
    return np.asarray(covariance / np.outer(scale, scale))
