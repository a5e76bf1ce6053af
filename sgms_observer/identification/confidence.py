"""How well each parameter is known, and whether this recording could show it.

Two sources of error are told apart. The statistical one comes from sandwich covariances that allow residuals to
correlate over time. The systematic one comes from preparation and from the encoder: the estimate is moved by one
Gauss-Newton step to another corner of the low-pass, and by one to a position with as much noise again, and how far it
goes counts in full. The second one tells what the noise that is there has done: a position that shakes by as much as a
stiff element deflects makes the element look softer, whatever the residuals say.
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

SHOWN_WITHIN = 0.05  # a parameter counts as shown when its interval is within this share of its value
_QUANTILE = 1.96
_CLUSTERS = 40
_OFFSET_SHARE = 0.02  # of the Coulomb force: precision at which an offset counts as shown, whatever its size
_DELAY_PRECISION = 1.0e-4  # s


@dataclass(frozen=True)
class Confidence:
    """Intervals of the entries of ``Parameters.vector``.

    Attributes:
        std_error: statistical standard deviation; NaN for entries that were held fixed.
        systematic: how far the estimate moves with the preparation; NaN for entries that were held fixed.
        half_width: half the 95 % interval, both sources together; infinite where the data are blind.
        coulomb_half_width: half the 95 % interval of the elements' summed force [N], which is known better than each.
        is_shown: whether this recording shows the parameter within ``SHOWN_WITHIN``.
    """

    std_error: Floats
    systematic: Floats
    half_width: Floats
    coulomb_half_width: float
    is_shown: Booleans


def judge(
    data: Sequence[Prepared],
    masks: Sequence[Booleans],
    others: Sequence[tuple[Sequence[Prepared], Sequence[Booleans]]],
    parameters: Parameters,
    shape: ElementShape,
    free: Sequence[int],
) -> Confidence:
    """Judge an estimate.

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
    with np.errstate(invalid="ignore"):  # what is not shown at all has an infinite variance
        variance = max(float(together @ covariance @ together) for covariance in covariances)
    coulomb = _QUANTILE * np.sqrt(variance) + sum(abs(float(together @ step)) for step in steps)
    coulomb = float(coulomb) if np.isfinite(coulomb) else np.inf
    half_width = _QUANTILE * std_error + systematic
    half_width = np.where(np.isfinite(half_width), half_width, np.inf)
    return Confidence(std_error, systematic, half_width, coulomb, half_width <= _allowed(parameters))


def widened(confidence: Confidence, moved: Floats, parameters: Parameters) -> Confidence:
    """Return intervals that hold what the choice of the frozen values does as well.

    Args:
        confidence: intervals with some entries frozen.
        moved: how far each entry moved when they were put back, shape of ``Parameters.vector``.
        parameters: the estimate.
    """
    half_width = confidence.half_width + np.abs(moved)
    forces = slice(ELEMENTS + parameters.count, parameters.first_effect)
    coulomb = confidence.coulomb_half_width + abs(float(np.sum(moved[forces])))
    is_shown = half_width <= _allowed(parameters)
    return Confidence(confidence.std_error, confidence.systematic, half_width, coulomb, is_shown)


def _allowed(parameters: Parameters) -> Floats:
    """Return the half interval within which each entry counts as shown."""
    allowed = SHOWN_WITHIN * np.abs(parameters.vector())
    allowed[OFFSET] = max(allowed[OFFSET], _OFFSET_SHARE * float(parameters.level.sum()))
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
        parameters: where the step begins [SI units].
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
