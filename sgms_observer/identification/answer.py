"""An identification as settings: what changes in the YAML, the table beside it, and sentences about the whole."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from sgms_observer.errors import RecordingError
from sgms_observer.identification.effect_terms import SPRING
from sgms_observer.identification.identify import MAX_UNEXPLAINED, Identification
from sgms_observer.identification.least_squares import GRAVITY, SYMMETRIC, InverseModelFit
from sgms_observer.identification.problem import DELAY, MASS, OFFSET, RATE, RELAXATION, RHO, V_S, VISCOUS
from sgms_observer.identification.table import DAMPING, Row, dropped_effects, parameter_rows, remarks_of
from sgms_observer.settings.axis import AxisSettings

_DIGITS = 7
_NEAR_ZERO = ("effects.offset.force",)  # values whose sign is open need no warning
_OFFSET_EFFECT = "offset"
_SYMMETRIC_ROWS = (
    ("mass", "kg"),
    ("friction.viscous_coefficient", "N s/m"),
    ("friction.coulomb_force", "N"),
    ("effects.offset.force", "N"),
)


@dataclass(frozen=True)
class Answer:
    """Everything the YAML takes from an identification of one axis.

    Attributes:
        changes: ``{"friction.static_force": 4.2}``, relative to the axis.
        remarks: the same names to the remark behind them.
        rows: the table of parameters.
        summary: sentences about the whole.
        warnings: sentences about what is not identifiable, each with what to do.
        is_usable: whether the model may be used as it is.
    """

    changes: dict[str, Any]
    remarks: dict[str, str]
    rows: tuple[Row, ...]
    summary: tuple[str, ...] = field(default=())
    warnings: tuple[str, ...] = field(default=())
    is_usable: bool = True


def identification_answer(result: Identification, axis: AxisSettings, sample_period: float) -> Answer:
    """Return the settings of a GMS or S-GMS identification.

    Args:
        result: from ``identify``.
        axis: start settings.
        sample_period: nominal time between two samples [s]; the compensation reaches the stage one later.
    """
    scalars = result.parameters.scalars
    level, kappa = result.parameters.level, result.parameters.kappa
    coulomb = float(level.sum())
    changes: dict[str, Any] = {
        "mass": _rounded(scalars[MASS]),
        "friction.model": result.model,
        "friction.element_stiffness": [_rounded(value) for value in kappa],
        "friction.element_fraction": _fractions(level / coulomb),
        "friction.element_damping": [_rounded(scalars[RELAXATION] * value) for value in kappa],
        "friction.viscous_coefficient": _rounded(scalars[VISCOUS]),
        "friction.static_force": _rounded(max(scalars[RHO] * coulomb, coulomb * (1.0 + 1e-9))),
        "friction.coulomb_force": _rounded(coulomb),
        "friction.stribeck_velocity": _rounded(scalars[V_S]),
    }
    if changes["friction.static_force"] < changes["friction.coulomb_force"]:
        changes["friction.static_force"] = changes["friction.coulomb_force"]
    if result.model == "gms":
        changes["friction.attraction_rate"] = _rounded(scalars[RATE] * coulomb)
    _with_effects(axis, _effect_values(result, axis), changes)
    if result.is_opposed:
        changes["effort_scale"] = -axis.effort_scale
    if DELAY not in result.frozen:
        changes["compensation.look_ahead"] = _rounded(min(_look_ahead(float(scalars[DELAY]), sample_period), 0.1))
    rows = parameter_rows(result, axis)
    return Answer(
        changes, remarks_of(rows, result, axis.units), rows, _summary(result, axis), _warnings(result, axis, rows),
        result.is_usable,
    )  # fmt: skip


def _effect_values(result: Identification, axis: AxisSettings) -> dict[str, dict[str, float]]:
    """Return the values of the offset and of the fitted effects; of an added effect all of them."""
    values = _offset(float(result.parameters.scalars[OFFSET]), float(result.confidence.half_width[OFFSET]), axis)
    vector = result.parameters.effects
    for number, name in enumerate(result.terms.names):
        owner, parameter = name.split(".")
        if owner in dropped_effects(result):
            continue
        if number in vector.free or owner in result.terms.added:
            values.setdefault(owner, {})[parameter] = float(vector.values[number])
    return values


def _offset(force: float, half_width: float, axis: AxisSettings) -> dict[str, dict[str, float]]:
    """Return the value of the offset; none that the file does not list and whose interval contains zero.

    Args:
        force: its value [N].
        half_width: of its 95 % interval [N].
        axis: start settings.
    """
    is_listed = any(item.name == _OFFSET_EFFECT for item in axis.effects)
    return {_OFFSET_EFFECT: {"force": force}} if is_listed or abs(force) > half_width else {}


def _look_ahead(delay: float, sample_period: float) -> float:
    """Return the time from a sample to the middle of the interval in which its compensation acts, the next one [s]."""
    return sample_period + max(delay, 0.5 * sample_period)


def _fractions(shares: Any) -> list[float]:
    """Return shares rounded so that they still sum to 1."""
    rounded = [_rounded(value) for value in shares]
    rounded[-1] = float(f"{1.0 - math.fsum(rounded[:-1]):.12g}") if len(rounded) > 1 else 1.0
    return rounded


def _rounded(value: float) -> float:
    return float(f"{float(value):.{_DIGITS}g}")


def _with_effects(axis: AxisSettings, values: Mapping[str, Mapping[str, float]], changes: dict[str, Any]) -> None:
    """Put effects' values into the changes; those that the axis does not have are added."""
    names = [item.name for item in axis.effects]
    missing = [name for name in values if name not in names]
    if missing:
        changes["effects.names"] = [*names, *missing]
    for name, parameters in values.items():
        changes.update({f"effects.{name}.{key}": _rounded(value) for key, value in parameters.items()})


