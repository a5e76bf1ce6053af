"""Number of elements: the smallest whose error on validation chunks is as good as the best."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sgms_observer.errors import DataError
from sgms_observer.identification.prepared import Prepared
from sgms_observer.identification.problem import V_S, Parameters, chunk_numbers, residual_and_jacobian
from sgms_observer.identification.search import Fit, search
from sgms_observer.identification.simulation import ElementShape
from sgms_observer.identification.start_values import Start, cluster

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

_CHUNKS = 30  # of equal duration; every third is for validation and is not fitted
_MIN_ROWS = 500
NEGLIGIBLE_EXCESS = 0.04  # relative excess of the mean squared error for which no further element is added
_STARTS = (1.0, 5.0, 0.2)  # times the start's Stribeck velocity
_MERGE_COST_RATIO = 0.995  # largest cost, over that of one element less, for which a merged start is tried


@dataclass(frozen=True)
class Rows:
    """The recordings prepared in several ways, with the rows to use.

    Attributes:
        main: recordings as prepared for the estimate.
        masks: rows of ``main`` after the elements have forgotten their start.
        others: the same recordings prepared in other ways, each with its rows.
        validation_rows: rows of ``main`` in validation chunks.
        chunks: chunk number of each row of ``main``.
    """

    main: list[Prepared]
    masks: list[Booleans]
    others: tuple[tuple[list[Prepared], list[Booleans]], ...]
    validation_rows: list[Booleans]
    chunks: list[NDArray[np.int64]]

    @property
    def fit_rows(self) -> list[Booleans]:
        """Return the rows that are fitted."""
        return [mask & ~validation_mask for mask, validation_mask in zip(self.masks, self.validation_rows, strict=True)]


def rows_to_use(main: list[Prepared], others: Sequence[list[Prepared]], deflection: float) -> Rows:
    """Return the rows after the elements have forgotten their start, every third chunk for validation.

    Args:
        main: prepared recordings.
        others: the same prepared in other ways.
        deflection: slip deflection of the elements that matter [m].

    Raises:
        DataError: if nothing is left.
    """
    masks = [piece.settled(deflection) for piece in main]
    if sum(int(mask.sum()) for mask in masks) < _MIN_ROWS:
        raise DataError(
            f"these recordings never slide {3.0 * deflection:.2g} {main[0].unit} in one direction, which the elements"
            " need to forget how they started; record longer strokes (sgms excite)"
        )
    chunks = chunk_numbers(main, _CHUNKS)
    validation_rows = [number % 3 == 2 for number in chunks]
    with_masks = tuple((other, [piece.settled(deflection) for piece in other]) for other in others)
    return Rows(main, masks, with_masks, validation_rows, chunks)


def fit_each_count(
    data: Rows, start: Start, shape: ElementShape, counts: tuple[int, ...], show: Callable[[float], None]
) -> dict[int, Fit]:
    """Return the fit with each number of elements, on the fitted rows.

    Args:
        data: recordings and rows.
        start: start of the search; several multiples of its v_s are tried.
        shape: kind of model and its smoothing.
        counts: numbers of elements, consecutive.
        show: called with the completed share, from 0 to 1.
    """
    first = min(2, *counts)
    searches = len(_STARTS) + 2 * len(counts) - 1
    trials = []
    for number, share in enumerate(_STARTS):
        show(number / searches)
        parameters = start.parameters(first, start.velocity * share)
        trials.append(search(data.main, data.fit_rows, parameters, shape, iterations=12, tolerance=1e-3))
    velocity = float(min(trials, key=lambda fit: fit.cost).parameters.scalars[V_S])
    fits = {}
    for number, count in enumerate(counts, len(trials)):
        show(number / searches)
        parameters = start.parameters(count, velocity)
        fits[count] = search(data.main, data.fit_rows, parameters, shape, iterations=20, tolerance=1e-3)
    for number, count in enumerate(sorted(fits, reverse=True)[1:], len(trials) + len(fits)):
        show(number / searches)
        if fits[count + 1].cost < _MERGE_COST_RATIO * fits[count].cost:
            merged = _merge_elements(fits[count + 1].parameters, count)
            again = search(data.main, data.fit_rows, merged, shape, iterations=20, tolerance=1e-3)
            fits[count] = min(fits[count], again, key=lambda fit: fit.cost)
    return fits


def validation_squares(data: Rows, parameters: Parameters, shape: ElementShape) -> Floats:
    """Return the mean squared error of each validation chunk [N^2].

    Args:
        data: recordings and rows.
        parameters: the model.
        shape: kind of model and its smoothing.
    """
    out: list[float] = []
    for piece, mask, validation_rows, chunk in zip(
        data.main, data.masks, data.validation_rows, data.chunks, strict=True
    ):
        residual, _jacobian = residual_and_jacobian(piece, parameters, shape)
        rows = mask & validation_rows
        out.extend(float(np.mean(residual[rows & (chunk == name)] ** 2)) for name in np.unique(chunk[rows]))
    return np.array(out)


def choose_count(errors: dict[int, Floats]) -> int:
    """Return the smallest number of elements whose error is within the scatter or within 2 % rms of the best.

    Args:
        errors: number of elements to the squared error of each validation chunk.
    """
    best = min(errors, key=lambda count: float(np.mean(errors[count])))
    for count in sorted(errors):
        excess = errors[count] - errors[best]
        scatter = float(np.std(excess, ddof=1)) / np.sqrt(len(excess)) if len(excess) > 1 else 0.0
        if float(np.mean(excess)) <= max(scatter, NEGLIGIBLE_EXCESS * float(np.mean(errors[best]))):
            return count
    return best


def by_deflection(parameters: Parameters) -> Parameters:
    """Return the same parameters with the elements in the order of their slip deflections."""
    order = np.argsort(parameters.slip_deflection)
    return replace(parameters, kappa=parameters.kappa[order], level=parameters.level[order])


def _merge_elements(parameters: Parameters, count: int) -> Parameters:
    """Return the same model with fewer elements."""
    order = np.argsort(parameters.level / parameters.kappa)
    level = parameters.level[order]
    deflection, force = cluster(level / parameters.kappa[order], level, count)
    return Parameters(parameters.scalars, force / deflection, force, parameters.effects)
