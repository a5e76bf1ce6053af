"""How many elements: the fewest whose error on chunks that did not teach is as good as the best."""

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
from sgms_observer.identification.start_values import Atoms, merge_elements, start_parameters

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

_CHUNKS = 30  # of equal duration; every third judges and does not teach
_FEWEST_ROWS = 500
AS_GOOD = 0.04  # excess of the mean squared error that is not worth another element
_STARTS = (1.0, 5.0, 0.2)  # times the start's Stribeck velocity
_BETTER = 0.995  # cost over that of one element less: worth merging back from


@dataclass(frozen=True)
class Rows:
    """The recordings prepared in several ways, with the rows to use.

    Attributes:
        main: recordings as prepared for the estimate.
        masks: rows of ``main`` after the elements have forgotten their start.
        others: the same recordings prepared in other ways, each with its rows.
        judges: rows of ``main`` in chunks that judge and do not teach.
        chunks: chunk number of each row of ``main``.
    """

    main: list[Prepared]
    masks: list[Booleans]
    others: tuple[tuple[list[Prepared], list[Booleans]], ...]
    judges: list[Booleans]
    chunks: list[NDArray[np.int64]]

    @property
    def teachers(self) -> list[Booleans]:
        """Return the rows that teach."""
        return [mask & ~judge_rows for mask, judge_rows in zip(self.masks, self.judges, strict=True)]


def rows_to_use(main: list[Prepared], others: Sequence[list[Prepared]], deflection: float) -> Rows:
    """Pick the rows: those after the elements have forgotten their start, every third chunk to judge.

    Args:
        main: prepared recordings.
        others: the same prepared in other ways.
        deflection: slip deflection of the elements that matter [m].

    Raises:
        DataError: if nothing is left.
    """
    masks = [piece.settled(deflection) for piece in main]
    if sum(int(mask.sum()) for mask in masks) < _FEWEST_ROWS:
        raise DataError(
            f"these recordings never slide {3.0 * deflection:.2g} {main[0].unit} in one direction, which the elements"
            " need to forget how they started; record longer strokes (sgms excite)"
        )
    chunks = chunk_numbers(main, _CHUNKS)
    judges = [number % 3 == 2 for number in chunks]
    with_masks = tuple((other, [piece.settled(deflection) for piece in other]) for other in others)
    return Rows(main, masks, with_masks, judges, chunks)


def fit_each_count(
    data: Rows,
    atoms: Atoms,
    shape: ElementShape,
    rate: float,
    start_velocity: float,
    counts: tuple[int, ...],
    show: Callable[[float], None] = lambda share: None,
) -> dict[int, Fit]:
    """Search with each number of elements, on the teaching rows.

    Args:
        data: recordings and rows.
        atoms: the convex fit.
        shape: kind of model and its smoothing.
        rate: start value of c [1/s].
        start_velocity: start value of v_s [m/s]; several multiples of it are tried.
        counts: numbers of elements, consecutive.
        show: told how much is done, from 0 to 1.
    """
    first = min(2, *counts)
    searches = len(_STARTS) + 2 * len(counts) - 1
    trials = []
    for number, share in enumerate(_STARTS):
        show(number / searches)
        start = start_parameters(atoms, first, start_velocity * share, 0.0, rate)
        trials.append(search(data.main, data.teachers, start, shape, iterations=12, tolerance=1e-3))
    velocity = float(min(trials, key=lambda fit: fit.cost).parameters.scalars[V_S])
    fits = {}
    for number, count in enumerate(counts, len(trials)):
        show(number / searches)
        start = start_parameters(atoms, count, velocity, 0.0, rate)
        fits[count] = search(data.main, data.teachers, start, shape, iterations=20, tolerance=1e-3)
    for number, count in enumerate(sorted(fits, reverse=True)[1:], len(trials) + len(fits)):
        show(number / searches)
        if fits[count + 1].cost < _BETTER * fits[count].cost:
            merged = merge_elements(fits[count + 1].parameters, count)
            again = search(data.main, data.teachers, merged, shape, iterations=20, tolerance=1e-3)
            fits[count] = min(fits[count], again, key=lambda fit: fit.cost)
    return fits


def judged_squares(data: Rows, parameters: Parameters, shape: ElementShape) -> Floats:
    """Return the mean squared error of each judging chunk [N^2].

    Args:
        data: recordings and rows.
        parameters: the model to judge.
        shape: kind of model and its smoothing.
    """
    out: list[float] = []
    for piece, mask, judges, chunk in zip(data.main, data.masks, data.judges, data.chunks, strict=True):
        residual, _jacobian = residual_and_jacobian(piece, parameters, shape)
        rows = mask & judges
        out.extend(float(np.mean(residual[rows & (chunk == name)] ** 2)) for name in np.unique(chunk[rows]))
    return np.array(out)


def choose_count(errors: dict[int, Floats]) -> int:
    """Return the fewest elements that are as good as the best: within the chunks' scatter, or within 2 % of its rms.

    Args:
        errors: number of elements to the squared error of each judging chunk.
    """
    best = min(errors, key=lambda count: float(np.mean(errors[count])))
    for count in sorted(errors):
        excess = errors[count] - errors[best]
        scatter = float(np.std(excess, ddof=1)) / np.sqrt(len(excess)) if len(excess) > 1 else 0.0
        if float(np.mean(excess)) <= max(scatter, AS_GOOD * float(np.mean(errors[best]))):
            return count
    return best


def by_deflection(parameters: Parameters) -> Parameters:
    """Return the same parameters, the element that slips first in front."""
    order = np.argsort(parameters.slip_deflection)
    return replace(parameters, kappa=parameters.kappa[order], level=parameters.level[order])