def least_squares_answer(fit: InverseModelFit, axis: AxisSettings, is_opposed: bool) -> Answer:
    """Return the settings of an inverse-dynamic-model fit.

    Args:
        fit: symmetric fit, with gravity on a revolute joint.
        axis: start settings.
        is_opposed: whether the effort was reversed for it.
    """
    mass, viscous, coulomb, _offset = (fit.value(name) for name in SYMMETRIC)
    unit, word = axis.units.of, axis.units.effort_word
    if viscous < 0.0 or mass <= 0.0 or coulomb <= 0.0:
        raise RecordingError(
            f"least squares gives mass {mass:.3g} {unit('kg')}, viscous {viscous:.3g} {unit('N s/m')}, Coulomb"
            f" {coulomb:.3g} {unit('N')}; check the sign and factor of control_effort (effort_scale)"
        )
    rows, effects = _least_squares_rows(fit, axis)
    changes: dict[str, Any] = {
        "mass": _rounded(mass),
        "friction.viscous_coefficient": _rounded(viscous),
        "friction.coulomb_force": _rounded(coulomb),
        "friction.static_force": _rounded(coulomb),
    }
    if is_opposed:
        changes["effort_scale"] = -axis.effort_scale
    _with_effects(axis, effects, changes)
    remarks = {row.name: row.remark for row in rows}
    remarks["friction.static_force"] = f"{unit('N')}; this model has no Stribeck effect: equal to coulomb_force"
    summary = (
        f"{axis.name}: inverse dynamic model by least squares, low-pass {fit.cutoff:g} Hz;"
        f" {word} residual {100.0 * fit.relative_error:.2f} % of the {word}'s norm",
    )
    warnings = []
    if is_opposed:
        warnings.append(_opposed_sentence(axis))
    if fit.variation_error > MAX_UNEXPLAINED:
        warnings.append(_unexplained_sentence(axis, fit.variation_error, ""))
    return Answer(changes, remarks, rows, summary, tuple(f"Warning: {one}" for one in warnings), not warnings)


def _least_squares_rows(
    fit: InverseModelFit, axis: AxisSettings
) -> tuple[tuple[Row, ...], dict[str, dict[str, float]]]:
    """Return the table of a least-squares fit, and the values of its effects."""
    error = dict(zip(fit.names, 1.96 * fit.std_error, strict=True))
    values = [
        (name, fit.value(column), float(error[column]), axis.units.of(unit))
        for (name, unit), column in zip(_SYMMETRIC_ROWS, SYMMETRIC, strict=True)
    ]
    effects = _offset(fit.value(SYMMETRIC[-1]), float(error[SYMMETRIC[-1]]), axis)
    if GRAVITY[0] in fit.names:
        sine, cosine = (fit.value(name) for name in GRAVITY)
        width = math.hypot(*(error[name] for name in GRAVITY))
        amplitude, angle = math.hypot(sine, cosine), math.atan2(cosine, sine)
        effects["gravity"] = {"amplitude": amplitude, "angle": angle, "ratio": 1.0}
        values.append(("effects.gravity.amplitude", amplitude, width, axis.units.of("N")))
        values.append(("effects.gravity.angle", angle, width / amplitude, "rad"))
    rows = tuple(Row(name, value, width, unit, bool(width <= 0.05 * abs(value))) for name, value, width, unit in values)
    return rows, effects


