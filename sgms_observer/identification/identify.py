"""Identification of an axis: number of elements by held-out error, fit of all parameters, and their intervals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from sgms_observer.errors import DataError
from sgms_observer.identification.confidence import Confidence, confidence_of, step_to, widened
from sgms_observer.identification.effect_terms import (
    GRAVITY,
    NO_EFFECTS,
    EffectTerms,
    EffectVector,
    effect_terms,
    reason_fixed,
)
from sgms_observer.identification.linear_effects import LinearEffects, linear_effects
from sgms_observer.identification.prepared import MIN_PERIODS, Prepared, prepare_all
from sgms_observer.identification.problem import (
    DELAY,
    ELEMENTS,
    MASS,
    OFFSET,
    RATE,
    RELAXATION,
    RHO,
    V_S,
    VISCOUS,
    Parameters,
    residual_and_jacobian,
)
from sgms_observer.identification.scales import Scales, scales_of
from sgms_observer.identification.search import Fit, search
from sgms_observer.identification.selection import (
    NEGLIGIBLE_EXCESS,
    Rows,
    by_deflection,
    choose_count,
    fit_each_count,
    rows_to_use,
    validation_squares,
)
from sgms_observer.identification.simulation import ElementShape
from sgms_observer.identification.start_values import Atoms, fit_atoms
from sgms_observer.offline.band import Band, choose_band
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings

Floats = NDArray[np.float64]

MAX_UNEXPLAINED = 1.0 / 3.0
"""Share of the rms effort that held-out chunks may leave unexplained; above it the model must not be used."""
MIN_REVERSALS = 2
"""Fewer reversals cannot tell friction from whatever else changed at that time."""
_REVERSAL_SHARE = 0.02  # of the travel: a shorter way back is no reversal of the sliding
_MIN_GRAVITY_GAIN = 0.05  # share of the squared residual that gravity has to explain where the file does not have it
_OTHER_CORNER = 2.0**-0.5
_MAX_RELATIVE_HALF_WIDTH = 0.5  # half interval over value up to which a shared parameter is identifiable
_V_S_SHARES = (1.0e-3, 0.3)  # of the largest velocity: where the search for the Stribeck velocity starts
_MAX_DELAY_WIDTH = 1.0e-3  # s
_REASON_KEPT = "it acts on the measurement, which a fit could erase; sgms diagnose judges it"
_ITERATIONS = 60
_NEGLIGIBLE_EFFECT = 0.01  # of the effort: a smaller strength need not be known to half of itself
_SELECTION_TIME_SHARE = 0.8  # of the time, for the choice of the number of elements; used for the progress only


@dataclass(frozen=True)
class IdentifyOptions:
    """Options of an identification.

    Attributes:
        model: ``sgms`` or ``gms``.
        cutoff: corner of the low-pass on the force balance [Hz]; 0 takes the judging band.
        largest_count: largest number of elements to try.
        count: number of elements; 0 chooses it by the held-out error.
    """

    model: str = "sgms"
    cutoff: float = 0.0
    largest_count: int = 6
    count: int = 0


@dataclass(frozen=True)
class HeldOut:
    """Held-out error of one number of elements.

    Attributes:
        count: number of elements.
        fit_error: rms of the force error over the fitted chunks [N].
        held_out: rms of the force error over the validation chunks [N].
    """

    count: int
    fit_error: float
    held_out: float


@dataclass(frozen=True)
class Identification:
    """Result of an identification.

    Attributes:
        parameters: the estimate.
        confidence: intervals, and which parameters are identifiable.
        frozen: indices of ``Parameters.vector`` that stay at the start value because they are not identifiable.
        relaxation: upper limit of the damping of the elements over their stiffness [s].
        choices: held-out error of each number of elements tried.
        rms_error: rms force error over all rows [N].
        rms_effort: rms of the filtered effort over the same rows [N].
        held_out_error: rms force error of the chosen number of elements, on validation chunks [N].
        band: the judging band.
        model: ``sgms`` or ``gms``.
        is_converged: whether the last search converged.
        terms: effects of the balance.
        reasons: ``effect.parameter`` that was not fitted, to the reason.
        needs_negative_delay: whether the recordings ask for a negative delay beyond its interval; it stays at 0.
        is_opposed: whether the recorded effort has the opposite sign of the position; the fit uses the reversed effort.
        notes: sentences about the recordings.
    """

    parameters: Parameters
    confidence: Confidence
    frozen: tuple[int, ...]
    relaxation: float
    choices: tuple[HeldOut, ...]
    rms_error: float
    rms_effort: float
    held_out_error: float
    band: Band
    model: str
    is_converged: bool
    terms: EffectTerms = field(default_factory=EffectTerms)
    reasons: dict[str, str] = field(default_factory=dict)
    needs_negative_delay: bool = False
    is_opposed: bool = False
    notes: tuple[str, ...] = ()

    @property
    def cutoff(self) -> float:
        """Corner of the low-pass that was used [Hz]."""
        return self.band.corner

    @property
    def unexplained(self) -> float:
        """Rms force error on held-out chunks over the rms effort [-]."""
        return self.held_out_error / self.rms_effort

    @property
    def is_usable(self) -> bool:
        """Whether the model may be used: it explains the effort, converged, and the effort has the right sign."""
        return self.is_converged and not self.is_opposed and self.unexplained <= MAX_UNEXPLAINED


@dataclass(frozen=True)
class _Start:
    """Start of the search."""

    data: list[Prepared]
    terms: EffectTerms
    linear: LinearEffects
    atoms: Atoms
    scales: Scales
    velocity: float


def identify(
    recordings: Sequence[Recording],
    axis: AxisSettings,
    options: IdentifyOptions = IdentifyOptions(),
    show: Callable[[float], None] = lambda share: None,
) -> Identification:
    """Identify one axis from recordings.

    Args:
        recordings: evenly sampled pieces.
        axis: start settings: smoothing, effects, and values of parameters that are not identifiable.
        options: options of the identification.
        show: called with the completed share, from 0 to 1.

    Returns:
        Estimate with intervals, and which parameters are identifiable.

    Raises:
        DataError: if the recordings hold too little motion.
    """
    if not recordings:
        raise DataError("there is no recording to identify from; name at least one bag")
    shape = ElementShape.of(axis.friction, options.model)
    band = choose_band(recordings, axis, options.cutoff)
    pieces, notes = long_enough(recordings, band.corner)
    start = _linear_start(pieces, axis, shape, band.corner)
    is_opposed = start.atoms.is_opposed
    if is_opposed:
        pieces = [replace(piece, effort=-piece.effort) for piece in pieces]
        start = _linear_start(pieces, axis, shape, band.corner)
    if not start.atoms.force.sum() > 0.0:
        raise DataError("these recordings show no friction that follows the motion; check the sign of control_effort")
    others = (
        prepare_all(pieces, _OTHER_CORNER * band.corner, start.terms),
        prepare_all([piece.with_more_noise(seed) for seed, piece in enumerate(pieces)], band.corner, start.terms),
    )
    data = rows_to_use(start.data, others, start.atoms.slip_deflection)
    rate = axis.friction.attraction_rate / axis.friction.coulomb_force
    counts = (options.count,) if options.count else tuple(range(1, options.largest_count + 1))
    fits = fit_each_count(
        data, start.atoms, shape, rate, start.velocity, counts, lambda share: show(_SELECTION_TIME_SHARE * share)
    )
    show(_SELECTION_TIME_SHARE)
    errors = {count: validation_squares(data, fit.parameters, shape) for count, fit in fits.items()}
    count = choose_count(errors)
    fit, confidence, frozen, most = _final(
        data,
        by_deflection(fits[count].parameters),
        shape,
        axis,
        rate,
        start,
        lambda: show(0.5 * (_SELECTION_TIME_SHARE + 1.0)),
    )
    effort = np.concatenate([piece.effort(piece.time)[mask] for piece, mask in zip(data.main, data.masks, strict=True)])
    reasons = {start.terms.names[number]: reason for number, reason in start.linear.reasons.items()}
    reasons |= {name: reason_fixed(name) for name in start.terms.names if reason_fixed(name)}
    reasons |= {item.name: _REASON_KEPT for item in start.terms.transforming}
    return Identification(
        parameters=fit.parameters,
        confidence=confidence,
        frozen=frozen,
        relaxation=most,
        choices=tuple(
            HeldOut(n, float(np.sqrt(one.cost)), float(np.sqrt(np.mean(errors[n])))) for n, one in sorted(fits.items())
        ),
        rms_error=float(np.sqrt(fit.cost)),
        rms_effort=float(np.sqrt(np.mean(effort**2))),
        held_out_error=float(np.sqrt(np.mean(errors[count]))),
        band=band,
        model=options.model,
        is_converged=fit.is_converged,
        terms=start.terms,
        reasons=reasons,
        needs_negative_delay=DELAY in frozen and _needs_negative_delay(data, fit.parameters, shape, frozen),
        is_opposed=is_opposed,
        notes=tuple(notes),
    )


def force_error(
    recordings: Sequence[Recording],
    parameters: Parameters,
    axis: AxisSettings,
    model: str,
    cutoff: float,
    terms: EffectTerms = NO_EFFECTS,
) -> float:
    """Return the rms force error of given parameters on recordings [N].

    Args:
        recordings: evenly sampled pieces.
        parameters: the model; the true parameters give the floor.
        axis: smoothing.
        model: ``sgms`` or ``gms``.
        cutoff: corner of the low-pass [Hz].
        terms: effects whose values are in ``parameters``.
    """
    total, rows = 0.0, 0
    for piece in prepare_all(recordings, cutoff, terms):
        mask = piece.settled(float(parameters.slip_deflection.max()))
        residual, _jacobian = residual_and_jacobian(piece, parameters, ElementShape.of(axis.friction, model))
        total += float(residual[mask] @ residual[mask])
        rows += int(mask.sum())
    if rows == 0:
        raise DataError("these recordings never slide far enough for the elements to forget how they started")
    return float(np.sqrt(total / rows))


def long_enough(recordings: Sequence[Recording], cutoff: float) -> tuple[list[Recording], list[str]]:
    """Return the pieces that are long enough for a cutoff, and a note about the others.

    Args:
        recordings: evenly sampled pieces, one at least.
        cutoff: corner of the judging band [Hz].
    """
    pieces = [piece for piece in recordings if piece.duration >= MIN_PERIODS / cutoff]
    if not pieces:
        return [max(recordings, key=lambda piece: piece.duration)], []  # its preparation raises the error
    skipped = len(recordings) - len(pieces)
    if not skipped:
        return pieces, []
    return pieces, [f"{skipped} pieces shorter than {MIN_PERIODS / cutoff:.3g} s were skipped"]


def _linear_start(recordings: Sequence[Recording], axis: AxisSettings, shape: ElementShape, cutoff: float) -> _Start:
    """Fit the linear parameters; gravity that the file does not have is kept only if the recordings show it."""
    terms = effect_terms(axis)
    start = _start_with(recordings, axis, shape, cutoff, terms)
    if GRAVITY not in terms.added:
        return start
    without = _start_with(recordings, axis, shape, cutoff, terms.without(GRAVITY))
    number = terms.names.index(f"{GRAVITY}.amplitude")
    is_identifiable = any(strength == number and phase is not None for strength, phase in start.linear.strengths)
    gain = 1.0 - start.atoms.cost / without.atoms.cost
    return start if is_identifiable and gain > _MIN_GRAVITY_GAIN else without


def _start_with(
    recordings: Sequence[Recording], axis: AxisSettings, shape: ElementShape, cutoff: float, terms: EffectTerms
) -> _Start:
    """Fit the linear parameters with given effects."""
    data = prepare_all(recordings, cutoff, terms)
    scales = scales_of(data)
    _check_reversals(data, scales)
    vector: EffectVector = terms.start
    level = np.full(len(data[0].position), axis.friction.coulomb_force)
    vector = replace(vector, scale=data[0].effects.scales(vector, terms.names, level, scales.effort))
    linear = linear_effects(data, terms, vector, axis.friction.coulomb_force)
    low, high = (share * scales.top_velocity for share in _V_S_SHARES)
    velocity = min(max(axis.friction.stribeck_velocity, low), high)
    return _Start(data, terms, linear, fit_atoms(data, shape, scales.smallest, scales.largest, velocity, linear),
                  scales, velocity)  # fmt: skip


def _check_reversals(data: Sequence[Prepared], scales: Scales) -> None:
    """Raise an error if the axis has too few reversals."""
    reversals = 0
    for piece in data:
        turns, extreme, way = 0, float(piece.position[0]), 0
        for value in piece.position[:: piece.stride]:
            moved = float(value) - extreme
            if way * moved > 0.0:
                extreme = float(value)
            elif abs(moved) > _REVERSAL_SHARE * scales.travel:
                turns += way != 0
                extreme, way = float(value), 1 if moved > 0.0 else -1
        reversals += turns
    if reversals < MIN_REVERSALS:
        raise DataError(
            f"the axis reverses {'once' if reversals else 'never'}: these recordings cannot show its friction, which"
            f" offset, gravity and slow changes imitate; record {MIN_REVERSALS} reversals or more (sgms excite)"
        )


def _final(
    data: Rows,
    parameters: Parameters,
    shape: ElementShape,
    axis: AxisSettings,
    rate: float,
    begun: _Start,
    show: Callable[[], None],
) -> tuple[Fit, Confidence, tuple[int, ...], float]:
    """Fit all identifiable parameters to all rows; return fit, intervals, frozen indices and largest damping."""
    fit = search(data.main, data.masks, parameters, shape, iterations=_ITERATIONS, tolerance=1e-5)
    frozen: tuple[int, ...] = (RELAXATION,)
    if fit.parameters.scalars[DELAY] <= 0.0:
        frozen = (*frozen, DELAY)
    show()
    at_start = _at_start(fit.parameters, axis, rate, begun)
    fit, confidence, frozen = _without_not_identifiable(data, fit, shape, frozen, at_start)
    relaxation, most = _relaxation(data, fit.parameters, shape, [j for j in frozen if j != RELAXATION])
    if relaxation > 0.0:
        frozen = tuple(j for j in frozen if j != RELAXATION)
        scalars = fit.parameters.scalars.copy()
        scalars[RELAXATION] = relaxation
        start = replace(fit.parameters, scalars=scalars)
        fit = search(data.main, data.masks, start, shape, frozen, iterations=_ITERATIONS, tolerance=1e-5)
        fit, confidence, frozen = _without_not_identifiable(data, fit, shape, frozen, at_start)
    return fit, confidence, frozen, most


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
        confidence = _confidence(data, fit, shape, frozen)
        found = _not_identifiable(fit.parameters, confidence, shape.is_gms, at_start)
        not_identifiable = [index for index in found if index in group and index not in frozen]
        if not_identifiable:
            before = fit.parameters.vector()
            values = before.copy()
            values[not_identifiable] = at_start[not_identifiable]
            start = fit.parameters.with_vector(values)
            held = (*frozen, *not_identifiable)
            again = search(data.main, data.masks, start, shape, held, iterations=_ITERATIONS, tolerance=1e-5)
            if again.cost <= (1.0 + NEGLIGIBLE_EXCESS) * fit.cost or DELAY in group:
                fit, frozen = again, held
                moved += np.abs(fit.parameters.vector() - before)
    return fit, widened(_confidence(data, fit, shape, frozen), moved, fit.parameters), frozen


def _needs_negative_delay(data: Rows, parameters: Parameters, shape: ElementShape, frozen: Sequence[int]) -> bool:
    """Return whether a free delay would be negative by more than its interval."""
    if parameters.scalars[DELAY] > 0.0:
        return False
    free = parameters.free([j for j in frozen if j != DELAY], shape.is_gms)
    place = free.index(DELAY)
    error = confidence_of(data.main, data.masks, (), parameters, shape, free).half_width[DELAY]
    step = float(step_to(data.main, data.masks, parameters, shape, free)[place])
    others = [float(step_to(other, rows, parameters, shape, free)[place]) for other, rows in data.others]
    return bool(-step > error + sum(abs(one - step) for one in others))


def _confidence(data: Rows, fit: Fit, shape: ElementShape, frozen: Sequence[int]) -> Confidence:
    free = fit.parameters.free(frozen, shape.is_gms)
    return confidence_of(data.main, data.masks, data.others, fit.parameters, shape, free)


def _relaxation(data: Rows, parameters: Parameters, shape: ElementShape, frozen: Sequence[int]) -> tuple[float, float]:
    """Return the damping of the elements over their stiffness [s], 0 if not significant, and its upper limit."""
    free = parameters.free(frozen, shape.is_gms)
    width = confidence_of(data.main, data.masks, data.others, parameters, shape, free).half_width[RELAXATION]
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


def _at_start(parameters: Parameters, axis: AxisSettings, rate: float, begun: _Start) -> Floats:
    """Return ``Parameters.vector`` with the start settings' values of all shared parameters and effects."""
    friction = axis.friction
    offset = next((item.values[0] for item in axis.effects if item.name == "offset" and item.values), 0.0)
    out = parameters.vector()
    out[:ELEMENTS] = [
        axis.mass,
        max(friction.viscous_coefficient, 1e-6 * begun.scales.viscous),
        offset,
        0.0,
        max(friction.static_force / friction.coulomb_force, 1.0),
        friction.stribeck_velocity,
        rate,
        0.0,
    ]
    out[parameters.first_effect :] = begun.terms.start.values
    return out
