"""The table of parameters of an identification, and the remarks beside the lines of the YAML."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.effects.catalogue import effect
from sgms_observer.identification.effect_terms import SPRING
from sgms_observer.identification.identify import Identification
from sgms_observer.identification.problem import DELAY, ELEMENTS, MASS, OFFSET, RATE, RELAXATION, RHO, V_S, VISCOUS
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.settings.units import Units

DAMPING = "friction.element_damping"
_UNKNOWN = "not identifiable from this recording"
_SLOW = "slide slower than the Stribeck velocity"


@dataclass(frozen=True)
class Row:
    """One row of the table of parameters.

    Attributes:
        name: parameter as in the YAML.
        value: estimate, SI unit.
        half_width: half its 95 % interval; NaN if it was not estimated, infinite if it has no interval.
        unit: SI unit.
        is_identifiable: whether its interval is within 5 %.
        note: what to do if it is not.
    """

    name: str
    value: float
    half_width: float
    unit: str
    is_identifiable: bool
    note: str = ""

    @property
    def keeps_start_value(self) -> bool:
        """Return whether the recordings do not identify the value at all, so that it was not estimated."""
        return math.isnan(self.half_width)

    @property
    def remark(self) -> str:
        """Return unit, interval, and whether the recordings identify the value."""
        if self.keeps_start_value:
            known = f"{_UNKNOWN}: start value" if self.value else _UNKNOWN
        elif math.isinf(self.half_width):
            known = "an estimate without interval"
        else:
            known = f"+- {self.half_width:.2g} (95 %)" + ("" if self.is_identifiable else ", wider than 5 %")
        note = f"; {self.note}" if self.note and not self.is_identifiable else ""
        return f"{self.unit}; {known}{note}"


def parameter_rows(result: Identification, axis: AxisSettings) -> tuple[Row, ...]:
    """Return the table: scalars, effects, then each element."""
    widths = np.where(np.isin(np.arange(len(result.confidence.half_width)), result.frozen), np.nan,
                      result.confidence.half_width)  # fmt: skip
    return (
        *_scalar_rows(result, axis, widths),
        *_effect_rows(result, axis, widths),
        *_element_rows(result, axis, widths),
    )


def _scalar_rows(result: Identification, axis: AxisSettings, widths: Floats) -> list[Row]:
    """Return the rows of mass, friction but the elements', offset, delay and relaxation."""
    scalars, unit = result.parameters.scalars, axis.units.of
    coulomb = float(result.parameters.level.sum())
    coulomb_width = result.confidence.coulomb_half_width

    def row(name: str, index: int, of_unit: str, note: str, factor: float = 1.0) -> Row:
        known = bool(result.confidence.is_identifiable[index])
        return Row(name, scalars[index] * factor, float(widths[index]) * factor, of_unit, known, note)

    static, static_width = scalars[RHO] * coulomb, math.hypot(coulomb_width * scalars[RHO], coulomb * widths[RHO])
    if RHO in result.frozen:
        is_found_flat = axis.friction.static_force > axis.friction.coulomb_force and scalars[RHO] == 1.0
        static_width = coulomb_width if is_found_flat else float("nan")
    lasting = "reverse faster"
    if RELAXATION in result.frozen:
        lasting = f"less than {result.relaxation:.2g} s, or this recording would show it"
    rows = [
        row("mass", MASS, unit("kg"), "accelerate harder"),
        row("friction.viscous_coefficient", VISCOUS, unit("N s/m"), "slide faster"),
        Row("friction.coulomb_force", coulomb, coulomb_width, unit("N"), coulomb_width <= 0.05 * coulomb,
            "slide further"),
        Row("friction.static_force", static, static_width, unit("N"),
            bool(static_width <= 0.05 * scalars[RHO] * coulomb), _SLOW),
        row("friction.stribeck_velocity", V_S, unit("m/s"), _SLOW),
        row("effects.offset.force", OFFSET, unit("N"), "slide both ways"),
        row("delay", DELAY, "s", "accelerate harder"),
        row(f"{DAMPING} over stiffness", RELAXATION, "s", lasting),
    ]  # fmt: skip
    if result.model == "gms":
        rows.append(row("friction.attraction_rate", RATE, unit("N/s"), _SLOW, coulomb))
    return rows