def judged_on_held_out(answer: Answer, axis: AxisSettings, unexplained: float) -> Answer:
    """Return an answer that is not usable if the model fails on held-out bags.

    Args:
        answer: of the identification.
        axis: start settings.
        unexplained: rms residual over rms effort about its mean there [-].
    """
    if unexplained <= MAX_UNEXPLAINED:
        return answer
    warning = f"Warning: {_unexplained_sentence(axis, unexplained, ' on held-out bags')}"
    return replace(answer, warnings=(*answer.warnings, warning), is_usable=False)


def _opposed_sentence(axis: AxisSettings) -> str:
    return (
        f"{axis.name}: the sign of control_effort is reversed relative to position; set effort_scale:"
        f" {-axis.effort_scale:g}, as in the file that was written, and check the wiring before any effort is sent"
    )


def _unexplained_sentence(axis: AxisSettings, share: float, where: str) -> str:
    word, percent = axis.units.effort_word, f"{100.0 * share:.0f} %"
    return (
        f"{axis.name}: the model is unusable: {percent} of the rms {word} about its mean is unexplained{where}"
        f" (at most {100.0 * MAX_UNEXPLAINED:.0f} %); check units, sign and axis, or find what acts with sgms diagnose"
    )


def _warnings(result: Identification, axis: AxisSettings, rows: Sequence[Row]) -> tuple[str, ...]:
    """Return what a user has to know before using the model, as sentences that start with ``Warning:``."""
    out = []
    if result.is_opposed:
        out.append(_opposed_sentence(axis))
    if not result.unexplained_variation <= MAX_UNEXPLAINED:
        out.append(_unexplained_sentence(axis, result.unexplained_variation, " on held-out chunks"))
    if not result.is_converged:
        out.append(f"{axis.name}: the fit did not converge; rerun from the file that was written, or record longer")
    if result.needs_negative_delay:
        out.append(
            f"{axis.name}: the fit asks for a negative delay, which is impossible: it stays at 0 s; check whether"
            " control_effort is stamped late or position is filtered"
        )
    for row in rows:
        if _is_reported_elsewhere(row.name, result):
            continue
        note = f": {row.note}" if row.note else ""
        if math.isnan(row.half_width):
            fallback = f"{row.value:.6g} {row.unit} of the parameter file stays"
            if row.name == "friction.static_force":
                fallback = f"the parameter file's ratio to coulomb_force stays, {result.parameters.scalars[RHO]:.4g}"
            out.append(f"{axis.name}.{row.name} is not identifiable from this recording; {fallback}{note}")
        elif math.isinf(row.half_width):
            out.append(
                f"{axis.name}.{row.name} = {row.value:.4g} {row.unit} is an estimate without interval: it fits this"
                f" recording and may not fit another{note}"
            )
        elif row.half_width > abs(row.value) and row.name not in _NEAR_ZERO:
            out.append(
                f"{axis.name}.{row.name} = {row.value:.4g} {row.unit} is uncertain, +- {row.half_width:.2g}: it fits"
                f" this recording and may not fit another{note}"
            )
    return tuple(f"Warning: {sentence}" for sentence in out)


def _is_reported_elsewhere(name: str, result: Identification) -> bool:
    """Return whether a value without interval needs no warning: it is no guess, or another row tells."""
    if name == "effects.spring.rest_position":
        return SPRING in result.terms.added
    return name.startswith((DAMPING, "delay", "friction.element_")) or name == "effects.gravity.ratio"


def _summary(result: Identification, axis: AxisSettings) -> tuple[str, ...]:
    """Return sentences about the whole."""
    tried = ", ".join(f"{count}: {error:.4g}" for count, error in result.choices.items())
    word = axis.units.effort_word
    sentences = [
        f"{axis.name}: {result.model} with {result.parameters.count} elements, low-pass {result.cutoff:g} Hz; rms"
        f" {word} residual {result.rms_error:.4g} {axis.units.effort}"
        f" ({100.0 * result.rms_error / result.rms_effort:.2f} % of the rms {word})",
        f"{axis.name}: rms {word} error on held-out chunks by number of elements [{axis.units.effort}]: {tried}",
        f"{axis.name}: {100.0 * result.unexplained:.2f} % of the rms {word} unexplained on held-out chunks;"
        f" {result.band.sentence()}",
    ]
    sentences += [f"{axis.name}: {note}" for note in result.notes]
    return tuple(sentences)
