"""Confidence intervals of the parameters, from covariances for autocorrelated residuals, and which are identifiable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sgms_observer.arrays import Booleans, Floats, Ints
from sgms_observer.identification.prepared import Prepared
from sgms_observer.identification.problem import (
    DELAY,
    ELEMENTS,
    OFFSET,
    ElementShape,
    Parameters,
    chunk_numbers,
    residual_and_jacobian,
)

_LARGEST_SHARE = 0.25  # of a piece's length: the longest lag that still has enough pairs


IDENTIFIABLE_WITHIN = 0.05  # largest half interval of an identifiable parameter, as a share of its value
_QUANTILE = 1.96
_CLUSTERS = 40  # in all, of consecutive rows
_OFFSET_PRECISION = 0.02  # of the Coulomb force: half interval at which an offset of any size is identifiable
_DELAY_PRECISION = 1.0e-4  # s


def _correlation_bandwidth(scores: Floats) -> int:
    """Return the lag up to which scores are correlated [rows], by Andrews' AR(1) plug-in for the Bartlett kernel.

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


def _long_run_covariance(scores: Floats) -> Floats:
    """Return the long-run covariance of a piece's scores times their count (its part in the middle of the sandwich).

    Bartlett's weights fall linearly with the lag. So do those of the products of sums over windows of ``lags + 1``
    rows: the sums give the same covariance in one pass, however long the lag.
    """
    width = scores.shape[1]
    if not len(scores):  # a piece that is shorter than the filters take to settle
        return np.zeros((width, width))
    centred = scores - scores.mean(axis=0)
    lags = _correlation_bandwidth(_unit_columns(centred))
    nothing = np.zeros((lags + 1, width))
    cumulated = np.cumsum(np.concatenate([nothing, centred, nothing[1:]]), axis=0)
    sums = cumulated[lags + 1 :] - cumulated[: -lags - 1]
    return np.asarray(sums.T @ sums / (lags + 1.0))


def _unit_columns(scores: Floats) -> Floats:
    """Return columns scaled to unit variance, so that each counts alike in the choice of the lag."""
    scale = scores.std(axis=0)
    return np.asarray(scores / np.where(scale > 0.0, scale, 1.0))


class _Sandwich:
    """The sums over the rows of all pieces from which the covariances of a least-squares estimate follow.

    Args:
        width: number of parameters.
    """

    def __init__(self, width: int) -> None:
        self._hessian = np.zeros((width, width))
        self._scores = np.zeros((width, width))
        self._clusters: dict[int, Floats] = {}
        self._rows = 0

    def add(self, jacobian: Floats, residual: Floats, cluster: Ints) -> None:
        """Add a piece.

        Args:
            jacobian: derivative of the residual by the parameters, shape (n, k).
            residual: shape (n,).
            cluster: number of the cluster of each row, shape (n,).
        """
        scores = jacobian * residual[:, None]
        self._hessian += jacobian.T @ jacobian
        self._scores += _long_run_covariance(scores)
        for name in np.unique(cluster).tolist():
            self._clusters[name] = self._clusters.get(name, 0.0) + scores[cluster == name].sum(axis=0)
        self._rows += len(residual)

    def long_run(self) -> Floats:
        """Return the covariance for residuals with autocorrelation, shape (k, k); infinite if not identifiable."""
        return self._covariance(self._scores, self._rows / max(self._rows - len(self._hessian), 1))

    def clustered(self) -> Floats:
        """Return the covariance for residuals with any correlation within a cluster; infinite if not identifiable.

        Source: Liang and Zeger, Biometrika 73 (1986), with the small-sample factor C / (C - 1).
        """
        sums, count = np.array(list(self._clusters.values())), len(self._clusters)
        return self._covariance(sums.T @ sums, count / max(count - 1, 1))

    def _covariance(self, scores: Floats, factor: float) -> Floats:
        scale = np.sqrt(np.diag(self._hessian))
        scale = np.where(scale > 0.0, scale, 1.0)
        both = np.outer(scale, scale)
        return _sandwich(self._hessian / both, scores / both, factor, scale)


def least_squares_covariance(jacobians: Sequence[Floats], residuals: Sequence[Floats]) -> Floats:
    """Sandwich covariance (J'J)^-1 S (J'J)^-1 of a least-squares estimate.

    Args:
        jacobians: derivative of the residual by the parameters, per piece, shape (n_i, k).
        residuals: residual of each piece, shape (n_i,).

    Returns:
        Covariance, shape (k, k). Directions that are not identifiable have infinite variance.
    """
    sandwich = _Sandwich(jacobians[0].shape[1])
    for number, (jacobian, residual) in enumerate(zip(jacobians, residuals, strict=True)):
        sandwich.add(jacobian, residual, np.full(len(residual), number))
    return sandwich.long_run()


def _sandwich(hessian: Floats, score_covariance: Floats, factor: float, scale: Floats) -> Floats:
    """Return hessian^-1 S hessian^-1 in the units before scaling, infinite where the hessian is singular."""
    values, vectors = np.linalg.eigh(hessian)
    is_observable = values > 1e-12 * values[-1]
    inverse = (vectors[:, is_observable] / values[is_observable]) @ vectors[:, is_observable].T
    covariance = factor * inverse @ score_covariance @ inverse
    is_unobservable = (vectors[:, ~is_observable] ** 2).sum(axis=1) > 1e-6
    covariance[is_unobservable, is_unobservable] = np.inf
    return np.asarray(covariance / np.outer(scale, scale))


