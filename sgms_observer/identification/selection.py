"""Number of elements, chosen on validation chunks, and the fit of all identifiable parameters to all rows."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sgms_observer.arrays import Booleans, Floats, Ints
from sgms_observer.errors import DataError
from sgms_observer.identification.confidence import Confidence, confidence_of, step_to, widened
from sgms_observer.identification.prepared import Prepared
from sgms_observer.identification.problem import (
    DELAY,
    MASS,
    OFFSET,
    RATE,
    RELAXATION,
    RHO,
    V_S,
    VISCOUS,
    ElementShape,
    Parameters,
    chunk_numbers,
    residual_and_jacobian,
)
from sgms_observer.identification.search import Fit, search
from sgms_observer.identification.start_values import Start, cluster

_CHUNKS = 30  # of equal numbers of rows; every third is for validation and is not fitted
_MIN_ROWS = 500
NEGLIGIBLE_EXCESS = 0.04  # relative excess of the mean squared error for which no further element is added
_MIN_INFORMATION = 1.0e-6  # of the information of all pieces, that a choice of pieces begins with
_STARTS = (1.0, 5.0, 0.2)  # times the start's Stribeck velocity
_MERGE_COST_RATIO = 0.995  # largest cost, over that of one element less, for which a merged start is tried

_MAX_RELATIVE_HALF_WIDTH = 0.5  # half interval over value up to which a shared parameter is identifiable
_MAX_DELAY_WIDTH = 1.0e-3  # s
_NEGLIGIBLE_EFFECT = 0.01  # of the effort: a smaller strength need not be known to half of itself


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
    chunks: list[Ints]

    @property
    def samples(self) -> int:
        """Return the number of samples that the model is simulated at."""
        return sum(len(piece.position) for piece in self.main)

    @property
    def fit_rows(self) -> list[Booleans]:
        """Return the rows that are fitted."""
        return [mask & ~validation_mask for mask, validation_mask in zip(self.masks, self.validation_rows, strict=True)]

    def of_pieces(self, numbers: Sequence[int]) -> Rows:
        """Return some of the pieces, as prepared for the estimate only.

        Args:
            numbers: of the pieces.
        """
        return Rows(
            [self.main[number] for number in numbers],
            [self.masks[number] for number in numbers],
            (),
            [self.validation_rows[number] for number in numbers],
            [self.chunks[number] for number in numbers],
        )


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
    chunks = chunk_numbers(masks, _CHUNKS)
    validation_rows = [number % 3 == 2 for number in chunks]
    with_masks = tuple((other, [piece.settled(deflection) for piece in other]) for other in others)
    return Rows(main, masks, with_masks, validation_rows, chunks)


def most_informative(data: Rows, parameters: Parameters, shape: ElementShape, most: int) -> Rows:
    """Return the pieces whose fitted rows hold the most information about the parameters, for a faster search.

    The pieces are those of a greedy D-optimal design: each next one adds most to the logarithm of the determinant of
    the information matrix, for each of its samples. A piece at rest, or one that repeats others, adds little.

    Args:
        data: recordings and rows.
        parameters: the parameters at which the information is evaluated.
        shape: kind of model and its smoothing.
        most: number of samples at the working rate up to which pieces are taken; all pieces where they hold no more.
    """
    samples = [len(piece.position) for piece in data.main]
    if data.samples <= most:
        return data
    free = parameters.free((RELAXATION,), shape.is_gms)
    information = []
    for piece, mask in zip(data.main, data.fit_rows, strict=True):
        slopes = residual_and_jacobian(piece, parameters, shape)[1][mask][:, free]
        information.append(slopes.T @ slopes)
    scale = np.sqrt(np.maximum(np.diag(np.sum(information, axis=0)), 1e-300))
    information = [matrix / np.outer(scale, scale) for matrix in information]
    found = _MIN_INFORMATION * np.eye(len(free))
    # Of each piece that is not chosen: minus its gain per sample, its number, and how many were chosen at that time.
    waiting = [(-math.inf, number, -1) for number in range(len(samples))]
    chosen: list[int] = []
    while waiting and sum(samples[number] for number in chosen) < most:
        negative_gain, number, known = heapq.heappop(waiting)
        if known == len(chosen):  # no other piece has a larger gain: gains fall with every piece that is chosen
            if negative_gain < 0.0:
                chosen.append(number)
                found = found + information[number]
            continue
        more = np.linalg.slogdet(found + information[number])[1] - np.linalg.slogdet(found)[1]
        heapq.heappush(waiting, (-float(more) / samples[number], number, len(chosen)))
    return data.of_pieces(sorted(chosen)) if chosen else data


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
    squares, counts = np.zeros(_CHUNKS), np.zeros(_CHUNKS)
    for piece, mask, validation_rows, chunk in zip(
        data.main, data.masks, data.validation_rows, data.chunks, strict=True
    ):
        residual, _jacobian = residual_and_jacobian(piece, parameters, shape)
        rows = mask & validation_rows
        squares += np.bincount(chunk[rows], residual[rows] ** 2, _CHUNKS)
        counts += np.bincount(chunk[rows], minlength=_CHUNKS)
    return np.asarray(squares[counts > 0.0] / counts[counts > 0.0])


def choose_count(errors: dict[int, Floats]) -> int:
    """Return the smallest number of elements with an error within the scatter, or within 2 % rms, of the best."""
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


@dataclass(frozen=True)
class Refined:
    """Result of the last fit.

    Attributes:
        fit: the solution.
        confidence: its intervals.
        frozen: indices of ``Parameters.vector`` that stay at the start value.
        relaxation: upper limit of the damping of the elements over their stiffness [s].
    """

    fit: Fit
    confidence: Confidence
    frozen: tuple[int, ...]
    relaxation: float


def refine(
    data: Rows, parameters: Parameters, shape: ElementShape, at_start: Floats, show: Callable[[float], None]
) -> Refined:
    """Fit all identifiable parameters to all rows.

    Args:
        data: recordings and rows.
        parameters: start of the search, with the chosen number of elements.
        shape: kind of model and its smoothing.
        at_start: ``Parameters.vector`` with the values of parameters that are not identifiable [SI units].
        show: called with the completed share, from 0 to 1.
    """
    fit = _search(data, parameters, shape, (RELAXATION,))
    at_bound = (DELAY,) if fit.parameters.scalars[DELAY] <= 0.0 else ()
    frozen: tuple[int, ...] = (RELAXATION, *at_bound)
    show(0.3)
    fit, confidence, frozen = _without_not_identifiable(data, fit, shape, frozen, at_start, at_bound)
    show(0.7)
    relaxation, most = _relaxation(data, fit.parameters, shape, [j for j in frozen if j != RELAXATION], at_bound)
    if relaxation > 0.0:
        frozen = tuple(j for j in frozen if j != RELAXATION)
        scalars = fit.parameters.scalars.copy()
        scalars[RELAXATION] = relaxation
        fit = _search(data, replace(fit.parameters, scalars=scalars), shape, frozen)
        fit, confidence, frozen = _without_not_identifiable(data, fit, shape, frozen, at_start, at_bound)
    return Refined(fit, confidence, frozen, most)


def needs_negative_delay(data: Rows, refined: Refined, shape: ElementShape) -> bool:
    """Return whether a free delay would be negative by more than its interval.

    Args:
        data: recordings and rows.
        refined: the last fit.
        shape: kind of model and its smoothing.
    """
    parameters = refined.fit.parameters
    if DELAY not in refined.frozen or parameters.scalars[DELAY] > 0.0:
        return False
    free = parameters.free([j for j in refined.frozen if j != DELAY], shape.is_gms)
    place = free.index(DELAY)
    error = confidence_of(data.main, data.masks, (), parameters, shape, free).half_width[DELAY]
    step = float(step_to(data.main, data.masks, parameters, shape, free)[place])
    others = [float(step_to(other, rows, parameters, shape, free)[place]) for other, rows in data.others]
    return bool(-step > error + sum(abs(one - step) for one in others))


def _search(data: Rows, start: Parameters, shape: ElementShape, frozen: Sequence[int]) -> Fit:
    return search(data.main, data.masks, start, shape, frozen, iterations=240, tolerance=1e-5)


def _confidence(
    data: Rows, parameters: Parameters, shape: ElementShape, frozen: Sequence[int], at_bound: Sequence[int] = ()
) -> Confidence:
    free = parameters.free(frozen, shape.is_gms)
    return confidence_of(data.main, data.masks, data.others, parameters, shape, free, at_bound)


def _without_not_identifiable(
    data: Rows,
    fit: Fit,
    shape: ElementShape,
    frozen: tuple[int, ...],
    at_start: Floats,
    at_bound: tuple[int, ...],
) -> tuple[Fit, Confidence, tuple[int, ...]]:
    """Set parameters that are not identifiable to their start values, the least essential first, and refit the others.

    A parameter stays as fitted, with its wide interval, if the start value increases the cost clearly. The delay is
    always set back, because it absorbs any lead or lag. The change of the other parameters is added to their intervals.
    Where the recording refuses the start value of the Stribeck curve, and shows none of its own either, the static
    force is the Coulomb force: then no Stribeck velocity has an effect. Parameters at their bounds are frozen, too; the
    intervals of the result count them as free.
    """
    moved = np.zeros(len(at_start))
    effects = range(fit.parameters.first_effect, len(at_start))
    for group in ((DELAY,), (RHO, V_S, RATE), effects, (MASS, VISCOUS, OFFSET)):
        confidence = _confidence(data, fit.parameters, shape, frozen)
        found = _not_identifiable(fit.parameters, confidence, shape.is_gms, at_start)
        not_identifiable = [index for index in found if index in group and index not in frozen]
        if not_identifiable:
            before = fit.parameters.vector()
            values = before.copy()
            values[not_identifiable] = at_start[not_identifiable]
            start = fit.parameters.with_vector(values)
            held = (*frozen, *not_identifiable)
            again = _search(data, start, shape, held)
            if again.cost <= (1.0 + NEGLIGIBLE_EXCESS) * fit.cost or DELAY in group:
                fit, frozen = again, held
                moved += np.abs(fit.parameters.vector() - before)
        if V_S in not_identifiable and V_S not in frozen:
            scalars = fit.parameters.scalars.copy()
            scalars[RHO], scalars[V_S] = 1.0, at_start[V_S]
            held = (*frozen, RHO, V_S)
            flat = _search(data, replace(fit.parameters, scalars=scalars), shape, held)
            if flat.cost <= (1.0 + NEGLIGIBLE_EXCESS) * fit.cost:
                fit, frozen = flat, held
    return fit, widened(_confidence(data, fit.parameters, shape, frozen, at_bound), moved, fit.parameters), frozen


def _relaxation(
    data: Rows, parameters: Parameters, shape: ElementShape, frozen: Sequence[int], at_bound: Sequence[int]
) -> tuple[float, float]:
    """Return the damping of the elements over their stiffness [s], 0 if not significant, and its upper limit."""
    free = parameters.free(frozen, shape.is_gms)
    width = _confidence(data, parameters, shape, frozen, at_bound).half_width[RELAXATION]
    value = float(step_to(data.main, data.masks, parameters, shape, free)[free.index(RELAXATION)])
    return (value if value > width else 0.0), max(value, 0.0) + float(width)


def _not_identifiable(parameters: Parameters, confidence: Confidence, is_gms: bool, start: Floats) -> tuple[int, ...]:
    """Return the indices of parameters that are not identifiable.

    Mass, viscous coefficient, offset and effects count only if their interval contains the start value.
    """
    value, width = parameters.vector(), confidence.half_width
    out = []
    for index in (MASS, VISCOUS, V_S, RATE):
        if (index != RATE or is_gms) and not width[index] <= _MAX_RELATIVE_HALF_WIDTH * abs(value[index]):
            out.append(index)
    if not width[RHO] <= max(_MAX_RELATIVE_HALF_WIDTH * (value[RHO] - 1.0), 0.05):
        out.append(RHO)
    if value[RHO] - 1.0 <= width[RHO] and V_S not in out:
        out.append(V_S)
    if not width[DELAY] <= _MAX_DELAY_WIDTH:
        out.append(DELAY)
    if not width[OFFSET] <= 0.5 * float(parameters.level.sum()):
        out.append(OFFSET)
    is_contradicted = (np.abs(start - value) > width) & np.isfinite(width)
    out = [index for index in out if index not in (MASS, VISCOUS, OFFSET) or not is_contradicted[index]]
    first = parameters.first_effect
    for number in parameters.effects.free:
        index = first + number
        size = max(abs(value[index]), abs(parameters.effects.scale[number]) * _NEGLIGIBLE_EFFECT)
        if not width[index] <= _MAX_RELATIVE_HALF_WIDTH * size and not is_contradicted[index]:
            out.append(index)
    return tuple(out)
