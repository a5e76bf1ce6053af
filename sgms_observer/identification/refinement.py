"""The fit of all identifiable parameters to all rows; those that are not identifiable keep their start values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sgms_observer.identification.confidence import Confidence, confidence_of, step_to, widened
from sgms_observer.identification.problem import DELAY, MASS, OFFSET, RATE, RELAXATION, RHO, V_S, VISCOUS, Parameters
from sgms_observer.identification.search import Fit, search
from sgms_observer.identification.selection import NEGLIGIBLE_EXCESS, Rows
from sgms_observer.identification.simulation import ElementShape

Floats = NDArray[np.float64]

_MAX_RELATIVE_HALF_WIDTH = 0.5  # half interval over value up to which a shared parameter is identifiable
_MAX_DELAY_WIDTH = 1.0e-3  # s
_NEGLIGIBLE_EFFECT = 0.01  # of the effort: a smaller strength need not be known to half of itself


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
    data: Rows, parameters: Parameters, shape: ElementShape, at_start: Floats, show: Callable[[], None]
) -> Refined:
    """Fit all identifiable parameters to all rows.

    Args:
        data: recordings and rows.
        parameters: start of the search, with the chosen number of elements.
        shape: kind of model and its smoothing.
        at_start: ``Parameters.vector`` with the values of parameters that are not identifiable [SI units].
        show: called after the first search.
    """
    fit = _search(data, parameters, shape, (RELAXATION,))
    frozen: tuple[int, ...] = (RELAXATION,)
    if fit.parameters.scalars[DELAY] <= 0.0:
        frozen = (*frozen, DELAY)
    show()
    fit, confidence, frozen = _without_not_identifiable(data, fit, shape, frozen, at_start)
    relaxation, most = _relaxation(data, fit.parameters, shape, [j for j in frozen if j != RELAXATION])
    if relaxation > 0.0:
        frozen = tuple(j for j in frozen if j != RELAXATION)
        scalars = fit.parameters.scalars.copy()
        scalars[RELAXATION] = relaxation
        fit = _search(data, replace(fit.parameters, scalars=scalars), shape, frozen)
        fit, confidence, frozen = _without_not_identifiable(data, fit, shape, frozen, at_start)
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
    return search(data.main, data.masks, start, shape, frozen, iterations=60, tolerance=1e-5)


def _confidence(data: Rows, parameters: Parameters, shape: ElementShape, frozen: Sequence[int]) -> Confidence:
    free = parameters.free(frozen, shape.is_gms)
    return confidence_of(data.main, data.masks, data.others, parameters, shape, free)


def _without_not_identifiable(
    data: Rows, fit: Fit, shape: ElementShape, frozen: tuple[int, ...], at_start: Floats
) -> tuple[Fit, Confidence, tuple[int, ...]]:
    """Set parameters that are not identifiable to their start values, the least essential first, and refit the others.

    A parameter stays as fitted, with its wide interval, if the start value increases the cost clearly. The delay is
    always set back, because it absorbs any lead or lag. The change of the other parameters is added to their intervals.
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
    return fit, widened(_confidence(data, fit.parameters, shape, frozen), moved, fit.parameters), frozen


def _relaxation(data: Rows, parameters: Parameters, shape: ElementShape, frozen: Sequence[int]) -> tuple[float, float]:
    """Return the damping of the elements over their stiffness [s], 0 if not significant, and its upper limit."""
    free = parameters.free(frozen, shape.is_gms)
    width = _confidence(data, parameters, shape, frozen).half_width[RELAXATION]
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
