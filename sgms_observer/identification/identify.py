"""Identify an axis: number of elements by held-out error, then everything at once, then what the recording showed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sgms_observer.errors import DataError
from sgms_observer.identification.confidence import Confidence, judge, step_to
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
    KnownEffects,
    Parameters,
    Prepared,
    prepare,
    residual_and_jacobian,
)
from sgms_observer.identification.search import Fit, search
from sgms_observer.identification.selection import (
    Rows,
    by_deflection,
    choose_count,
    fit_each_count,
    judged_squares,
    rows_to_use,
)
from sgms_observer.identification.simulation import ElementShape
from sgms_observer.identification.start_values import fit_atoms
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings

Floats = NDArray[np.float64]

_OTHER_CORNER = 2.0**-0.5
_HOPELESS = 0.5  # half interval over value beyond which a shared parameter stays at its start value
_SMALLEST_DEFLECTION = 1.0e-8  # m
_HIGHEST_CUTOFF = 160.0  # Hz
_CUTOFF_SHARE = 0.1  # of the sample rate
_CHOOSING = 0.8  # of the time goes into the number of elements, about; only the progress shown depends on it


@dataclass(frozen=True)
class IdentifyOptions:
    """How to identify.

    Attributes:
        model: ``sgms`` or ``gms``.
        cutoff: corner of the low-pass on the force balance [Hz]; 0 takes a tenth of the sample rate, at most 160 Hz.
        largest_count: most elements to try.
        count: elements to use; 0 lets the held-out error choose.
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
        taught: rms of the force error over the teaching chunks [N].
        held_out: rms of the force error over the judging chunks [N].
    """

    count: int
    taught: float
    held_out: float


@dataclass(frozen=True)
class Identification:
    """The answer.

    Attributes:
        parameters: the estimate.
        confidence: intervals and what was shown.
        frozen: indices of ``Parameters.vector`` that stay at the start value because the data cannot tell.
        relaxation: largest element damping over stiffness that the recordings allow [s], whether or not it was needed.
        choices: held-out error of each number of elements tried.
        rms_error: rms force error over all rows [N].
        rms_effort: rms of the filtered effort over the same rows [N].
        held_out_error: rms force error of the chosen number of elements, on chunks that did not teach [N].
        cutoff: corner of the low-pass that was used [Hz].
        model: ``sgms`` or ``gms``.
        is_converged: whether the last search ended by itself.
    """

    parameters: Parameters
    confidence: Confidence
    frozen: tuple[int, ...]
    relaxation: float
    choices: tuple[HeldOut, ...]
    rms_error: float
    rms_effort: float
    held_out_error: float
    cutoff: float
    model: str
    is_converged: bool


def identify(
    recordings: Sequence[Recording],
    axis: AxisSettings,
    options: IdentifyOptions = IdentifyOptions(),
    show: Callable[[float], None] = lambda share: None,
) -> Identification:
    """Identify one axis from recordings.

    Args:
        recordings: evenly sampled pieces.
        axis: start settings: smoothing, known effects, and values for what the recordings cannot show.
        options: how to identify.
        show: told how much is done, from 0 to 1.

    Returns:
        Estimate with intervals, and what could be shown.

    Raises:
        DataError: if the recordings hold too little motion.
    """
    if not recordings:
        raise DataError("there is no recording to identify from; name at least one bag")
    shape = ElementShape.of(axis.friction, options.model)
    cutoff = options.cutoff or min(_HIGHEST_CUTOFF, *(_CUTOFF_SHARE / recording.period for recording in recordings))
    known = KnownEffects(tuple(item for item in axis.effects if item.name != "offset"), axis.friction)
    main = [prepare(recording, cutoff, known) for recording in recordings]
    lower = [prepare(recording, _OTHER_CORNER * cutoff, known) for recording in recordings]
    shaken = [prepare(recording.with_more_noise(seed), cutoff, known) for seed, recording in enumerate(recordings)]
    largest = _largest_deflection(main)
    start_velocity = axis.friction.stribeck_velocity
    atoms = fit_atoms(main, shape, _SMALLEST_DEFLECTION, largest, start_velocity)
    data = rows_to_use(main, (lower, shaken), atoms.reach)
    rate = axis.friction.attraction_rate / axis.friction.coulomb_force
    counts = (options.count,) if options.count else tuple(range(1, options.largest_count + 1))
    fits = fit_each_count(data, atoms, shape, rate, start_velocity, counts, lambda share: show(_CHOOSING * share))
    show(_CHOOSING)
    errors = {count: judged_squares(data, fit.parameters, shape) for count, fit in fits.items()}
    count = choose_count(errors)
    choices = tuple(
        HeldOut(n, float(np.sqrt(fit.cost)), float(np.sqrt(np.mean(errors[n])))) for n, fit in sorted(fits.items())
    )
    start = by_deflection(fits[count].parameters)
    fit = search(data.main, data.masks, start, shape, iterations=30, tolerance=1e-5)
    frozen: tuple[int, ...] = (RELAXATION,)
    show(0.5 * (_CHOOSING + 1.0))
    confidence = _judge(data, fit, shape, frozen)
    hopeless = _hopeless(fit.parameters, confidence, shape.is_gms)
    relaxation, most = _relaxation(data, fit.parameters, shape, hopeless)
    if relaxation > 0.0:
        frozen = ()
        scalars = fit.parameters.scalars.copy()
        scalars[RELAXATION] = relaxation
        start = replace(fit.parameters, scalars=scalars)
        fit = search(data.main, data.masks, start, shape, frozen, iterations=30, tolerance=1e-5)
        confidence = _judge(data, fit, shape, frozen)
        hopeless = _hopeless(fit.parameters, confidence, shape.is_gms)
    if hopeless:
        frozen = (*frozen, *hopeless)
        start = _at_start(fit.parameters, frozen, axis, rate)
        fit = search(data.main, data.masks, start, shape, frozen, iterations=30, tolerance=1e-5)
        confidence = _judge(data, fit, shape, frozen)
    effort = np.concatenate([piece.effort(piece.time)[mask] for piece, mask in zip(main, data.masks, strict=True)])
    return Identification(
        parameters=fit.parameters,
        confidence=confidence,
        frozen=frozen,
        relaxation=most,
        choices=choices,
        rms_error=float(np.sqrt(fit.cost)),
        rms_effort=float(np.sqrt(np.mean(effort**2))),
        held_out_error=float(np.sqrt(np.mean(errors[count]))),
        cutoff=cutoff,
        model=options.model,
        is_converged=fit.is_converged,
    )


def force_error(
    recordings: Sequence[Recording], parameters: Parameters, axis: AxisSettings, model: str, cutoff: float
) -> float:
    """Return the rms force error of given parameters on recordings [N].

    Args:
        recordings: evenly sampled pieces.
        parameters: the model to judge; also the truth, to know the floor.
        axis: smoothing and known effects.
        model: ``sgms`` or ``gms``.
        cutoff: corner of the low-pass [Hz].
    """
    known = KnownEffects(tuple(item for item in axis.effects if item.name != "offset"), axis.friction)
    total, rows = 0.0, 0
    for recording in recordings:
        piece = prepare(recording, cutoff, known)
        mask = piece.settled(float(parameters.slip_deflection.max()))
        residual, _jacobian = residual_and_jacobian(piece, parameters, ElementShape.of(axis.friction, model))
        total += float(residual[mask] @ residual[mask])
        rows += int(mask.sum())
    if rows == 0:
        raise DataError("these recordings never slide far enough for the elements to forget how they started")
    return float(np.sqrt(total / rows))


def _largest_deflection(data: Sequence[Prepared]) -> float:
    """Return the largest slip deflection that the longest one-way travel can show [m]."""
    travel = max(float(np.ptp(piece.position)) for piece in data)
    if travel < 20.0 * _SMALLEST_DEFLECTION:
        raise DataError(f"the axis moves by {travel:.2g} m only; identification needs sliding and reversals")
    return max(travel / 8.0, 10.0 * _SMALLEST_DEFLECTION)


def _free(size: int, frozen: Sequence[int], is_gms: bool) -> list[int]:
    return [j for j in range(size) if j not in frozen and (j != RATE or is_gms)]


def _judge(data: Rows, fit: Fit, shape: ElementShape, frozen: Sequence[int]) -> Confidence:
    free = _free(len(fit.parameters.vector()), frozen, shape.is_gms)
    return judge(data.main, data.masks, data.others, fit.parameters, shape, free)


def _relaxation(data: Rows, parameters: Parameters, shape: ElementShape, frozen: Sequence[int]) -> tuple[float, float]:
    """Return the elements' damping over stiffness [s], 0 unless the data insist on it, and the most that they allow."""
    free = _free(len(parameters.vector()), frozen, shape.is_gms)
    width = judge(data.main, data.masks, data.others, parameters, shape, free).half_width[RELAXATION]
    value = float(step_to(data.main, data.masks, parameters, shape, free)[free.index(RELAXATION)])
    return (value if value > width else 0.0), max(value, 0.0) + float(width)