def _element_rows(result: Identification, axis: AxisSettings, widths: Floats) -> list[Row]:
    """Return the rows of the elements' stiffness, then of their fraction of the Coulomb force."""
    parameters, known = result.parameters, result.confidence.is_identifiable
    n_z, coulomb = parameters.count, float(parameters.level.sum())
    unit = axis.units.of
    notes = [
        f"reverse over less than {axis.units.readable(float(slip))}, where this element slips, many times"
        for slip in parameters.slip_deflection
    ]
    rows = [
        Row(f"friction.element_stiffness[{i + 1}]", kappa, float(widths[ELEMENTS + i]), unit("N/m"),
            bool(known[ELEMENTS + i]), notes[i])
        for i, kappa in enumerate(parameters.kappa)
    ]  # fmt: skip
    return rows + [
        Row(f"friction.element_fraction[{i + 1}]", level / coulomb, float(widths[ELEMENTS + n_z + i]) / coulomb, "-",
            bool(known[ELEMENTS + n_z + i]), notes[i])
        for i, level in enumerate(parameters.level)
    ]  # fmt: skip


def _effect_rows(result: Identification, axis: AxisSettings, widths: Floats) -> list[Row]:
    """Return the table's rows of the fitted effects."""
    rows = []
    vector, first = result.parameters.effects, result.parameters.first_effect
    for number, (name, entry) in enumerate(zip(result.terms.names, result.terms.parameters, strict=True)):
        if name.split(".")[0] in dropped_effects(result):
            continue
        value = float(vector.values[number])
        width = float(widths[first + number]) if number in vector.free else float("nan")
        size = 1.0 if entry.unit == "rad" else abs(value)
        note = result.reasons.get(name, effect(name.split(".")[0]).excitation)
        unit = axis.units.of(entry.unit)
        rows.append(Row(f"effects.{name}", value, width, unit, bool(width <= 0.05 * size), note))
    return rows


def remarks_of(rows: Sequence[Row], result: Identification, units: Units) -> dict[str, str]:
    """Return a remark for each line of the YAML; a list has one for all its entries.

    Args:
        rows: the table.
        result: of the identification.
        units: of the axis.
    """
    single = [row for row in rows if not ("[" in row.name or " " in row.name or row.name == "delay")]
    remarks = {row.name: row.remark for row in single}
    damping = next(row for row in rows if row.name.startswith(DAMPING))
    remarks[DAMPING] = f"{units.of('N s/m')}; over element_stiffness: {damping.remark}"
    for name in ("friction.element_stiffness", "friction.element_fraction"):
        listed = [row for row in rows if row.name.startswith(f"{name}[")]
        widths = ", ".join(
            f"{100.0 * row.half_width / abs(row.value):.2g}" if math.isfinite(row.half_width) else "unknown"
            for row in listed
        )
        wide_elements = ", ".join(row.name.split("[")[1][:-1] for row in listed if not row.is_identifiable)
        remarks[name] = f"{listed[0].unit}; +- {widths} % (95 %)" + (
            f"; wider than 5 %: {wide_elements}" if wide_elements else ""
        )
    if DELAY not in result.frozen:
        delay = next(row for row in rows if row.name == "delay")
        remarks["compensation.look_ahead"] = (
            f"s; effort reaches the motion after {delay.value:.2g} s +- {delay.half_width:.1g}, at least half a sample;"
            " plus one sample"
        )
    return remarks


def dropped_effects(result: Identification) -> tuple[str, ...]:
    """Return effects that the parameter file does not have and the recordings do not show."""
    value, width = result.parameters.vector(), result.confidence.half_width

    def is_shown(owner: str) -> bool:
        index = result.parameters.first_effect + result.terms.strength_of(owner)
        return index not in result.frozen and (owner != SPRING or abs(value[index]) > width[index])

    return tuple(owner for owner in result.terms.added if not is_shown(owner))
