"""Confidence intervals of the parameters, and which parameters are identifiable from the recording.

There are two sources of error. The statistical error comes from sandwich covariances for residuals that are correlated
in time. The systematic error comes from the preparation and the encoder. It is the sum of two Gauss-Newton steps: one
to data with another corner of the low-pass, one to data with added position noise of the same size. The second step
shows the bias by position noise: noise as large as the deflection of a stiff element makes the element appear softer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sgms_observer.identification.prepared import Prepared
from sgms_observer.identification.problem import (
    DELAY,
    ELEMENTS,
    OFFSET,
    Parameters,
    chunk_numbers,
    residual_and_jacobian,
)
from sgms_observer.identification.simulation import ElementShape
from sgms_observer.identification.uncertainty import clustered_covariance, least_squares_covariance

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

IDENTIFIABLE_WITHIN = 0.05  # largest half interval of an identifiable parameter, as a share of its value
_QUANTILE = 1.96
_CLUSTERS = 40
_OFFSET_PRECISION = 0.02  # of the Coulomb force: half interval at which an offset of any size is identifiable
_DELAY_PRECISION = 1.0e-4  # s


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
) -> Confidence:
    """Return the confidence of an estimate.

    Args:
        data: recordings as prepared for the estimate.
        masks: rows of ``data`` that were fitted.
        others: the same recordings prepared in other ways, each with the rows to use.
        parameters: the estimate.
        shape: kind of model and its smoothing.
        free: indices that were estimated.
    """
    chosen = list(free)
    value = parameters.vector()
    pairs = [residual_and_jacobian(piece, parameters, shape) for piece in data]
    residuals = [residual[mask] for (residual, _), mask in zip(pairs, masks, strict=True)]
    jacobians = [jacobian[mask][:, chosen] for (_, jacobian), mask in zip(pairs, masks, strict=True)]
    clusters = [number[mask] for number, mask in zip(chunk_numbers(data, _CLUSTERS), masks, strict=True)]
    covariances = (
        least_squares_covariance(jacobians, residuals),
        clustered_covariance(np.concatenate(jacobians), np.concatenate(residuals), np.concatenate(clusters)),
    )
    steps = [step_to(other, rows, parameters, shape, chosen) for other, rows in others]
    std_error = np.full(len(value), np.nan)
    std_error[chosen] = np.sqrt(np.max([np.diag(covariance) for covariance in covariances], axis=0))
    systematic = np.full(len(value), np.nan)
    systematic[chosen] = np.sum(np.abs(steps), axis=0)
    forces = range(ELEMENTS + parameters.count, parameters.first_effect)
    together = np.array([float(index in forces) for index in chosen])
    with np.errstate(invalid="ignore"):  # a parameter without any information has infinite variance
        variance = max(float(together @ covariance @ together) for covariance in covariances)
    coulomb = _QUANTILE * np.sqrt(variance) + sum(abs(float(together @ step)) for step in steps)
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
    data: Sequence[Prepared],
    masks: Sequence[Booleans],
    parameters: Parameters,
    shape: ElementShape,
    chosen: list[int],
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