@dataclass(frozen=True)
class Confidence:
    """Intervals of the entries of ``Parameters.vector``.

    Attributes:
        half_width: half the 95 % interval, from statistical and systematic error; infinite if not identifiable.
        coulomb_half_width: half the 95 % interval of the sum of the element forces [N].
        is_identifiable: whether ``half_width`` is within ``IDENTIFIABLE_WITHIN``.
    """

    half_width: Floats
    coulomb_half_width: float
    is_identifiable: Booleans


def confidence_of(
    data: Sequence[Prepared],
    masks: Sequence[Booleans],
    others: Sequence[tuple[Sequence[Prepared], Sequence[Booleans]]],
    parameters: Parameters,
    shape: ElementShape,
    free: Sequence[int],
    at_bound: Sequence[int] = (),
) -> Confidence:
    """Return the confidence of an estimate.

    A parameter at its bound is not known: its error adds to that of the others. So the covariance has it among the
    estimated ones. The estimates of the recordings prepared in other ways have it at the bound, too.

    Args:
        data: recordings as prepared for the estimate.
        masks: rows of ``data`` that were fitted.
        others: the same recordings prepared in other ways, each with the rows to use.
        parameters: the estimate.
        shape: kind of model and its smoothing.
        free: indices that were estimated.
        at_bound: indices that are at their bounds, and not in ``free``.
    """
    free = list(free)
    chosen = [*free, *at_bound]
    value = parameters.vector()
    sandwich = _Sandwich(len(chosen))
    for piece, mask, number in zip(data, masks, chunk_numbers(masks, _CLUSTERS), strict=True):
        residual, jacobian = residual_and_jacobian(piece, parameters, shape)
        sandwich.add(jacobian[mask][:, chosen], residual[mask], number[mask])
    covariances = (sandwich.long_run(), sandwich.clustered())
    steps = [step_to(other, rows, parameters, shape, free) for other, rows in others]
    std_error = np.full(len(value), np.nan)
    std_error[free] = np.sqrt(np.max([np.diag(covariance) for covariance in covariances], axis=0))[: len(free)]
    systematic = np.full(len(value), np.nan)
    systematic[free] = np.sum(np.abs(steps), axis=0)
    forces = range(ELEMENTS + parameters.count, parameters.first_effect)
    together = np.array([float(index in forces) for index in chosen])
    with np.errstate(invalid="ignore"):  # a parameter without any information has infinite variance
        variance = max(float(together @ covariance @ together) for covariance in covariances)
    coulomb = _QUANTILE * np.sqrt(variance) + sum(abs(float(together[: len(free)] @ step)) for step in steps)
    coulomb = float(coulomb) if np.isfinite(coulomb) else np.inf
    half_width = _QUANTILE * std_error + systematic
    half_width = np.where(np.isfinite(half_width), half_width, np.inf)
    return Confidence(half_width, coulomb, half_width <= _allowed(parameters))


def widened(confidence: Confidence, moved: Floats, parameters: Parameters) -> Confidence:
    """Return intervals that include the effect of the choice of the frozen values.

    Args:
        confidence: intervals with some entries frozen.
        moved: change of each entry when they were set back, shape of ``Parameters.vector``.
        parameters: the estimate.
    """
    half_width = confidence.half_width + np.abs(moved)
    forces = slice(ELEMENTS + parameters.count, parameters.first_effect)
    coulomb = confidence.coulomb_half_width + abs(float(np.sum(moved[forces])))
    is_identifiable = half_width <= _allowed(parameters)
    return Confidence(half_width, coulomb, is_identifiable)


def _allowed(parameters: Parameters) -> Floats:
    """Return the largest half interval for which each entry is identifiable."""
    allowed = IDENTIFIABLE_WITHIN * np.abs(parameters.vector())
    allowed[OFFSET] = max(allowed[OFFSET], _OFFSET_PRECISION * float(parameters.level.sum()))
    allowed[DELAY] = max(allowed[DELAY], _DELAY_PRECISION)
    return np.asarray(allowed)


def step_to(
    data: Sequence[Prepared], masks: Sequence[Booleans], parameters: Parameters, shape: ElementShape, chosen: list[int]
) -> Floats:
    """Return the Gauss-Newton step of the chosen entries on other data.

    Args:
        data: prepared recordings.
        masks: rows to use.
        parameters: start of the step [SI units].
        shape: kind of model and its smoothing.
        chosen: indices of ``Parameters.vector`` that move.
    """
    size = len(chosen)
    matrix, gradient = np.zeros((size, size)), np.zeros(size)
    for piece, mask in zip(data, masks, strict=True):
        residual, jacobian = residual_and_jacobian(piece, parameters, shape)
        slopes = jacobian[mask][:, chosen]
        matrix += slopes.T @ slopes
        gradient += slopes.T @ residual[mask]
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return np.asarray(-np.linalg.lstsq(matrix / np.outer(scale, scale), gradient / scale, rcond=1e-12)[0] / scale)