def _hopeless(parameters: Parameters, confidence: Confidence, is_gms: bool) -> tuple[int, ...]:
    """Return the shared parameters that the data cannot tell at all."""
    value = parameters.vector()
    out = []
    for index in (MASS, VISCOUS, V_S, RATE):
        if (index != RATE or is_gms) and not confidence.half_width[index] <= _HOPELESS * abs(value[index]):
            out.append(index)
    if not confidence.half_width[RHO] <= max(_HOPELESS * (value[RHO] - 1.0), 0.05):
        out.append(RHO)
    if value[RHO] - 1.0 <= confidence.half_width[RHO] and V_S not in out:
        out.append(V_S)
    if not confidence.half_width[DELAY] <= 1e-3:
        out.append(DELAY)
    if not confidence.half_width[OFFSET] <= 0.5 * float(parameters.level.sum()):
        out.append(OFFSET)
    return tuple(out)


def _at_start(parameters: Parameters, frozen: Sequence[int], axis: AxisSettings, rate: float) -> Parameters:
    """Return the parameters with frozen entries at the start settings' values."""
    friction = axis.friction
    offset = next((item.values[0] for item in axis.effects if item.name == "offset" and item.values), 0.0)
    start = np.array(
        [
            axis.mass,
            max(friction.viscous_coefficient, 1e-3),
            offset,
            0.0,
            max(friction.static_force / friction.coulomb_force, 1.0),
            friction.stribeck_velocity,
            rate,
            0.0,
        ]
    )
    scalars = parameters.scalars.copy()
    chosen = [index for index in frozen if index < ELEMENTS]
    scalars[chosen] = start[chosen]
    return replace(parameters, scalars=scalars)
