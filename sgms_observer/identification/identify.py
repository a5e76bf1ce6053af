"""Identification of an axis: number of elements by held-out error, fit of all parameters, and their intervals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.errors import DataError
from sgms_observer.identification.confidence import Confidence
from sgms_observer.identification.effect_terms import EffectTerms, effect_terms
from sgms_observer.identification.prepared import MAX_SAMPLES_AT_ONCE, MIN_PERIODS, parts_of_long, prepare_all
from sgms_observer.identification.problem import ElementShape, Parameters
from sgms_observer.identification.selection import (
    Rows,
    by_deflection,
    choose_count,
    fit_each_count,
    most_informative,
    needs_negative_delay,
    refine,
    rows_to_use,
    validation_squares,
)
from sgms_observer.identification.start_values import Start, linear_start
from sgms_observer.offline.band import Band, choose_band
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings

MAX_UNEXPLAINED = 1.0 / 3.0
"""Share of the rms effort about its mean that held-out chunks may leave unexplained; above it the model must not be
used."""
OTHER_CORNER = 2.0**-0.5
"""Corner of the second low-pass over that of the band: the fit repeated below it gives the systematic error."""
_REASON_KEPT = "it acts on the measurement, which a fit could erase; sgms diagnose judges it"
_SELECTION_TIME_SHARE = 0.8  # of the time of a short log, for the choice of the number of elements; for the progress


@dataclass(frozen=True)
class IdentifyOptions:
    """Options of an identification.

    Attributes:
        model: ``sgms`` or ``gms``.
        cutoff: corner of the low-pass on the force balance [Hz]; 0 takes the band.
        largest_count: largest number of elements to try.
        count: number of elements; 0 chooses it by the held-out error.
    """

    model: str = "sgms"
    cutoff: float = 0.0
    largest_count: int = 6
    count: int = 0


@dataclass(frozen=True)
class Identification:
    """Result of an identification.

    Attributes:
        parameters: the estimate.
        confidence: intervals, and which parameters are identifiable.
        frozen: indices of ``Parameters.vector`` that stay at the start value because they are not identifiable.
        relaxation: upper limit of the damping of the elements over their stiffness [s].
        choices: rms of the force error over the validation chunks by the number of elements tried [N].
        rms_error: rms force error over all rows [N].
        rms_effort: rms of the filtered effort over the same rows [N].
        rms_variation: rms of the filtered effort about its mean over the same rows [N].
        held_out_error: rms force error of the chosen number of elements, on validation chunks [N].
        band: the band.
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
    choices: dict[int, float]
    rms_error: float
    rms_effort: float
    rms_variation: float
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
    def unexplained_variation(self) -> float:
        """Rms force error on held-out chunks over the rms effort about its mean [-]."""
        return self.held_out_error / self.rms_variation

    @property
    def is_usable(self) -> bool:
        """Whether the model may be used: it explains the effort, converged, and the effort has the right sign."""
        return self.is_converged and not self.is_opposed and self.unexplained_variation <= MAX_UNEXPLAINED


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
    pieces, notes = long_enough(recordings, OTHER_CORNER * band.corner)
    pieces = [part for parts in parts_of_long(pieces, band.corner, effect_terms(axis)) for part in parts]
    start = linear_start(pieces, axis, shape, band.corner)
    is_opposed = start.atoms.is_opposed
    if is_opposed:
        pieces = [replace(piece, effort=-piece.effort) for piece in pieces]
        start = linear_start(pieces, axis, shape, band.corner)
    if not start.atoms.force.sum() > 0.0:
        raise DataError("these recordings show no friction that follows the motion; check the sign of control_effort")
    data = _rows(pieces, start, band.corner)
    counts = (options.count,) if options.count else tuple(range(1, options.largest_count + 1))
    few = most_informative(data, start.parameters(2, start.velocity), shape, MAX_SAMPLES_AT_ONCE)
    refining = (1.0 - _SELECTION_TIME_SHARE) * data.samples / few.samples
    selected = _SELECTION_TIME_SHARE / (_SELECTION_TIME_SHARE + refining)
    fits = fit_each_count(few, start, shape, counts, lambda share: show(selected * share))
    show(selected)
    errors = {count: validation_squares(data, fit.parameters, shape) for count, fit in fits.items()}
    held_out = {count: float(np.sqrt(np.mean(squares))) for count, squares in sorted(errors.items())}
    count = choose_count(errors)
    chosen = by_deflection(fits[count].parameters)
    refined = refine(
        data, chosen, shape, start.vector(chosen, axis), lambda share: show(selected + share * (1.0 - selected))
    )
    effort = _effort(data)
    return Identification(
        parameters=refined.fit.parameters,
        confidence=refined.confidence,
        frozen=refined.frozen,
        relaxation=refined.relaxation,
        choices=held_out,
        rms_error=float(np.sqrt(refined.fit.cost)),
        rms_effort=float(np.sqrt(np.mean(effort**2))),
        rms_variation=float(np.std(effort)),
        held_out_error=held_out[count],
        band=band,
        model=options.model,
        is_converged=refined.fit.is_converged,
        terms=start.terms,
        reasons=_reasons(start),
        needs_negative_delay=needs_negative_delay(data, refined, shape),
        is_opposed=is_opposed,
        notes=tuple(notes),
    )


def _rows(pieces: Sequence[Recording], start: Start, cutoff: float) -> Rows:
    """Return the pieces with another corner of the low-pass and with more noise beside them, and the rows to use."""
    others = (
        prepare_all(pieces, OTHER_CORNER * cutoff, start.terms),
        prepare_all([piece.with_more_noise(seed) for seed, piece in enumerate(pieces)], cutoff, start.terms),
    )
    return rows_to_use(start.data, others, start.atoms.slip_deflection)


def _effort(data: Rows) -> Floats:
    """Return the filtered effort of all rows [N]."""
    return np.concatenate([piece.effort(piece.time)[mask] for piece, mask in zip(data.main, data.masks, strict=True)])


def _reasons(start: Start) -> dict[str, str]:
    """Return why parameters of effects are not fitted."""
    reasons = {start.terms.names[number]: reason for number, reason in start.linear.reasons.items()}
    reasons |= {name: reason for name in start.terms.names if (reason := start.terms.reason_fixed(name))}
    return reasons | {item.name: _REASON_KEPT for item in start.terms.transforming}


def long_enough(recordings: Sequence[Recording], cutoff: float) -> tuple[list[Recording], list[str]]:
    """Return the pieces that are long enough for a cutoff, and a note about the others.

    Args:
        recordings: evenly sampled pieces, one at least.
        cutoff: lowest corner at which they are filtered [Hz].

    Raises:
        DataError: none is long enough.
    """
    shortest = MIN_PERIODS / cutoff
    pieces = [piece for piece in recordings if piece.duration >= shortest]
    if not pieces:
        longest = max(recordings, key=lambda piece: piece.duration)
        raise DataError(
            f"{longest.name} has no piece of {shortest:.3g} s without a pause, which a low-pass of {cutoff:.4g} Hz"
            f" needs; the longest of {len(recordings)} lasts {longest.duration:.3g} s: record longer without losing"
            " samples"
        )
    skipped = len(recordings) - len(pieces)
    if not skipped:
        return pieces, []
    whole = sum(piece.duration for piece in recordings)
    lost = whole - sum(piece.duration for piece in pieces)
    return pieces, [
        f"{skipped} of {len(recordings)} pieces between pauses are shorter than {shortest:.3g} s and were skipped"
        f" ({lost:.3g} of {whole:.3g} s)"
    ]
